//! Runs one script so that it can do no harm.

use std::time::Duration;

use serde::Serialize;
use skein_bp::script::Script;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::event::{Declared as _, HandBack, OrderTaken, Ready, ScriptState, Unload, What};

use super::report;
use crate::{me::Me, precedence};

/// The most times a script may be resumed at once: far less than the selections that a superstep may take.
const MOST_AT_ONCE: u32 = 100;

/// A script as a b-thread of a vehicle: with the priority of a mission, blocking nothing beyond its rights, to be
/// withdrawn at any time, and ended when it does not come to rest. It says how it has ended.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Runner {
    me: Me,
    name: String,
    script: Script,
    may_block: EventSet,
    over: bool,
    /// Whether it has yet to begin.
    asleep: bool,
    /// When it was last resumed, and how often at that time; none where nobody counts.
    pace: Option<(Duration, u32)>,
}

impl Runner {
    /// Runs `script` under `name` on the vehicle `me`.
    pub fn new(me: Me, name: &str, script: Script, may_block: EventSet) -> Self {
        let pace = Some((Duration::ZERO, 0));
        Self { me, name: name.to_owned(), script, may_block, over: false, asleep: false, pace }
    }

    /// Does not begin before the vehicle is ready on the ground, or somebody lets it go on in the air.
    #[must_use]
    pub fn asleep(self) -> Self {
        Self { asleep: true, ..self }
    }

    /// Does not end it for going round, in a verification: there time stands still, and going round is found.
    #[must_use]
    pub fn unpaced(self) -> Self {
        Self { pace: None, ..self }
    }

    /// The b-thread's name for a script of this name.
    pub fn bthread_name(name: &str) -> String {
        format!("script/{name}")
    }

    /// A request of the script as the vehicle hears it: an order names the script, whatever it says itself.
    fn named(&self, request: &Event) -> Event {
        if !self.me.heard::<OrderTaken>(request) {
            return request.clone();
        }
        request.clone().with("by", Self::bthread_name(&self.name)).with("aboard", true)
    }

    /// What the script itself calls an event that has happened, if it has requested it.
    fn own_word(&self, event: &Event) -> Event {
        let requested =
            |bid: Bid| bid.requests().iter().find(|request| self.named(request) == *event).cloned();
        let is_order = self.me.heard::<OrderTaken>(event);
        is_order.then(|| self.script.bid().and_then(requested)).flatten().unwrap_or_else(|| event.clone())
    }

    fn withdrawal(&self) -> EventSet {
        self.me.any::<Unload>().and(Unload::name(self.name.as_str()))
    }

    /// What ends the hold of a vehicle whose agent has started in the air, and what is told of one on the ground.
    fn release(&self) -> EventSet {
        let onward = EventSet::any_of(What::those(What::releases).map(OrderTaken::what));
        self.me.any::<(Ready, HandBack)>().or(self.me.any::<OrderTaken>().and(onward))
    }

    fn begin(&mut self, cx: &mut Context) {
        self.asleep = false;
        // Whatever it might ask of the program beside its bids is not heard.
        self.script.start(&mut Context::at(cx.now()));
        self.note_end(cx);
    }

    fn end(&mut self, state: ScriptState, why: &str, cx: &mut Context) {
        self.over = true;
        cx.enqueue(report(&self.me, &self.name, state, why));
    }

    fn note_end(&mut self, cx: &mut Context) {
        if self.script.bid().is_none() {
            self.end(ScriptState::Ended, "it has come to its end", cx);
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
        if self.asleep && !self.over {
            let awaited = self.release().or(self.withdrawal());
            return Some(Bid::new().wait_for(awaited).priority(precedence::MISSION));
        }
        let script = self.script.bid().filter(|_| !self.over)?;
        let mut bid = script.requests().iter().fold(Bid::new(), |bid, event| bid.request(self.named(event)));
        bid = bid
            .wait_for(script.waits())
            .wait_for(self.withdrawal())
            .interrupt(script.interrupts())
            .priority(precedence::MISSION);
        bid = script.stated().iter().fold(bid, |bid, event| bid.state(event.clone()));
        if !script.blocks().is_none() {
            bid = bid.block(script.blocks().clone().and(self.may_block.clone()));
        }
        if script.is_hot() {
            bid = bid.hot();
        }
        Some(script.given_deadline().into_iter().fold(bid, Bid::deadline))
    }

    fn start(&mut self, cx: &mut Context) {
        if !self.asleep {
            self.begin(cx);
        }
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if self.withdrawal().contains(event) {
            // One that names nobody is refused.
            if Unload::read(event).is_some_and(|unload| unload.by.is_some()) {
                self.end(ScriptState::Withdrawn, "it was taken back", cx);
            }
            return;
        }
        if self.asleep {
            return self.begin(cx);
        }
        if self.spins(cx.now()) {
            let why = format!("it did not come to rest: it was resumed {MOST_AT_ONCE} times at once");
            return self.end(ScriptState::Ended, &why, cx);
        }
        self.script.resume(&self.own_word(event), &mut Context::at(cx.now()));
        self.note_end(cx);
    }

    fn interrupted(&mut self, event: &Event, cx: &mut Context) {
        self.end(ScriptState::Ended, &format!("it was ended by {event}"), cx);
    }
}
