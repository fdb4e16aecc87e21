//! Local-minimum escape: a vehicle that makes no way plans anew around whatever stands there.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Arrived, Declared as _, Goto, Land, Plan, PlanReason, Stuck};

use crate::{me::Me, precedence};

/// Escapes from one waypoint before the vehicle lands.
pub const ATTEMPTS: u8 = 12;

/// Requests `plan` when the vehicle is stuck; the planner then goes around its neighbours too and pulls less
/// (Wang 2023: re-planning with A* while the attractive gain is reduced).
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Escape {
    me: Me,
    attempts: u8,
    stuck: bool,
}

impl Escape {
    pub fn new(me: Me) -> Self {
        Self { me, attempts: 0, stuck: false }
    }
}

impl BThread for Escape {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::MISSION).wait_for(me.any::<(Goto, Arrived, Land)>());
        Some(match (self.stuck, self.attempts) {
            (false, _) => bid.wait_for(me.any::<Stuck>()),
            (true, ATTEMPTS..) => {
                bid.request(me.event(Land { why: "stuck: no way past what stands around".into() }))
            }
            (true, _) => bid.request(me.event(Plan { why: PlanReason::Stuck })),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match self.me.verb(event) {
            Some(Stuck::NAME) => self.stuck = true,
            Some(Plan::NAME) => {
                self.stuck = false;
                self.attempts += 1;
            }
            _ => {
                self.stuck = false;
                self.attempts = 0;
            }
        }
    }
}
