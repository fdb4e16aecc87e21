//! Battery: home while there is energy for the way home; down at once when there is hardly any.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{BATTERY_CRITICAL, BATTERY_LOW, GOTO, HAND_BACK, LAND, LANDED, RETURN};

use crate::{me::Me, precedence};

/// Requests `return` on a low battery and `land` on a critical one, which nothing then delays.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Battery {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Good,
    Low,
    GoingHome,
    Critical,
    GoingDown,
}

impl Battery {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Good }
    }
}

impl BThread for Battery {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let critical = me.any_of(&[BATTERY_CRITICAL, LANDED]);
        let low = Bid::new().priority(precedence::BATTERY_LOW);
        let emergency = Bid::new().priority(precedence::BATTERY_EMERGENCY).block(me.any_of(&[RETURN, GOTO]));
        Some(match self.phase {
            Phase::Good => low.wait_for(me.any(BATTERY_LOW)).wait_for(critical),
            Phase::Low => low.request(me.because(RETURN, "battery low")).wait_for(critical),
            Phase::GoingHome => low.wait_for(critical),
            Phase::Critical => {
                emergency.request(me.because(LAND, "battery nearly empty")).wait_for(me.any(LANDED))
            }
            // Given back by a pilot, it still has to land.
            Phase::GoingDown => emergency.wait_for(me.any_of(&[LANDED, HAND_BACK])),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(BATTERY_LOW) => Phase::Low,
            Some(RETURN) => Phase::GoingHome,
            Some(BATTERY_CRITICAL | HAND_BACK) => Phase::Critical,
            Some(LAND) => Phase::GoingDown,
            _ => Phase::Good,
        };
    }
}
