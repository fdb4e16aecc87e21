//! Geofence: no waypoint outside the fence, and home again from beyond it.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::event::{Declared as _, FenceBreached, Goto, Landed, Return};

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
    pub fn new(me: Me, min: [f64; 3], max: [f64; 3]) -> Self {
        let outside = me.any::<Goto>().and(EventSet::region(min, max).not());
        Self { me, outside, phase: Phase::Inside }
    }
}

impl BThread for Geofence {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::FENCE).block(self.outside.clone());
        Some(match self.phase {
            Phase::Inside => bid.wait_for(self.me.any::<FenceBreached>()),
            Phase::Breached => bid
                .request(self.me.event(Return { why: "outside the geofence".into() }))
                .wait_for(self.me.any::<Landed>()),
            Phase::Returning => bid.wait_for(self.me.any::<Landed>()),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(FenceBreached::NAME) => Phase::Breached,
            Some(Return::NAME) => Phase::Returning,
            _ => Phase::Inside,
        };
    }
}
