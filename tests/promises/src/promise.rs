//! The promises, and their breach.

use std::fmt;
use std::time::Duration;

use skein_dbp::NodeName;

/// A promise, as the design numbers them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Promise {
    /// A node sees a home's occurrences in order; what is missing is repaired or told.
    G1,
    /// An event occurs only while a bid in its home's table requests it.
    G2,
    /// Between `confirmed` and `block_lapsed` or withdrawal, a blocked event does not occur.
    G3,
    /// A request is satisfied at most once.
    G4,
    /// What a lost node bid lapses with its lease.
    G5,
    /// Safety events wait for nobody, and enter from afar by the gateway only.
    G6,
    /// A bid beyond its sender's rights counts for nothing, and both ends are told.
    G7,
    /// A joint event has one decision, taken on fresh word from all, which all learn before a later one.
    G8,
    /// A node's run is that of its program with proxies moved by the channel.
    G9,
    /// When faults end, everything goes on: streams converge, blocks are confirmed, requests are served.
    GoesOn,
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::G1 => "G1",
            Self::G2 => "G2",
            Self::G3 => "G3",
            Self::G4 => "G4",
            Self::G5 => "G5",
            Self::G6 => "G6",
            Self::G7 => "G7",
            Self::G8 => "G8",
            Self::G9 => "G9",
            Self::GoesOn => "goes on",
        })
    }
}

/// A promise that was not kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    pub promise: Promise,
    /// When, true time since the run began.
    pub at: Duration,
    /// Where it was seen.
    pub node: NodeName,
    /// The breach in words.
    pub what: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} broken at {:.3} s, at {}: {}",
            self.promise,
            self.at.as_secs_f64(),
            self.node,
            self.what
        )
    }
}
