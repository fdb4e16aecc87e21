//! Return home: fly to where the vehicle took off, then land there.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{
    AIRBORNE, ARRIVED, COMMAND_FAILED, FOUND_AIRBORNE, GOTO, HAND_BACK, LAND, LANDED, RETURN, TAKEOFF,
};

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
    /// On the ground, where `return` leads nowhere.
    Grounded,
    Away,
    Turning {
        why: String,
    },
    Returning {
        why: String,
    },
    Landing {
        why: String,
    },
    /// On the way down, from which no way leads home any more.
    Down,
}

impl ReturnHome {
    /// `home` is the point above the take-off place, metres ENU; its height is the vehicle's own return altitude.
    #[must_use]
    pub fn new(me: Me, home: [f64; 3]) -> Self {
        Self { home: goto(&me, home), me, phase: Phase::Grounded }
    }
}

/// The `goto` to the point above the take-off place.
pub fn goto(me: &Me, [x, y, z]: [f64; 3]) -> Event {
    me.event(GOTO).with("leg", HOME_LEG).with("lands", true).with("x", x).with("y", y).with("z", z)
}

impl BThread for ReturnHome {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        // Whatever was ordered on the ground is over then.
        let bid = Bid::new().priority(precedence::BATTERY_LOW).wait_for(me.any(TAKEOFF));
        let grounded = me.any_of(&[LANDED, COMMAND_FAILED]);
        let over = grounded.clone().or(me.any(LAND));
        Some(match &self.phase {
            Phase::Grounded => bid.wait_for(me.any_of(&[AIRBORNE, FOUND_AIRBORNE, HAND_BACK])),
            Phase::Away => bid.wait_for(me.any(RETURN)).wait_for(over),
            Phase::Turning { .. } => bid.request(self.home.clone()).wait_for(over),
            Phase::Returning { .. } => bid.wait_for(me.any(ARRIVED)).wait_for(over),
            Phase::Landing { why } => bid.request(me.because(LAND, why)).wait_for(grounded),
            Phase::Down => bid.wait_for(me.any(HAND_BACK)).wait_for(grounded),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match (self.phase.clone(), self.me.verb(event)) {
            (_, Some(TAKEOFF)) => Phase::Away,
            (_, Some(LAND)) => Phase::Down,
            (_, Some(LANDED | COMMAND_FAILED)) => Phase::Grounded,
            (Phase::Away, _) => Phase::Turning { why: event.text("why").unwrap_or("return").to_owned() },
            (Phase::Turning { why }, _) => Phase::Returning { why },
            (Phase::Returning { why }, _) if event.int("leg") == Some(HOME_LEG) => Phase::Landing { why },
            (Phase::Returning { why }, _) => Phase::Returning { why },
            _ => Phase::Away,
        };
    }
}
