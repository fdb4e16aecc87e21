//! Found airborne: an agent that starts while its vehicle flies holds until somebody with authority says otherwise.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{ADVANCE, FOUND_AIRBORNE, GOTO, HOLD, HOMEWARD, LANDED, ORDER, TAKEOFF};

use crate::{me::Me, precedence};

/// Requests `hold` and blocks take-off and the mission until an operator orders `resume` or `return`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct FoundAirborne {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Unaware,
    Stopping,
    Holding,
}

impl FoundAirborne {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Unaware }
    }
}

impl BThread for FoundAirborne {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let mission = me.any_of(&[TAKEOFF, GOTO, ADVANCE, HOMEWARD]);
        Some(match self.phase {
            Phase::Unaware => bid.wait_for(me.any(FOUND_AIRBORNE)),
            Phase::Stopping => bid.request(me.because(HOLD, "the agent started in the air")).block(mission),
            Phase::Holding => bid.wait_for(me.any_of(&[ORDER, LANDED])).block(mission),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(FOUND_AIRBORNE) => Phase::Stopping,
            Some(ORDER) if !matches!(event.text("what"), Some("resume" | "return")) => Phase::Holding,
            Some(HOLD) => Phase::Holding,
            _ => Phase::Unaware,
        };
    }
}
