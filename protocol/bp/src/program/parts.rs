//! Taking a program apart, and putting another of the same settings together, for a verifier.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use crate::bid::Bid;
use crate::board::{Entry, Owner};
use crate::event::Event;
use crate::event_set::EventSet;
use crate::program::Program;
use crate::program::config::ProgramConfig;
use crate::selection::Origin;

/// The state of a program beside its b-threads and proxies.
#[derive(Clone, Debug)]
pub(crate) struct Rest {
    pub(crate) externals: VecDeque<Event>,
    pub(crate) occurrences: VecDeque<Event>,
    pub(crate) failure: Option<(Arc<str>, String)>,
    pub(crate) daemon: bool,
}

impl Program {
    pub(crate) fn config(&self) -> &ProgramConfig {
        &self.config
    }

    pub(crate) fn home(&self) -> &EventSet {
        &self.board.home
    }

    /// B-threads and proxies in the order they came.
    pub(crate) fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.board.entries()
    }

    pub(crate) fn rest(&self) -> Rest {
        Rest {
            externals: self.externals.clone(),
            occurrences: self.occurrences.clone(),
            failure: self.failure.clone(),
            daemon: self.daemon,
        }
    }

    /// A program whose b-threads and proxies are at these synchronisation points.
    pub(crate) fn assemble(&self, seats: impl Iterator<Item = (Arc<str>, Owner, Bid)>, rest: Rest) -> Self {
        let mut program = Self::new(self.config.clone());
        program.set_home(&self.board.home);
        for (name, owner, bid) in seats {
            let place = program.board.add(name, owner, 0);
            program.board.restate(place, bid);
        }
        let Rest { externals, occurrences, failure, daemon } = rest;
        Self { externals, occurrences, failure, daemon, ..program }
    }

    /// Lets an event happen that may be selected: an internal one, or the external one at a position in the queue.
    pub(crate) fn select(&mut self, event: Event, external: Option<usize>) {
        let origin = match external {
            Some(at) => {
                self.externals.remove(at);
                Origin::External
            }
            None => Origin::Internal,
        };
        self.deliver(event, origin, 0, Duration::ZERO);
    }

    /// Resumes a b-thread as if its deadline had passed, for one who explores all runs and for whom time has no length.
    pub fn fire_deadline(&mut self, bthread: &str, now: Duration) {
        let Some(place) = self.board.bthread(bthread) else { return };
        self.resume(place, &Event::timeout(), now);
        self.start_added(now);
        self.compact();
    }
}
