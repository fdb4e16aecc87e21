//! Obstacle avoidance: nobody moves along a path that is known to be blocked.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{ADVANCE, GOTO, HOMEWARD, LAND, PATH_BLOCKED, PLAN, PLANNED};

use crate::{me::Me, precedence};

/// Blocks `advance` from the moment the path is found blocked until there is a new one.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct ObstacleAvoidance {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Free,
    Asking,
    Waiting,
}

impl ObstacleAvoidance {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Free }
    }
}

impl BThread for ObstacleAvoidance {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let over = me.any_of(&[PLANNED, GOTO, LAND]);
        Some(match self.phase {
            Phase::Free => bid.wait_for(me.any(PATH_BLOCKED)),
            Phase::Asking => bid
                .request(me.because(PLAN, "obstacle"))
                .block(me.any_of(&[ADVANCE, HOMEWARD]))
                .wait_for(over),
            Phase::Waiting => bid.block(me.any_of(&[ADVANCE, HOMEWARD])).wait_for(over),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(PATH_BLOCKED) => Phase::Asking,
            Some(PLAN) => Phase::Waiting,
            _ => Phase::Free,
        };
    }
}
