//! Path planning: every waypoint gets a path; a waypoint that has none ends the flight, an operator's point does not.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{ARRIVED, DECLINED, GOTO, LAND, PLAN, PLANNED, UNPLANNABLE};

use crate::bthreads::OPERATOR_LEG;
use crate::{me::Me, precedence};

/// How often a waypoint without a path is tried again: the map may have held a ghost.
pub const ATTEMPTS: u8 = 3;
/// The pause before the next attempt.
pub const PAUSE: Duration = Duration::from_secs(1);

/// Requests `plan` for each new waypoint, tries again while there is no path, and at last requests `land`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PathPlanning {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Idle,
    Asking { attempt: u8 },
    Computing { attempt: u8 },
    Pausing { attempt: u8, until: Duration },
    GivingUp { why: String },
    Declining { why: String },
}

impl PathPlanning {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Idle }
    }
}

impl BThread for PathPlanning {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::MISSION).wait_for(me.any_of(&[GOTO, LAND]));
        Some(match &self.phase {
            Phase::Idle => bid.wait_for(me.any(UNPLANNABLE)),
            Phase::Asking { .. } => bid.request(me.because(PLAN, "waypoint")),
            Phase::Computing { .. } => bid.wait_for(me.any_of(&[PLANNED, UNPLANNABLE, ARRIVED])),
            Phase::Pausing { until, .. } => bid.wait_for(me.any(PLANNED)).deadline(*until),
            Phase::GivingUp { why } => bid.request(me.because(LAND, why)),
            Phase::Declining { why } => bid.request(me.because(DECLINED, why).with("what", "goto")),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let attempt = match self.phase {
            Phase::Asking { attempt } | Phase::Computing { attempt } | Phase::Pausing { attempt, .. } => {
                attempt
            }
            Phase::Idle | Phase::GivingUp { .. } | Phase::Declining { .. } => 1,
        };
        self.phase = match self.me.verb(event) {
            Some(GOTO) => Phase::Asking { attempt: 1 },
            Some(PLAN) => Phase::Computing { attempt },
            Some(UNPLANNABLE) if attempt < ATTEMPTS => Phase::Pausing { attempt, until: cx.now() + PAUSE },
            Some(UNPLANNABLE) => {
                let why = event.text("why").unwrap_or("no path to the waypoint").to_owned();
                let ordered = event.int("leg") == Some(OPERATOR_LEG);
                if ordered { Phase::Declining { why } } else { Phase::GivingUp { why } }
            }
            None => Phase::Asking { attempt: attempt + 1 },
            Some(_) => Phase::Idle,
        };
    }
}
