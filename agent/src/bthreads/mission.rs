//! Mission: take off when told, fly the waypoints in turn, land.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::vocabulary::{
    AIRBORNE, ARRIVED, COMMAND_FAILED, COMPLETE, FAILED, FOUND_AIRBORNE, GOTO, HAND_BACK, LAND, LANDED,
    ORDER, RETURN, TAKEOFF,
};

use crate::bthreads::OPERATOR_LEG;
use crate::{me::Me, precedence};

/// Requests one `goto` after another, then `land`, and says how the mission ended.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Mission {
    me: Me,
    /// The `goto` events of the waypoints, in order.
    waypoints: Vec<Event>,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Grounded,
    /// In the air when the agent started: flies when an operator says so.
    Found,
    Climbing,
    Heading {
        leg: usize,
    },
    Flying {
        leg: usize,
    },
    /// An operator has sent the vehicle elsewhere; this leg comes next.
    Diverted {
        leg: usize,
    },
    Descending {
        failure: Option<String>,
    },
    Landing {
        failure: Option<String>,
    },
    Down {
        failure: Option<String>,
    },
    Over,
}

impl Mission {
    /// A mission over `waypoints` in metres ENU, the last being where the vehicle lands.
    #[must_use]
    pub fn new(me: Me, waypoints: &[[f64; 3]]) -> Self {
        Self { waypoints: gotos(&me, waypoints), me, phase: Phase::Grounded }
    }

    /// The phase that flies to waypoint `leg`, or lands after the last.
    fn towards(&self, leg: usize) -> Phase {
        if leg < self.waypoints.len() { Phase::Heading { leg } } else { Phase::Descending { failure: None } }
    }
}

/// The `goto` of each waypoint, in order; the vehicle lands at the last.
pub fn gotos(me: &Me, waypoints: &[[f64; 3]]) -> Vec<Event> {
    let last = waypoints.len().saturating_sub(1);
    let goto = |(leg, &[x, y, z]): (usize, &[f64; 3])| {
        let number = i64::try_from(leg).unwrap_or(i64::MAX);
        me.event(GOTO).with("leg", number).with("lands", leg == last).with("x", x).with("y", y).with("z", z)
    };
    waypoints.iter().enumerate().map(goto).collect()
}

/// Why the vehicle is on its way down, as the event that sent it says.
fn reason(event: &Event) -> String {
    event.text("why").unwrap_or("no reason given").to_owned()
}

impl BThread for Mission {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let ended_by_others = me.any_of(&[LAND, RETURN, LANDED]);
        let diverted = me.any(GOTO).and(EventSet::field_is("leg", OPERATOR_LEG));
        let bid = Bid::new().priority(precedence::MISSION);
        Some(match &self.phase {
            Phase::Grounded => bid.wait_for(me.any_of(&[TAKEOFF, FOUND_AIRBORNE])),
            Phase::Found => bid.wait_for(me.any(ORDER)).wait_for(ended_by_others),
            Phase::Climbing => bid.wait_for(me.any_of(&[AIRBORNE, COMMAND_FAILED])).wait_for(ended_by_others),
            Phase::Heading { leg } => {
                bid.request(self.waypoints.get(*leg)?.clone()).wait_for(diverted).wait_for(ended_by_others)
            }
            Phase::Flying { .. } => {
                bid.wait_for(me.any(ARRIVED)).wait_for(diverted).wait_for(ended_by_others)
            }
            Phase::Diverted { .. } => bid.wait_for(me.any(ORDER)).wait_for(ended_by_others),
            Phase::Descending { failure } => {
                let why = failure.as_deref().unwrap_or("mission complete");
                bid.request(me.because(LAND, why)).wait_for(ended_by_others)
            }
            // A pilot may interrupt a landing; given the vehicle back, it still has to land.
            Phase::Landing { .. } => bid.wait_for(me.any_of(&[LANDED, HAND_BACK])),
            Phase::Down { failure: None } => bid.request(me.event(COMPLETE)),
            Phase::Down { failure: Some(why) } => bid.request(me.because(FAILED, why)),
            // There is nothing left to take off for.
            Phase::Over => bid.block(me.any(TAKEOFF)),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let verb = self.me.verb(event).unwrap_or_default();
        self.phase = match (&self.phase, verb) {
            (Phase::Down { .. }, _) => Phase::Over,
            (Phase::Landing { failure }, HAND_BACK) => Phase::Descending { failure: failure.clone() },
            (Phase::Landing { failure }, _) => Phase::Down { failure: failure.clone() },
            (Phase::Descending { failure }, LAND | RETURN) => Phase::Landing { failure: failure.clone() },
            (Phase::Grounded, TAKEOFF) => Phase::Climbing,
            (Phase::Grounded, FOUND_AIRBORNE) => Phase::Found,
            (Phase::Found, ORDER) if event.text("what") == Some("resume") => self.towards(0),
            (Phase::Climbing, AIRBORNE) => self.towards(0),
            (Phase::Climbing, COMMAND_FAILED) => Phase::Down { failure: Some(reason(event)) },
            (_, LAND | RETURN) => Phase::Landing { failure: Some(reason(event)) },
            (_, LANDED) => Phase::Down { failure: Some("the autopilot landed by itself".to_owned()) },
            (Phase::Heading { leg } | Phase::Flying { leg }, GOTO)
                if event.int("leg") == Some(OPERATOR_LEG) =>
            {
                Phase::Diverted { leg: *leg }
            }
            (Phase::Diverted { leg }, ORDER) if event.text("what") == Some("resume") => self.towards(*leg),
            (Phase::Heading { leg }, GOTO) => Phase::Flying { leg: *leg },
            (Phase::Flying { leg }, ARRIVED) if event.int("leg") == i64::try_from(*leg).ok() => {
                self.towards(leg + 1)
            }
            (phase, _) => phase.clone(),
        };
    }
}
