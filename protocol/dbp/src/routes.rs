//! The way from an event to the node that decides on it.

use skein_bp::{Event, EventSet};

use crate::channel::peers::Peers;
use crate::joint::roster::{Roster, SWARM};
use crate::name::{NodeName, first_two_chunks};

/// The place at which an event is decided.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Route {
    Here,
    /// Wherever it is selected: it has no home and does not travel.
    Local,
    /// At another member of the fleet.
    Elsewhere(NodeName),
    /// At a node that is not in the fleet.
    Unroutable,
}

/// The homes of all events, as one node knows them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Routes<'a> {
    /// The events that are decided here.
    pub(crate) here: &'a EventSet,
    /// The nodes that decide on joint events.
    pub(crate) roster: Option<&'a Roster>,
    pub(crate) peers: &'a Peers,
}

impl Routes<'_> {
    pub(crate) fn of(&self, event: &Event) -> Route {
        if self.here.contains(event) {
            return Route::Here;
        }
        let home = if event.name().starts_with(SWARM) {
            self.roster.map(|roster| &roster.coordinator)
        } else {
            let Some(prefix) = first_two_chunks(event.name()) else { return Route::Local };
            self.peers.name(prefix)
        };
        home.map_or(Route::Unroutable, |name| Route::Elsewhere(name.clone()))
    }

    /// The other homes whose events a set may hold.
    pub(crate) fn concerned_by(&self, set: &EventSet) -> Vec<NodeName> {
        if set.is_none() {
            return Vec::new();
        }
        let concerns = |home: &NodeName| {
            set.could_match_home(home.as_str())
                || self.roster.is_some_and(|roster| {
                    roster.coordinator == *home && set.may_overlap(&Roster::joint_events())
                })
        };
        let member = |home: &NodeName| self.roster.is_none_or(|roster| roster.members.contains(home));
        self.peers.names().filter(|home| member(home) && concerns(home)).cloned().collect()
    }
}
