//! Questions to a program, and equality of programs.

use std::hash::{Hash, Hasher};
use std::time::Duration;

use rustc_hash::FxHasher;

use crate::bid::Bid;
use crate::board::{Entry, Owner};
use crate::bthread::{AnyBThread, BThread};
use crate::event::Event;
use crate::event_set::EventSet;
use crate::explain::Explanation;
use crate::program::Program;

impl Program {
    /// The b-threads that run, by name, with their bids and how many synchronisation points each has reached, the
    /// present one included. A name that is used again goes on counting.
    pub fn bids(&self) -> impl Iterator<Item = (&str, &Bid, u64)> {
        self.board.bthreads().map(|(entry, _)| (&*entry.name, &entry.bid, entry.sync))
    }

    /// The bid of one b-thread that runs.
    pub fn bid(&self, name: &str) -> Option<&Bid> {
        self.board.get(self.board.bthread(name)?).map(|entry| &entry.bid)
    }

    /// The statements that b-threads which run here [make](Bid::state) at present, by their names; proxies state nothing.
    pub fn stated(&self) -> impl Iterator<Item = (&str, &Event)> {
        self.bids().flat_map(|(name, bid, _)| bid.stated().iter().map(move |event| (name, event)))
    }

    /// The proxies by name, with what is left of their bids.
    pub fn proxies(&self) -> impl Iterator<Item = (&str, &Bid)> {
        self.board.proxies().map(|entry| (&*entry.name, &entry.bid))
    }

    /// A number that changes whenever a b-thread states a bid or ends.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// When the next deadline passes.
    pub fn next_deadline(&self) -> Option<Duration> {
        self.board.next_deadline()
    }

    /// The events that may be selected: the internal ones that tie, or else the external event whose turn it is.
    pub fn selectable(&self) -> Vec<Event> {
        let mut offers = Vec::new();
        if !self.external_has_turn() || self.next_external().is_none() {
            self.board.offers(&mut offers);
        }
        if offers.is_empty() {
            offers.extend(self.next_external().and_then(|at| self.externals.get(at)).cloned());
        }
        offers
    }

    /// Whether a b-thread requests something here and the b-threads among themselves allow nothing at all. Time and
    /// other nodes still help: while a deadline is open, or where only a proxy blocks, the program is stalled, not
    /// deadlocked.
    pub fn is_deadlocked(&self) -> bool {
        let stuck = |event: &Event| self.board.is_blocked_by_bthread(event);
        self.occurrences.is_empty()
            && self.board.next_deadline().is_none()
            && self.board.requests().any(|(entry, _)| !entry.is_proxy())
            && self.board.requests().all(|(_, event)| stuck(event))
            && self.externals.iter().filter(|event| self.board.is_home(event)).all(stuck)
    }

    /// The b-thread whose assertion failed first, and what it said.
    pub fn failed(&self) -> Option<(&str, &str)> {
        self.failure.as_ref().map(|(bthread, message)| (&**bthread, &**message))
    }

    /// Whether the program has b-threads.
    pub fn has_bthreads(&self) -> bool {
        self.board.has_bthreads()
    }

    /// Whether the program, when it has nothing to do, waits for external events. A driver that runs a program to its
    /// end heeds it; the program itself does not.
    pub fn is_daemon(&self) -> bool {
        self.daemon
    }

    /// Events that wait for their turn, next one first.
    pub fn external_queue(&self) -> impl ExactSizeIterator<Item = &Event> {
        self.externals.iter()
    }

    /// The b-threads that request, block and wait for the events of a set: `program.explain("uav/3/takeoff")`.
    pub fn explain(&self, question: impl Into<EventSet>) -> Explanation {
        Explanation::of(question.into(), &self.board, self.externals.iter(), self.selectable())
    }

    /// The b-threads and proxies that block `event` now, in the order they came.
    pub fn blockers(&self, event: &Event) -> impl Iterator<Item = &str> {
        self.board.entries().filter(move |entry| self.board.blocks(entry, event)).map(|entry| &*entry.name)
    }

    /// The state of one b-thread, if it runs and is a `T`.
    pub fn state_of<T: BThread>(&self, name: &str) -> Option<&T> {
        match &self.board.get(self.board.bthread(name)?)?.owner {
            Owner::BThread(bthread) => bthread.as_any().downcast_ref(),
            Owner::Proxy => None,
        }
    }

    /// The states of all b-threads, by name, to be shown or recorded.
    ///
    /// # Errors
    /// When a state has no JSON form, such as a map whose keys are not texts.
    pub fn states_json(&self) -> Result<serde_json::Value, serde_json::Error> {
        let states =
            self.board.bthreads().map(|(entry, bthread)| Ok((entry.name.to_string(), bthread.to_json()?)));
        states.collect::<Result<serde_json::Map<_, _>, _>>().map(serde_json::Value::Object)
    }

    /// A hash of all that equality compares. The same in every run of the same build.
    pub fn state_digest(&self) -> u64 {
        let mut hasher = FxHasher::default();
        self.hash(&mut hasher);
        hasher.finish()
    }
}

impl PartialEq for Program {
    fn eq(&self, other: &Self) -> bool {
        let same_bthread =
            |((a, state), (b, other)): ((&Entry, &dyn AnyBThread), (&Entry, &dyn AnyBThread))| {
                a.name == b.name && state.equals(other)
            };
        self.externals == other.externals
            && self.occurrences == other.occurrences
            && self.failure == other.failure
            && self.board.bthreads().count() == other.board.bthreads().count()
            && self.board.bthreads().zip(other.board.bthreads()).all(same_bthread)
            && self.proxies().eq(other.proxies())
    }
}

impl Eq for Program {}

impl Hash for Program {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.externals.hash(state);
        self.occurrences.hash(state);
        for (entry, bthread) in self.board.bthreads() {
            entry.name.hash(state);
            bthread.hash_into(state);
        }
        for proxy in self.proxies() {
            proxy.hash(state);
        }
    }
}
