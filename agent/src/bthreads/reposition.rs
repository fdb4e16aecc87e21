//! Reposition: flies to where an operator points, and hovers there until the mission is resumed.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{AIRBORNE, DECLINED, GOTO, LAND, LANDED, ORDER, RETURN};

use crate::{me::Me, precedence};

/// The leg number of an operator's point.
pub const OPERATOR_LEG: i64 = -2;
/// How long the vehicle's other b-threads may keep it from setting out before the order is declined.
const PATIENCE: Duration = Duration::from_secs(2);

/// Answers `order {what: "goto", x, y, z}` with a `goto` of its own, or says why not.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Reposition {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    /// On the ground, or on the way down or home.
    Unfree,
    Free,
    Turning {
        to: Event,
        until: Duration,
    },
    Declining {
        why: String,
        free: bool,
    },
}

impl Reposition {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Unfree }
    }

    /// The `goto` that an order asks for.
    fn goto(&self, order: &Event) -> Option<Event> {
        let [x, y, z] = ["x", "y", "z"].map(|axis| order.real(axis));
        let goto = self.me.event(GOTO).with("leg", OPERATOR_LEG).with("lands", false);
        Some(goto.with("x", x?).with("y", y?).with("z", z?))
    }

    fn answer(&self, order: &Event, now: Duration) -> Phase {
        match self.goto(order) {
            Some(to) => Phase::Turning { to, until: now + PATIENCE },
            None => Phase::Declining { why: "it names no point".into(), free: true },
        }
    }
}

impl BThread for Reposition {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::LINK).wait_for(me.any(ORDER));
        Some(match &self.phase {
            Phase::Unfree => bid.wait_for(me.any(AIRBORNE)),
            Phase::Free => bid.wait_for(me.any_of(&[LAND, RETURN, LANDED])),
            Phase::Turning { to, until } => {
                bid.request(to.clone()).deadline(*until).wait_for(me.any_of(&[LAND, RETURN, LANDED]))
            }
            Phase::Declining { why, .. } => bid
                .request(me.because(DECLINED, why).with("what", "goto"))
                .wait_for(me.any_of(&[AIRBORNE, LAND, RETURN, LANDED])),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let verb = self.me.verb(event);
        let goto = verb == Some(ORDER) && event.text("what") == Some("goto");
        self.phase = match (self.phase.clone(), verb) {
            (_, Some(AIRBORNE)) => Phase::Free,
            (_, Some(LAND | RETURN | LANDED)) => Phase::Unfree,
            (Phase::Unfree | Phase::Declining { free: false, .. }, Some(ORDER)) if goto => Phase::Declining {
                why: "it is not free to go: on the ground, landing or returning".into(),
                free: false,
            },
            (Phase::Free | Phase::Turning { .. } | Phase::Declining { free: true, .. }, Some(ORDER))
                if goto =>
            {
                self.answer(event, cx.now())
            }
            // Another order takes the place of this one.
            (Phase::Turning { .. }, Some(ORDER | GOTO)) => Phase::Free,
            (Phase::Turning { .. }, None) => Phase::Declining {
                why: "the vehicle blocks it: outside the geofence, or held".into(),
                free: true,
            },
            (Phase::Declining { free, .. }, Some(DECLINED)) => {
                if free {
                    Phase::Free
                } else {
                    Phase::Unfree
                }
            }
            (phase, _) => phase,
        };
    }
}
