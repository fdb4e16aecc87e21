//! Runs one script so that it can do no harm.

use std::time::Duration;

use serde::Serialize;
use skein_bp::script::Script;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::vocabulary::{ENDED, UNLOAD, WITHDRAWN};

use super::report;
use crate::{me::Me, precedence};

/// How often a script may be resumed at one time: far less than the selections that a superstep may take.
const MOST_AT_ONCE: u32 = 100;

/// A script as a b-thread of a vehicle: with the priority of a mission, blocking nothing beyond its rights, to be withdrawn
/// at any time, and ended when it does not come to rest. It says how it has ended.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Runner {
    me: Me,
    name: String,
    script: Script,
    /// What it may block.
    may_block: EventSet,
    over: bool,
    /// When it was last resumed, and how often at that time; none where nobody counts.
    pace: Option<(Duration, u32)>,
}

impl Runner {
    /// Runs `script` under `name` on the vehicle `me`.
    #[must_use]
    pub fn new(me: Me, name: &str, script: Script, may_block: EventSet) -> Self {
        Self { me, name: name.to_owned(), script, may_block, over: false, pace: Some((Duration::ZERO, 0)) }
    }

    /// Does not end it for going round, in a verification: there time stands still, and going round is found.
    #[must_use]
    pub fn unpaced(self) -> Self {
        Self { pace: None, ..self }
    }

    /// The b-thread's name for a script of this name.
    #[must_use]
    pub fn bthread_name(name: &str) -> String {
        format!("script/{name}")
    }

    fn withdrawal(&self) -> EventSet {
        self.me.any(UNLOAD).and(EventSet::field_is("name", self.name.as_str()))
    }

    fn end(&mut self, state: &str, why: &str, cx: &mut Context) {
        self.over = true;
        cx.enqueue(report(&self.me, &self.name, state, why));
    }

    fn note_end(&mut self, cx: &mut Context) {
        if self.script.bid().is_none() {
            self.end(ENDED, "it has come to its end", cx);
        }
    }

    /// Whether it has been resumed too often at this time.
    fn spins(&mut self, now: Duration) -> bool {
        let Some((at, times)) = &mut self.pace else { return false };
        *times = if *at == now { *times + 1 } else { 1 };
        *at = now;
        *times > MOST_AT_ONCE
    }
}

impl BThread for Runner {
    fn bid(&self) -> Option<Bid> {
        let script = self.script.bid().filter(|_| !self.over)?;
        let mut bid = script.requests().iter().fold(Bid::new(), |bid, event| bid.request(event.clone()));
        bid = bid
            .wait_for(script.waits())
            .wait_for(self.withdrawal())
            .interrupt(script.interrupts())
            .priority(precedence::MISSION);
        if !script.blocks().is_none() {
            bid = bid.block(script.blocks().clone().and(self.may_block.clone()));
        }
        if script.is_hot() {
            bid = bid.hot();
        }
        Some(script.given_deadline().into_iter().fold(bid, Bid::deadline))
    }

    fn start(&mut self, cx: &mut Context) {
        // Whatever it might ask of the program beside its bids is not heard.
        self.script.start(&mut Context::at(cx.now()));
        self.note_end(cx);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if self.withdrawal().contains(event) {
            return self.end(WITHDRAWN, "it was taken back", cx);
        }
        if self.spins(cx.now()) {
            let why = format!("it did not come to rest: it was resumed {MOST_AT_ONCE} times at once");
            return self.end(ENDED, &why, cx);
        }
        self.script.resume(event, &mut Context::at(cx.now()));
        self.note_end(cx);
    }

    fn interrupted(&mut self, event: &Event, cx: &mut Context) {
        self.end(ENDED, &format!("it was ended by {event}"), cx);
    }
}
