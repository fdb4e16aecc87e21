//! Geofence: no waypoint outside the fence, and home again from beyond it.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::vocabulary::{FENCE_BREACHED, GOTO, LANDED, RETURN};

use crate::{me::Me, precedence};

/// Blocks every `goto` outside the fence; requests `return` when the vehicle is outside.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Geofence {
    me: Me,
    outside: EventSet,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Inside,
    Breached,
    Returning,
}

impl Geofence {
    /// A fence over the box from `min` to `max`, metres ENU.
    #[must_use]
    pub fn new(me: Me, min: [f64; 3], max: [f64; 3]) -> Self {
        let outside = EventSet::And(vec![me.any(GOTO), EventSet::Not(Box::new(EventSet::region(min, max)))]);
        Self { me, outside, phase: Phase::Inside }
    }
}

impl BThread for Geofence {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::FENCE).block(self.outside.clone());
        Some(match self.phase {
            Phase::Inside => bid.wait_for(self.me.any(FENCE_BREACHED)),
            Phase::Breached => {
                bid.request(self.me.because(RETURN, "outside the geofence")).wait_for(self.me.any(LANDED))
            }
            Phase::Returning => bid.wait_for(self.me.any(LANDED)),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(FENCE_BREACHED) => Phase::Breached,
            Some(RETURN) => Phase::Returning,
            _ => Phase::Inside,
        };
    }
}
