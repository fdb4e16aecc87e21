//! The events by which an operator rules a node, whatever its program.

use std::sync::Arc;

use crate::name::NodeName;

skein_bp::events! {
    /// An operator's requests of any node.
    pub const RULES;

    /// Lift a block that outlives its holder (G5).
    Lift = "lift", Operator {
        /// The holder of the block.
        node: NodeName,
        bthread: Arc<str>,
    }
    /// Take up a new roster (G8).
    NewRoster = "roster", Operator {
        /// Above the present term.
        term: u64,
        coordinator: NodeName,
        /// Their names, with blanks between.
        members: Arc<str>,
    }
}
