//! The gate, guarded: block, await confirmation, act, withdraw.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{self, BlockLapsed, Stalled};
use skein_wire::NodeName;
use skein_wire::event::{Declared as _, Events as _};

/// The name under which this b-thread runs, as confirmations name it.
pub const NAME: &str = "gate";
/// One that gave way claims again when it hears that another has left, or after this long.
const PATIENCE: Duration = Duration::from_secs(2);

/// Keeps all others out, and requests the vehicle's `enter` once that is sure.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Guarded {
    me: NodeName,
    care: Care,
    phase: Phase,
}

/// What is awaited, and how long the block lasts. The last is right; the others are shown beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Care {
    /// Blocks and acts at once.
    Hasty,
    /// Awaits confirmation of a block that lapses with its lease.
    ForALease,
    /// Awaits confirmation of a block that stays until it is withdrawn or lifted.
    ForGood,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Away,
    Claiming,
    Entering,
    Inside,
    Yielding { until: Duration },
}

impl Guarded {
    pub fn new(me: NodeName, care: Care) -> Self {
        Self { me, care, phase: Phase::Away }
    }

    /// `enter` of everyone else, blocked for as long as `care` says.
    fn claim(&self) -> Bid {
        let mine = EventSet::named(self.me.event_name("enter"));
        let bid = Bid::new().block(EventSet::from("uav/*/enter").and(mine.not()));
        if self.care == Care::ForGood { bid.hold_when_lost() } else { bid }
    }

    fn begin(&self) -> Phase {
        if self.care == Care::Hasty { Phase::Entering } else { Phase::Claiming }
    }

    /// Of two that keep each other out, the one with the higher name yields.
    fn must_yield(&self, event: &Event) -> bool {
        Stalled::read(event).is_some_and(|stalled| *stalled.by < *self.me.as_str())
    }
}

impl BThread for Guarded {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        Some(match self.phase {
            Phase::Away => Bid::new().wait_for(me.event_name("approach")),
            Phase::Claiming => self.claim().wait_for(facts::confirmed(me, NAME)),
            Phase::Entering => self
                .claim()
                .request(me.event_name("enter"))
                .wait_for([Stalled::any_at(me), facts::block_lapsed(me, NAME)]),
            Phase::Inside => self.claim().wait_for(me.event_name("leave")),
            Phase::Yielding { until } => Bid::new().wait_for("uav/*/leave").deadline(until),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match self.phase {
            Phase::Away | Phase::Yielding { .. } => self.begin(),
            Phase::Claiming => Phase::Entering,
            Phase::Entering if event.kind() == "enter" => Phase::Inside,
            Phase::Entering if event.kind() == BlockLapsed::NAME => Phase::Claiming,
            Phase::Entering if self.must_yield(event) => Phase::Yielding { until: cx.now() + PATIENCE },
            Phase::Entering => Phase::Entering,
            Phase::Inside => Phase::Away,
        };
    }
}
