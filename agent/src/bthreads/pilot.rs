//! Pilot: once somebody else flies the vehicle, its agent requests nothing until it is handed back.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{
    ADVANCE, ENTER, GOTO, HAND_BACK, HOLD, HOMEWARD, LAND, PILOT, PLAN, RETURN, SLEPT, TAKEOFF,
};

use crate::{me::Me, precedence};

/// Everything that would move the vehicle.
const MOVES: [&str; 9] = [TAKEOFF, GOTO, PLAN, ADVANCE, HOMEWARD, ENTER, HOLD, LAND, RETURN];

/// Blocks every movement, from a pilot's mode change or from waking up with a vehicle that somebody else had to look
/// after meanwhile, until an operator hands the vehicle back.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Pilot {
    me: Me,
    has_control: bool,
}

impl Pilot {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, has_control: false }
    }
}

impl BThread for Pilot {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::PILOT);
        Some(if self.has_control {
            bid.wait_for(self.me.any(HAND_BACK)).block(self.me.any_of(&MOVES))
        } else {
            bid.wait_for(self.me.any_of(&[PILOT, SLEPT]))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.has_control = !self.me.heard(event, HAND_BACK);
    }
}
