//! Launch: one vehicle after another takes off, the next when the one before is in the air.

use std::collections::VecDeque;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::{NodeName, facts};
use skein_wire::vocabulary::{AIRBORNE, FAILED, LANDED, TAKEOFF, event, of};

use crate::order::ordered_for_all;

/// Requests `uav/N/takeoff` for each vehicle in turn. Each vehicle's own preflight b-thread may block its take-off. One
/// that falls silent before it has taken off is asked again after the others.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Launch {
    ground: NodeName,
    /// Who has yet to fly; it is the first one's turn.
    waiting: VecDeque<NodeName>,
    climbing: bool,
}

impl Launch {
    /// Launches `vehicles` in this order, from the ground station `ground`.
    #[must_use]
    pub fn new(ground: NodeName, vehicles: Vec<NodeName>) -> Self {
        Self { ground, waiting: vehicles.into(), climbing: false }
    }

    /// What ends the launch of `vehicle` without its being in the air.
    fn given_up(&self, vehicle: &NodeName) -> EventSet {
        let lost =
            facts::of(&self.ground, facts::PEER_LOST).and(EventSet::field_is("node", vehicle.as_str()));
        EventSet::any_of([of(vehicle, FAILED), of(vehicle, LANDED), lost])
    }
}

impl BThread for Launch {
    fn bid(&self) -> Option<Bid> {
        let vehicle = self.waiting.front()?;
        // Who orders the swarm down does not want the rest of it up.
        let called_off = EventSet::any_of(["land", "return"].map(|what| ordered_for_all(&self.ground, what)));
        let bid = Bid::new().interrupt(called_off).wait_for(self.given_up(vehicle));
        Some(if self.climbing {
            bid.wait_for(of(vehicle, AIRBORNE))
        } else {
            bid.request(event(vehicle, TAKEOFF))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match event.kind() {
            TAKEOFF => self.climbing = true,
            facts::PEER_LOST if !self.climbing => self.waiting.rotate_left(1),
            _ => {
                self.climbing = false;
                self.waiting.pop_front();
            }
        }
    }
}
