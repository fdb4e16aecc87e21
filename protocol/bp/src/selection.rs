//! Selections: what happened at one synchronisation point, and why.

use std::fmt;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::event::Event;

/// Names of b-threads. Most events move one or two, which need no allocation.
pub type Names = SmallVec<[Arc<str>; 2]>;

crate::words! {
    /// The source of a selected event.
    pub enum Origin {
        /// Requested by a b-thread or a proxy.
        Internal = "internal",
        /// Taken from the external queue.
        External = "external",
        /// Selected elsewhere and delivered here as a fact.
        Occurred = "occurred",
    }
}

/// One event that happened and the b-threads it moved, each list in the order in which the b-threads were added.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    pub event: Event,
    pub origin: Origin,
    /// B-threads and proxies that requested it. The proxies among them are served: their bids are now empty.
    pub requested_by: Names,
    /// B-threads that resumed.
    pub resumed: Names,
    /// B-threads that it ended.
    pub interrupted: Names,
    /// The number of other events that could have been selected in its place.
    pub tied_with: usize,
    /// The highest priority at which it was requested.
    pub priority: Option<i32>,
    /// The other requests, as far as [`ProgramConfig::rivals`](crate::ProgramConfig::rivals) allows; of an internal
    /// event only.
    pub rivals: Vec<Rival>,
}

/// A request that another one went before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rival {
    pub bthread: Arc<str>,
    pub event: Event,
    pub priority: Option<i32>,
    /// Whether somebody blocked it; if not, its priority was lower, or it lost the tie.
    pub blocked: bool,
}

impl fmt::Display for Rival {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} by {}", self.event.name(), self.bthread)?;
        match (self.blocked, self.priority) {
            (true, _) => f.write_str(" (blocked)"),
            (false, Some(priority)) => write!(f, " (priority {priority})"),
            (false, None) => Ok(()),
        }
    }
}
