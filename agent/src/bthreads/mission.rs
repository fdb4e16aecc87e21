//! Mission: take off when told, fly the waypoints in turn with the errands between them, land.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::Route;
use skein_wire::event::{
    self, Airborne, Arrived, CommandFailed, Complete, Declared as _, Failed, FoundAirborne, Goto, HandBack,
    Land, Landed, OrderTaken, Payload, Rerouted, Return, Takeoff, What,
};

use crate::bthreads::OPERATOR_LEG;
use crate::errand::Errand;
use crate::{me::Me, precedence};

/// Requests one `goto` after another, then `land`, and says how the mission ended.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Mission {
    me: Me,
    /// The `goto` events of the waypoints, in order.
    waypoints: Vec<Event>,
    /// The errand before each leg, where there is one.
    errands: BTreeMap<usize, Steps>,
    phase: Phase,
}

/// An errand as its steps.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Steps {
    stay: Duration,
    payload: Vec<Event>,
    limit: Option<Event>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Grounded,
    /// In the air when the agent started: flies when an operator says so.
    Found,
    Climbing,
    /// Stays before this leg.
    Staying {
        leg: usize,
        until: Duration,
    },
    /// Tells what it carries, command by command, before this leg.
    Telling {
        leg: usize,
        next: usize,
    },
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
    /// The name that this b-thread runs under: whoever is sent a route asks it by name.
    pub const NAME: &'static str = "mission";

    /// Why it takes on no route now, if so.
    pub fn objects_to_routes(&self) -> Option<&'static str> {
        match self.phase {
            Phase::Descending { .. } | Phase::Landing { .. } => Some("it is on its way home or down"),
            Phase::Down { .. } | Phase::Over => Some("its mission is over"),
            _ => None,
        }
    }

    /// A route takes the place of what was left; a vehicle that an operator has sent elsewhere flies it when resumed.
    fn reroute(&mut self, route: &Route) {
        self.waypoints = gotos(&self.me, route.points());
        self.errands.clear();
        self.phase = match self.phase {
            Phase::Heading { .. } | Phase::Flying { .. } => Phase::Heading { leg: 0 },
            Phase::Diverted { .. } => Phase::Diverted { leg: 0 },
            ref phase => phase.clone(),
        };
    }

    /// A mission over `waypoints` in metres ENU, the last being where the vehicle lands.
    pub fn new(me: Me, waypoints: &[[f64; 3]]) -> Self {
        let errands = BTreeMap::new();
        Self { waypoints: gotos(&me, waypoints), errands, me, phase: Phase::Grounded }
    }

    /// The same with these errands.
    #[must_use]
    pub fn with_errands(mut self, errands: &[Errand]) -> Self {
        for errand in errands {
            let payload = errand.payload.iter().map(|command| command.event(&self.me)).collect();
            let steps = Steps { stay: errand.stay(), payload, limit: errand.limit(&self.me) };
            self.errands.insert(errand.before, steps);
        }
        self
    }

    /// The phase that begins with the errand before waypoint `leg`.
    fn before(&self, leg: usize, now: Duration) -> Phase {
        match self.errands.get(&leg) {
            Some(errand) if errand.stay > Duration::ZERO => Phase::Staying { leg, until: now + errand.stay },
            _ => self.telling(leg, 0),
        }
    }

    /// The phase that goes on with command `next` before waypoint `leg`.
    fn telling(&self, leg: usize, next: usize) -> Phase {
        match self.command(leg, next) {
            Some(_) => Phase::Telling { leg, next },
            None => self.towards(leg),
        }
    }

    fn command(&self, leg: usize, index: usize) -> Option<&Event> {
        self.errands.get(&leg)?.payload.get(index)
    }

    /// The limit that is stated on the way to waypoint `leg`.
    fn limit(&self, leg: usize) -> impl Iterator<Item = Event> + '_ {
        self.errands.get(&leg).and_then(|errand| errand.limit.clone()).into_iter()
    }

    /// The phase that flies to waypoint `leg`, or lands after the last.
    fn towards(&self, leg: usize) -> Phase {
        if leg < self.waypoints.len() { Phase::Heading { leg } } else { Phase::Descending { failure: None } }
    }
}

/// The `goto` of each waypoint, in order; the vehicle lands at the last.
pub fn gotos(me: &Me, waypoints: &[[f64; 3]]) -> Vec<Event> {
    let last = waypoints.len().saturating_sub(1);
    let goto = |(index, &[x, y, z]): (usize, &[f64; 3])| {
        let leg = i64::try_from(index).unwrap_or(i64::MAX);
        me.event(Goto { leg, lands: index == last, x, y, z })
    };
    waypoints.iter().enumerate().map(goto).collect()
}

fn is_resume(event: &Event) -> bool {
    OrderTaken::read(event).is_some_and(|order| order.what == What::Resume)
}

/// Why the vehicle is on its way down, as the event that sent it says.
fn reason(event: &Event) -> String {
    event::why(event).unwrap_or("no reason given").to_owned()
}

impl BThread for Mission {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let ended_by_others = me.any::<(Land, Return, Landed)>();
        let diverted = me.any::<Goto>().and(Goto::leg(OPERATOR_LEG));
        let bid = Bid::new().priority(precedence::MISSION);
        let bid = match self.objects_to_routes() {
            None => bid.wait_for(me.any::<Rerouted>()),
            Some(_) => bid,
        };
        Some(match &self.phase {
            Phase::Grounded => bid.wait_for(me.any::<(Takeoff, FoundAirborne)>()),
            Phase::Found => bid.wait_for(me.any::<OrderTaken>()).wait_for(ended_by_others),
            Phase::Climbing => bid.wait_for(me.any::<(Airborne, CommandFailed)>()).wait_for(ended_by_others),
            Phase::Staying { until, .. } => bid.deadline(*until).wait_for(diverted).wait_for(ended_by_others),
            Phase::Telling { leg, next } => {
                bid.request(self.command(*leg, *next)?.clone()).wait_for(diverted).wait_for(ended_by_others)
            }
            Phase::Heading { leg } => {
                bid.request(self.waypoints.get(*leg)?.clone()).wait_for(diverted).wait_for(ended_by_others)
            }
            Phase::Flying { leg } => {
                let bid = self.limit(*leg).fold(bid, Bid::state);
                bid.wait_for(me.any::<Arrived>()).wait_for(diverted).wait_for(ended_by_others)
            }
            Phase::Diverted { .. } => bid.wait_for(me.any::<OrderTaken>()).wait_for(ended_by_others),
            Phase::Descending { failure } => {
                let why = failure.as_deref().unwrap_or("mission complete");
                bid.request(me.event(Land { why: why.into() })).wait_for(ended_by_others)
            }
            // A pilot may interrupt a landing; given the vehicle back, it still has to land.
            Phase::Landing { .. } => bid.wait_for(me.any::<(Landed, HandBack)>()),
            Phase::Down { failure: None } => bid.request(me.event(Complete)),
            Phase::Down { failure: Some(why) } => bid.request(me.event(Failed { why: why.as_str().into() })),
            // There is nothing left to take off for.
            Phase::Over => bid.block(me.any::<Takeoff>()),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if let Some(rerouted) = self.me.read::<Rerouted>(event) {
            if let Ok(route) = rerouted.way.parse() {
                self.reroute(&route);
            }
            return;
        }
        let now = cx.now();
        let verb = self.me.verb(event).unwrap_or_default();
        self.phase = match (&self.phase, verb) {
            (Phase::Down { .. }, _) => Phase::Over,
            (Phase::Landing { failure }, HandBack::NAME) => Phase::Descending { failure: failure.clone() },
            (Phase::Landing { failure }, _) => Phase::Down { failure: failure.clone() },
            (Phase::Descending { failure }, Land::NAME | Return::NAME) => {
                Phase::Landing { failure: failure.clone() }
            }
            (Phase::Grounded, Takeoff::NAME) => Phase::Climbing,
            (Phase::Grounded, FoundAirborne::NAME) => Phase::Found,
            (Phase::Found, OrderTaken::NAME) if is_resume(event) => self.before(0, now),
            (Phase::Climbing, Airborne::NAME) => self.before(0, now),
            (Phase::Climbing, CommandFailed::NAME) => Phase::Down { failure: Some(reason(event)) },
            (_, Land::NAME | Return::NAME) => Phase::Landing { failure: Some(reason(event)) },
            (_, Landed::NAME) => Phase::Down { failure: Some("the autopilot landed by itself".to_owned()) },
            (
                Phase::Staying { leg, .. }
                | Phase::Telling { leg, .. }
                | Phase::Heading { leg }
                | Phase::Flying { leg },
                Goto::NAME,
            ) if Goto::read(event).is_some_and(|goto| goto.leg == OPERATOR_LEG) => {
                Phase::Diverted { leg: *leg }
            }
            (Phase::Diverted { leg }, OrderTaken::NAME) if is_resume(event) => self.towards(*leg),
            (Phase::Heading { leg }, Goto::NAME) => Phase::Flying { leg: *leg },
            (Phase::Flying { leg }, Arrived::NAME)
                if Arrived::read(event).map(|arrived| arrived.leg) == i64::try_from(*leg).ok() =>
            {
                self.before(leg + 1, now)
            }
            (Phase::Staying { leg, until }, _) if now >= *until => self.telling(*leg, 0),
            (Phase::Telling { leg, next }, Payload::NAME) => self.telling(*leg, next + 1),
            (phase, _) => phase.clone(),
        };
    }
}
