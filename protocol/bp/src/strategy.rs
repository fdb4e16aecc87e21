//! Strategies: which of the requested, unblocked events may be selected.

use serde::{Deserialize, Serialize};

/// The rule by which a program chooses among requested and unblocked events.
///
/// Whatever the strategy, equal events merge, and what is left undecided is a tie, drawn from the run's seed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// All of them are equal.
    #[default]
    Simple,
    /// Each b-thread offers the first of its requests that is not blocked.
    Ordered,
    /// The greatest [`Bid::priority`](crate::Bid::priority) wins; a bid without one is lowest.
    SyncPriority,
    /// The greatest [`BThread::priority`](crate::BThread::priority) wins.
    #[serde(rename = "bthread_priority")]
    BThreadPriority,
}
