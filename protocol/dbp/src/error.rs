//! Reasons why a node's step does not go well.

use std::sync::Arc;

use skein_bp::ProgramError;

use crate::name::NodeName;

/// A step that did not go well. What happened in it counts all the same.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NodeError {
    /// The program cannot go on.
    #[error(transparent)]
    Program(#[from] ProgramError),
    #[error("{node}: the step did not settle within {limit} selections; look at the b-threads that kept requesting: {}", .bthreads.join(", "))]
    Unsettled { node: NodeName, limit: usize, bthreads: Vec<Arc<str>> },
    #[error("{node}: b-thread `{bthread}` requests events of {} at one synchronisation point; request at one home only", .homes.join(" and "))]
    TwoHomes { node: NodeName, bthread: String, homes: Vec<String> },
}
