//! The promises of a node that outlive it.

use serde::{Deserialize, Serialize};
use skein_bp::{Event, EventSet};

use crate::joint::roster::Roster;
use crate::name::NodeName;

/// The promises that a node must keep on disk.
///
/// A driver saves what [`Node::take_unsaved`](crate::Node::take_unsaved) gives. Until that is on disk, and it
/// has said so by [`Node::saved`](crate::Node::saved), it sends of
/// [`Node::take_outgoing`](crate::Node::take_outgoing) what [`Node::sort_out`](crate::Node::sort_out) lets
/// pass. The saved value is handed to the node's next life in [`NodeConfig::kept`](crate::NodeConfig::kept).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Kept {
    /// Blocks that stay although their holders may be lost (G5).
    pub blocks: Vec<KeptBlock>,
    /// The roster of the present term, once an operator has changed it (G8).
    pub roster: Option<Roster>,
    /// As coordinator: the term whose decisions these are.
    pub term: u64,
    /// Its decisions, in order (G8).
    pub decisions: Vec<Event>,
}

/// A remote b-thread's block that lasts until it is withdrawn or an authority lifts it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptBlock {
    /// The holder's node.
    pub node: NodeName,
    /// The life of that node in which the block was stated last, or another of its lives that have ended.
    pub incarnation: u64,
    pub bthread: String,
    pub sync: u64,
    pub block: EventSet,
}
