//! Launch: one vehicle after another takes off, the next when the one before is in the air.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::NodeName;
use skein_dbp::facts::PeerLost;
use skein_wire::event::{
    Airborne, Declared as _, Events as _, Failed, Heard, Landed, Later, OrderGiven, Situation, Takeoff, Turn,
    What, of,
};

use crate::order::{ordered, ordered_for_all};

/// A vehicle that blocks its own take-off for longer lets the next one have its turn.
const PATIENCE: Duration = Duration::from_secs(15);

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
    pub fn new(ground: NodeName, on_order: bool) -> Self {
        Self { ground, phase: if on_order { Phase::Unordered } else { Phase::Free } }
    }

    fn lost(&self, vehicle: &NodeName) -> EventSet {
        PeerLost::any_at(&self.ground).and(PeerLost::node(vehicle))
    }

    /// The vehicle has turned out to be in the air already, or done.
    fn found_flown(&self, vehicle: &NodeName) -> EventSet {
        let grounded = Heard::situation(Situation::Grounded);
        Heard::any_at(&self.ground).and(Heard::vehicle(vehicle)).and(grounded.not())
    }
}

impl BThread for Launch {
    fn bid(&self) -> Option<Bid> {
        let ended = |vehicle| of::<(Failed, Landed)>(vehicle).or(self.lost(vehicle));
        let called_off = ordered_for_all(&self.ground, What::those(What::calls_launch_off));
        let turns = Turn::any_at(&self.ground);
        let bid = Bid::new().wait_for(called_off);
        Some(match &self.phase {
            Phase::Unordered => Bid::new().wait_for(ordered(&self.ground, [What::Launch])).block(turns),
            Phase::Free => bid.wait_for(turns),
            Phase::Asking { vehicle, until } => bid
                .request(Takeoff.at(vehicle))
                .wait_for(ended(vehicle))
                .wait_for(self.found_flown(vehicle))
                .deadline(*until)
                .block(turns),
            Phase::Climbing { vehicle } => {
                bid.wait_for(of::<Airborne>(vehicle)).wait_for(ended(vehicle)).block(turns)
            }
            Phase::Postponing { vehicle } => {
                bid.request(Later { vehicle: vehicle.clone() }.at(&self.ground)).block(turns)
            }
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let called_off = OrderGiven::read(event).is_some_and(|order| order.what.calls_launch_off());
        self.phase = match (self.phase.clone(), event.kind()) {
            _ if called_off => Phase::Unordered,
            (Phase::Free, _) => match Turn::read(event) {
                Some(Turn { vehicle }) => Phase::Asking { vehicle, until: cx.now() + PATIENCE },
                None => Phase::Free,
            },
            (Phase::Asking { vehicle, .. }, Takeoff::NAME) => Phase::Climbing { vehicle },
            (Phase::Asking { .. }, Heard::NAME | Failed::NAME | Landed::NAME) => Phase::Free,
            (Phase::Asking { vehicle, .. }, _) => Phase::Postponing { vehicle },
            (Phase::Unordered | Phase::Climbing { .. } | Phase::Postponing { .. }, _) => Phase::Free,
        };
    }
}
