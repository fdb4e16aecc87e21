//! Path planning: every waypoint gets a path; a waypoint that has none ends the flight, an operator's point does not.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    self, Arrived, Declared as _, Declined, Goto, Land, Plan, PlanReason, Planned, Unplannable, What,
};

use crate::bthreads::OPERATOR_LEG;
use crate::{me::Me, precedence};

/// Attempts at a waypoint without a path: the map may have held a ghost.
pub const ATTEMPTS: u8 = 3;
/// The pause before the next attempt.
pub const PAUSE: Duration = Duration::from_secs(1);

/// Requests `plan` for each new waypoint, tries again while there is no path, and at last requests `land`; where a zone
/// that was drawn is in the way, it goes on trying.
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
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Idle }
    }
}

impl BThread for PathPlanning {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::MISSION).wait_for(me.any::<(Goto, Land)>());
        Some(match &self.phase {
            Phase::Idle => bid.wait_for(me.any::<Unplannable>()),
            Phase::Asking { .. } => bid.request(me.event(Plan { why: PlanReason::Waypoint })),
            Phase::Computing { .. } => bid.wait_for(me.any::<(Planned, Unplannable, Arrived)>()),
            Phase::Pausing { until, .. } => bid.wait_for(me.any::<Planned>()).deadline(*until),
            Phase::GivingUp { why } => bid.request(me.event(Land { why: why.as_str().into() })),
            Phase::Declining { why } => {
                bid.request(me.event(Declined { what: What::GoTo, why: why.as_str().into() }))
            }
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
            Some(Goto::NAME) => Phase::Asking { attempt: 1 },
            Some(Plan::NAME) => Phase::Computing { attempt },
            // A zone may be removed, and a curfew ends. Whoever goes home or where an operator points does not wait.
            Some(Unplannable::NAME) if is_in_a_zone(event) => {
                Phase::Pausing { attempt: 0, until: cx.now() + PAUSE }
            }
            Some(Unplannable::NAME) if attempt < ATTEMPTS => {
                Phase::Pausing { attempt, until: cx.now() + PAUSE }
            }
            Some(Unplannable::NAME) => {
                let why = event::why(event).unwrap_or("no path to the waypoint").to_owned();
                let leg = Unplannable::read(event).map(|told| told.leg);
                if leg == Some(OPERATOR_LEG) { Phase::Declining { why } } else { Phase::GivingUp { why } }
            }
            None => Phase::Asking { attempt: attempt + 1 },
            Some(_) => Phase::Idle,
        };
    }
}

/// Whether a waypoint of the mission cannot be flown to because of a zone.
fn is_in_a_zone(event: &Event) -> bool {
    Unplannable::read(event).is_some_and(|told| told.leg >= 0 && told.zone.is_some())
}
