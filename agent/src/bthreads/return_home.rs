//! Return home: fly to where the vehicle took off, or to the nearest rally point, then land there.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    self, Airborne, Arrived, CommandFailed, Declared as _, FoundAirborne, Goto, HandBack, Land, Landed,
    Refuge, Return, Takeoff,
};

use crate::{me::Me, precedence};

/// The leg number of the way home.
pub const HOME_LEG: i64 = -1;

/// Answers `return` with a `goto` home, high enough to pass over what the mission flew around, then `land`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct ReturnHome {
    me: Me,
    /// The `goto` above the place where it lands.
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
    pub fn new(me: Me, home: [f64; 3]) -> Self {
        Self { home: goto(&me, home), me, phase: Phase::Grounded }
    }
}

/// The `goto` to the point above the take-off place.
pub fn goto(me: &Me, [x, y, z]: [f64; 3]) -> Event {
    me.event(Goto { leg: HOME_LEG, lands: true, x, y, z })
}

impl BThread for ReturnHome {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        // Whatever was ordered on the ground is over then.
        let bid = Bid::new().priority(precedence::BATTERY_LOW).wait_for(me.any::<(Takeoff, Refuge)>());
        let grounded = me.any::<(Landed, CommandFailed)>();
        let over = grounded.clone().or(me.any::<Land>());
        Some(match &self.phase {
            Phase::Grounded => bid.wait_for(me.any::<(Airborne, FoundAirborne, HandBack)>()),
            Phase::Away => bid.wait_for(me.any::<Return>()).wait_for(over),
            Phase::Turning { .. } => bid.request(self.home.clone()).wait_for(over),
            Phase::Returning { .. } => bid.wait_for(me.any::<Arrived>()).wait_for(over),
            Phase::Landing { why } => {
                bid.request(me.event(Land { why: why.as_str().into() })).wait_for(grounded)
            }
            Phase::Down => bid.wait_for(me.any::<HandBack>()).wait_for(grounded),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if let Some(Refuge { x, y, z }) = Refuge::read(event) {
            self.home = goto(&self.me, [x, y, z]);
            if let Phase::Returning { why } = &self.phase {
                self.phase = Phase::Turning { why: why.clone() };
            }
            return;
        }
        self.phase = match (self.phase.clone(), self.me.verb(event)) {
            (_, Some(Takeoff::NAME)) => Phase::Away,
            (_, Some(Land::NAME)) => Phase::Down,
            (_, Some(Landed::NAME | CommandFailed::NAME)) => Phase::Grounded,
            (Phase::Away, _) => Phase::Turning { why: event::why(event).unwrap_or("return").to_owned() },
            (Phase::Turning { why }, _) => Phase::Returning { why },
            (Phase::Returning { why }, _)
                if Arrived::read(event).is_some_and(|arrived| arrived.leg == HOME_LEG) =>
            {
                Phase::Landing { why }
            }
            (Phase::Returning { why }, _) => Phase::Returning { why },
            _ => Phase::Away,
        };
    }
}
