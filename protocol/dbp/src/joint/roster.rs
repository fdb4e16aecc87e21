//! The nodes that decide together, and the one that decides for all.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use skein_bp::catalogue::Declared as _;
use skein_bp::{Event, EventSet};

use crate::name::{NodeName, NodeNameError};
use crate::rule::NewRoster;

/// First chunk of the events that the coordinator is home to.
pub const SWARM: &str = "swarm/";

/// The nodes that decide on joint events, for one term.
///
/// `swarm/...` events are selected by the coordinator, and only while it has fresh word from every member that this one
/// is in the same term and has applied all earlier decisions (G8). Terms follow one another by operator order.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Roster {
    /// From 1; a later term makes an earlier one void.
    pub term: u64,
    /// The home of joint events.
    pub coordinator: NodeName,
    /// Every node without which nothing is decided, the coordinator among them.
    pub members: BTreeSet<NodeName>,
}

/// Why an order is no roster.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RosterError {
    #[error("`term` must be a whole number from 1")]
    Term,
    #[error("`{0}` must name the nodes")]
    Missing(&'static str),
    #[error(transparent)]
    Name(#[from] NodeNameError),
    #[error("the coordinator {0} must be a member")]
    Coordinator(NodeName),
}

impl Roster {
    pub fn first(coordinator: NodeName, members: impl IntoIterator<Item = NodeName>) -> Self {
        let members = members.into_iter().chain([coordinator.clone()]).collect();
        Self { term: 1, coordinator, members }
    }

    /// The event by which an operator gives `node` this roster.
    pub fn order(&self, node: &NodeName) -> Event {
        let members: Vec<&str> = self.members.iter().map(NodeName::as_str).collect();
        let (term, coordinator) = (self.term, self.coordinator.clone());
        NewRoster { term, coordinator, members: members.join(" ").into() }.at(node)
    }

    /// The roster that such an order gives.
    pub fn ordered(order: &Event) -> Result<Self, RosterError> {
        let term = order.int("term").and_then(|term| u64::try_from(term).ok()).filter(|term| *term > 0);
        let coordinator =
            NodeName::new(order.text("coordinator").ok_or(RosterError::Missing("coordinator"))?)?;
        let members = order.text("members").ok_or(RosterError::Missing("members"))?;
        let members = members.split_whitespace().map(NodeName::new).collect::<Result<BTreeSet<_>, _>>()?;
        if !members.contains(&coordinator) {
            return Err(RosterError::Coordinator(coordinator));
        }
        Ok(Self { term: term.ok_or(RosterError::Term)?, coordinator, members })
    }

    pub fn joint_events() -> EventSet {
        EventSet::prefix(SWARM)
    }

    pub(crate) fn is_joint(event: &Event) -> bool {
        event.name().starts_with(SWARM)
    }
}
