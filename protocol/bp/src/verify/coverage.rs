//! The parts of a program that a verification has met.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::bid::Bid;
use crate::event::Event;

/// The b-threads and events that were met in the states that were looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// The b-threads, by name.
    pub bthreads: BTreeMap<Arc<str>, BThreadCoverage>,
    /// The events that happened in some run.
    pub happened: BTreeSet<Event>,
}

/// The states and bids of one b-thread that were met.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BThreadCoverage {
    pub states: usize,
    /// The bids that it stated, each once, in the order in which they were met.
    pub bids: Vec<Bid>,
    /// Whether a deadline of it has fired.
    pub timed_out: bool,
}

impl Coverage {
    /// Adds what another verification has met.
    pub fn join(&mut self, other: Self) {
        for (name, seen) in other.bthreads {
            let known = self.bthreads.entry(name).or_default();
            // Which states were the same is not known; those of the wider search are counted.
            known.states = known.states.max(seen.states);
            known.timed_out |= seen.timed_out;
            for bid in seen.bids {
                if !known.bids.contains(&bid) {
                    known.bids.push(bid);
                }
            }
        }
        self.happened.extend(other.happened);
    }
}
