//! Return home: fly to where the vehicle took off, then land there.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{ARRIVED, GOTO, LAND, LANDED, RETURN};

use crate::{me::Me, precedence};

/// The leg number of the way home.
pub const HOME_LEG: i64 = -1;

/// Answers `return` with a `goto` home, high enough to pass over what the mission flew around, then `land`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct ReturnHome {
    me: Me,
    home: Event,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Away,
    Turning { why: String },
    Returning { why: String },
    Landing { why: String },
}

impl ReturnHome {
    /// `home` is the point above the take-off place, metres ENU; its height is the vehicle's own return altitude.
    #[must_use]
    pub fn new(me: Me, home: [f64; 3]) -> Self {
        Self { home: goto(&me, home), me, phase: Phase::Away }
    }
}

/// The `goto` to the point above the take-off place.
pub(crate) fn goto(me: &Me, [x, y, z]: [f64; 3]) -> Event {
    me.event(GOTO).with("leg", HOME_LEG).with("lands", true).with("x", x).with("y", y).with("z", z)
}

impl BThread for ReturnHome {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::BATTERY_LOW);
        Some(match &self.phase {
            Phase::Away => bid.wait_for(me.any(RETURN)),
            Phase::Turning { .. } => bid.request(self.home.clone()).wait_for(me.any_of(&[LAND, LANDED])),
            Phase::Returning { .. } => bid.wait_for(me.any_of(&[ARRIVED, LAND, LANDED])),
            Phase::Landing { why } => bid.request(me.because(LAND, why)),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match (self.phase.clone(), self.me.verb(event)) {
            (Phase::Away, _) => Phase::Turning { why: event.text("why").unwrap_or("return").to_owned() },
            (Phase::Turning { why }, Some(GOTO)) => Phase::Returning { why },
            (Phase::Returning { why }, Some(ARRIVED)) if event.int("leg") == Some(HOME_LEG) => {
                Phase::Landing { why }
            }
            (Phase::Returning { why }, Some(ARRIVED)) => Phase::Returning { why },
            _ => Phase::Away,
        };
    }
}
