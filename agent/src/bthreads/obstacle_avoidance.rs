//! Obstacle avoidance: nobody moves along a path that is known to be blocked.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    Advance, Declared as _, Goto, Homeward, Land, PathBlocked, Plan, PlanReason, Planned,
};

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
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Free }
    }
}

impl BThread for ObstacleAvoidance {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let over = me.any::<(Planned, Goto, Land)>();
        Some(match self.phase {
            Phase::Free => bid.wait_for(me.any::<PathBlocked>()),
            Phase::Asking => bid
                .request(me.event(Plan { why: PlanReason::Obstacle }))
                .block(me.any::<(Advance, Homeward)>())
                .wait_for(over),
            Phase::Waiting => bid.block(me.any::<(Advance, Homeward)>()).wait_for(over),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(PathBlocked::NAME) => Phase::Asking,
            Some(Plan::NAME) => Phase::Waiting,
            _ => Phase::Free,
        };
    }
}
