//! The mission of every vehicle here: through the gate again and again.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::NodeName;

/// The time that a vehicle is inside.
const PASSAGE: Duration = Duration::from_millis(1500);

/// Approaches the gate, waits until the vehicle enters, leaves it on the other side, and rests before the next trip.
///
/// It knows nothing of other vehicles. When to request `enter` is left to the rule that guards the gate.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Trip {
    me: NodeName,
    rest: Duration,
    phase: Phase,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Resting { until: Duration },
    Approaching,
    Waiting,
    Inside { until: Duration },
    Leaving,
}

impl Trip {
    pub fn new(me: &NodeName, rest: Duration) -> Self {
        Self { me: me.clone(), rest, phase: Phase::Resting { until: rest } }
    }
}

impl BThread for Trip {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        Some(match self.phase {
            Phase::Resting { until } | Phase::Inside { until } => Bid::new().deadline(until),
            Phase::Approaching => Bid::new().request(me.event_name("approach")),
            Phase::Waiting => Bid::new().wait_for(me.event_name("enter")),
            Phase::Leaving => Bid::new().request(me.event_name("leave")),
        })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.phase = match self.phase {
            Phase::Resting { .. } => Phase::Approaching,
            Phase::Approaching => Phase::Waiting,
            Phase::Waiting => Phase::Inside { until: cx.now() + PASSAGE },
            Phase::Inside { .. } => Phase::Leaving,
            Phase::Leaving => Phase::Resting { until: cx.now() + self.rest },
        };
    }
}
