//! The rules by which a program selects.

use serde::{Deserialize, Serialize};

use crate::event_set::EventSet;

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

/// An event that lost so many ties goes first, unless configured.
pub const PASSED_OVER_LIMIT: u32 = 16;

/// The rules by which a program selects. The default is the literature's: simple strategy, external events only when
/// nothing internal is selectable, no limits but fairness in ties.
#[derive(Clone, Debug)]
pub struct ProgramConfig {
    /// The rule that says which requested events may be selected.
    pub strategy: Strategy,
    /// Seed of the draws that break ties. The same program, inputs and seed give the same run.
    pub seed: u64,
    /// After this many internal selections an external event that waits gets its turn; `None`: only when nothing
    /// internal is selectable.
    pub externals_after: Option<u32>,
    /// The most selections of a superstep; `None`: any number.
    pub settle_limit: Option<u32>,
    /// An event that lost so many ties is taken next; `None`: ties are drawn and nothing else.
    pub passed_over_limit: Option<u32>,
    /// Events that proxies cannot block.
    pub protected: EventSet,
    /// The number of requests that lost to be noted with each selection, for people.
    pub rivals: usize,
}

impl Default for ProgramConfig {
    fn default() -> Self {
        Self {
            strategy: Strategy::Simple,
            seed: 0,
            externals_after: None,
            settle_limit: None,
            passed_over_limit: Some(PASSED_OVER_LIMIT),
            protected: EventSet::None,
            rivals: 0,
        }
    }
}

impl ProgramConfig {
    /// The rules on vehicles: priorities of bids, external events after at most 16 internal ones, at most 1000
    /// selections in a superstep; four rivals are noted with each.
    pub fn vehicle(seed: u64) -> Self {
        Self {
            strategy: Strategy::SyncPriority,
            seed,
            externals_after: Some(16),
            settle_limit: Some(1000),
            rivals: 4,
            ..Self::default()
        }
    }
}
