//! Muster: nobody sets out before everybody is in the air.

use std::collections::BTreeSet;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::{NodeName, facts, first_two_chunks};
use skein_wire::vocabulary::{ADVANCE, AIRBORNE, FAILED, of_every_vehicle};

use super::heard::{self, Situation};
use crate::order::ordered_for_all;

/// Blocks `uav/*/advance` until every vehicle is in the air, or will not be.
///
/// Swarms whose vehicles swap places need it: the goal of one is where another still stands.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Muster {
    ground: NodeName,
    missing: BTreeSet<String>,
}

impl Muster {
    /// Waits for `vehicles`, at the ground station `ground`.
    #[must_use]
    pub fn new(ground: NodeName, vehicles: impl IntoIterator<Item = NodeName>) -> Self {
        Self { ground, missing: vehicles.into_iter().map(|vehicle| vehicle.to_string()).collect() }
    }
}

impl BThread for Muster {
    fn bid(&self) -> Option<Bid> {
        // Whoever is ordered home must be free to move.
        let called_off = EventSet::any_of(["land", "return"].map(|what| ordered_for_all(&self.ground, what)));
        let arrived = EventSet::any_of([AIRBORNE, FAILED].map(of_every_vehicle));
        let lost = facts::of(&self.ground, facts::PEER_LOST);
        (!self.missing.is_empty()).then(|| {
            let bid = Bid::new().block(of_every_vehicle(ADVANCE)).interrupt(called_off);
            bid.wait_for(arrived).wait_for(lost).wait_for(heard::of(&self.ground))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let vehicle = match heard::read(event) {
            Some((_, Situation::Grounded)) => return,
            Some(_) => event.text("vehicle"),
            None => event.text("node").or_else(|| first_two_chunks(event.name())),
        };
        if let Some(vehicle) = vehicle {
            self.missing.remove(vehicle);
        }
    }
}
