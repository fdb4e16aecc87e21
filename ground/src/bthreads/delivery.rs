//! Brings an operator's order to one vehicle's gateway.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::{NodeName, facts};
use skein_wire::vocabulary;

use crate::order::ordered_for;

/// Waits until `what` is ordered for a vehicle, and requests it at the vehicle's gateway until it is taken.
///
/// Each vehicle has its own, so that one out of reach keeps no other from obeying.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Delivery {
    ground: NodeName,
    vehicle: NodeName,
    what: String,
    ordering: bool,
}

impl Delivery {
    /// Brings the order `what` from the station `ground` to `vehicle`.
    #[must_use]
    pub fn new(ground: NodeName, vehicle: NodeName, what: &str) -> Self {
        Self { ground, vehicle, what: what.into(), ordering: false }
    }

    fn order(&self) -> Event {
        vocabulary::order(&self.vehicle, &self.what)
    }

    /// The vehicle has restarted and may have taken the order or not. To repeat it does no harm.
    fn unknown(&self) -> EventSet {
        let event = EventSet::field_is("event", self.order().name());
        facts::of(&self.ground, facts::UNKNOWN).and(event)
    }
}

impl BThread for Delivery {
    fn bid(&self) -> Option<Bid> {
        Some(if self.ordering {
            Bid::new().request(self.order()).wait_for(self.unknown())
        } else {
            Bid::new().wait_for(ordered_for(&self.ground, &self.what, &self.vehicle))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.ordering = *event != self.order();
    }
}
