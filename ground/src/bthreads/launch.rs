//! Launch: one vehicle after another takes off, the next when the one before is in the air.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::{NodeName, facts};
use skein_wire::vocabulary::{AIRBORNE, FAILED, LANDED, TAKEOFF, event, of};

use super::heard::{self, Situation};
use super::roll_call;
use crate::order::{ordered, ordered_for_all};

/// How long a vehicle may block its own take-off before the next one gets its turn.
const PATIENCE: Duration = Duration::from_secs(15);
/// Who orders the swarm down does not want the rest of it up.
const CALLING_OFF: [&str; 3] = ["land", "return", "abort"];

/// Requests `uav/N/takeoff` for each vehicle whose turn it is. Each vehicle's own preflight b-thread may block its
/// take-off; one that does so for long, or falls silent, has another turn after the others.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Launch {
    ground: NodeName,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    /// Until an operator orders a launch.
    Unordered,
    Free,
    Asking {
        vehicle: NodeName,
        until: Duration,
    },
    Climbing {
        vehicle: NodeName,
    },
    Postponing {
        vehicle: NodeName,
    },
}

impl Launch {
    /// The name that this b-thread runs under: whoever explains why nobody takes off looks for it.
    pub const NAME: &'static str = "launch";

    /// Launches from the ground station `ground`: at once, or `on_order`.
    #[must_use]
    pub fn new(ground: NodeName, on_order: bool) -> Self {
        Self { ground, phase: if on_order { Phase::Unordered } else { Phase::Free } }
    }

    fn lost(&self, vehicle: &NodeName) -> EventSet {
        facts::of(&self.ground, facts::PEER_LOST).and(EventSet::field_is("node", vehicle.as_str()))
    }

    /// The vehicle has turned out to be in the air already, or done.
    fn found_flown(&self, vehicle: &NodeName) -> EventSet {
        let grounded = heard::is(Situation::Grounded);
        heard::of(&self.ground).and(EventSet::field_is("vehicle", vehicle.as_str())).and(grounded.not())
    }
}

impl BThread for Launch {
    fn bid(&self) -> Option<Bid> {
        let ended =
            |vehicle| EventSet::any_of([of(vehicle, FAILED), of(vehicle, LANDED), self.lost(vehicle)]);
        let called_off = EventSet::any_of(CALLING_OFF.map(|what| ordered_for_all(&self.ground, what)));
        let turns = roll_call::turns(&self.ground);
        let bid = Bid::new().wait_for(called_off);
        Some(match &self.phase {
            Phase::Unordered => Bid::new().wait_for(ordered(&self.ground, "launch")).block(turns),
            Phase::Free => bid.wait_for(turns),
            Phase::Asking { vehicle, until } => bid
                .request(event(vehicle, TAKEOFF))
                .wait_for(ended(vehicle))
                .wait_for(self.found_flown(vehicle))
                .deadline(*until)
                .block(turns),
            Phase::Climbing { vehicle } => {
                bid.wait_for(of(vehicle, AIRBORNE)).wait_for(ended(vehicle)).block(turns)
            }
            Phase::Postponing { vehicle } => {
                bid.request(roll_call::later(&self.ground, vehicle)).block(turns)
            }
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let called_off = event.text("what").is_some_and(|what| CALLING_OFF.contains(&what));
        self.phase = match (self.phase.clone(), event.kind()) {
            _ if called_off => Phase::Unordered,
            (Phase::Free, _) => match roll_call::vehicle_of(event) {
                Some(vehicle) => Phase::Asking { vehicle, until: cx.now() + PATIENCE },
                None => Phase::Free,
            },
            (Phase::Asking { vehicle, .. }, TAKEOFF) => Phase::Climbing { vehicle },
            (Phase::Asking { .. }, heard::HEARD | FAILED | LANDED) => Phase::Free,
            (Phase::Asking { vehicle, .. }, _) => Phase::Postponing { vehicle },
            (Phase::Unordered | Phase::Climbing { .. } | Phase::Postponing { .. }, _) => Phase::Free,
        };
    }
}
