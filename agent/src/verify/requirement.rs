//! The requirements on a vehicle's program: b-threads that watch it and fail.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{BlockLapsed, Confirmed, DuplicateName, PeerJoined, PeerLost, Stalled};
use skein_wire::event::{
    Advance, Airborne, Arrived, BatteryCritical, BatteryLow, Clear, CommandFailed, Complete, Enter, Failed,
    FenceBreached, FoundAirborne, GiveWay, Goto, HandBack, Homeward, Land, Landed, Leave, MOTION, MakeWay,
    OrderTaken, Passage, PathBlocked, PilotTook, PlaceFree, PlaceTaken, Plan, Planned, PositionDoubted,
    PositionTrusted, Ready, Return, Slept, Stuck, Takeoff, TooClose, Unready, What,
};

use crate::bthreads::{HOME_LEG, OPERATOR_LEG, RIGHT_OF_WAY};
use crate::config::Fence;
use crate::me::Me;

/// One thing that must hold in every run.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Requirement {
    name: String,
    rule: Rule,
}

/// The forms of requirements, as in the patterns of Dwyer, Avrunin and Corbett 1999.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Rule {
    /// Absence between: from an event of `from` to the next of `until`, none of `never` happens.
    Absence { never: EventSet, from: EventSet, until: EventSet, is_on: bool },
    /// Response: after an event of `from` one of `answer` happens.
    Response {
        from: EventSet,
        answer: EventSet,
        flight: Option<Flight>,
        pilot: Pilot,
        is_due: bool,
        is_answered: bool,
    },
}

/// A response that is asked for in the air only, and once in a flight: an answer that came before counts.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Flight {
    begins: EventSet,
    ends: EventSet,
    is_on: bool,
}

/// As long as a pilot has the vehicle, answers may wait.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Pilot {
    takes: EventSet,
    gives_back: EventSet,
    has_it: bool,
}

impl Requirement {
    /// None of `never` happens from an event of `from` to the next of `until`.
    pub fn absence(name: &str, never: EventSet, from: EventSet, until: EventSet) -> Self {
        Self { name: name.to_owned(), rule: Rule::Absence { never, from, until, is_on: false } }
    }

    /// The same, and it is asked from the start.
    pub fn absence_from_start(name: &str, never: EventSet, from: EventSet, until: EventSet) -> Self {
        Self { name: name.to_owned(), rule: Rule::Absence { never, from, until, is_on: true } }
    }

    /// After each event of `from` one of `answer` happens before the vehicle `me` rests for good, unless a pilot has
    /// it.
    pub fn response(name: &str, me: &Me, from: EventSet, answer: EventSet) -> Self {
        Self::answered(name, me, from, answer, None)
    }

    /// The same once in each flight that begins with one of `begins`: an answer that came before counts.
    pub fn response_in_flight(
        name: &str,
        me: &Me,
        begins: EventSet,
        from: EventSet,
        answer: EventSet,
    ) -> Self {
        let flight = Flight { begins, ends: me.any::<(Landed, CommandFailed)>(), is_on: false };
        Self::answered(name, me, from, answer, Some(flight))
    }

    fn answered(name: &str, me: &Me, from: EventSet, answer: EventSet, flight: Option<Flight>) -> Self {
        let pilot =
            Pilot { takes: me.any::<(PilotTook, Slept)>(), gives_back: me.any::<HandBack>(), has_it: false };
        let rule = Rule::Response { from, answer, flight, pilot, is_due: false, is_answered: false };
        Self { name: name.to_owned(), rule }
    }

    /// The requirement in a few words.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl Rule {
    /// Takes in what happens; true if it must not.
    fn is_broken_by(&mut self, event: &Event) -> bool {
        match self {
            Self::Absence { never, from, until, is_on } => {
                let is_broken = *is_on && never.contains(event);
                *is_on = (*is_on || from.contains(event)) && !until.contains(event);
                is_broken
            }
            Self::Response { from, answer, flight, pilot, is_due, is_answered } => {
                pilot.has_it =
                    (pilot.has_it || pilot.takes.contains(event)) && !pilot.gives_back.contains(event);
                if let Some(flight) = flight {
                    let (begins, ends) = (flight.begins.contains(event), flight.ends.contains(event));
                    flight.is_on = (flight.is_on || begins) && !ends;
                    if begins || ends {
                        (*is_due, *is_answered) = (false, false);
                    }
                }
                let (is_asked, once) = flight.as_ref().map_or((true, false), |flight| (flight.is_on, true));
                if answer.contains(event) {
                    (*is_due, *is_answered) = (false, is_asked && once);
                } else if from.contains(event) && is_asked && !*is_answered {
                    *is_due = true;
                }
                false
            }
        }
    }
}

impl BThread for Requirement {
    fn bid(&self) -> Option<Bid> {
        Some(match &self.rule {
            Rule::Absence { never, from, until, is_on } => {
                let bid = Bid::new().wait_for(from.clone());
                if *is_on { bid.wait_for(never.clone()).wait_for(until.clone()) } else { bid }
            }
            Rule::Response { from, answer, flight, pilot, is_due, .. } => {
                let bid = Bid::new().wait_for(from.clone()).wait_for(answer.clone());
                let bid = bid.wait_for(pilot.takes.clone()).wait_for(pilot.gives_back.clone());
                let bid = flight.iter().fold(bid, |bid, flight| {
                    bid.wait_for(flight.begins.clone()).wait_for(flight.ends.clone())
                });
                if *is_due && !pilot.has_it { bid.hot() } else { bid }
            }
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if self.rule.is_broken_by(event) {
            cx.fail(format!("{event} happens"));
        }
    }
}

/// The events that begin a flight.
type InTheAir = (Takeoff, FoundAirborne);

/// The requirements on every vehicle, whatever its mission.
pub fn requirements(me: &Me, fence: &Fence) -> Vec<Requirement> {
    let order = |what: &[What]| {
        me.any::<OrderTaken>().and(EventSet::any_of(what.iter().copied().map(OrderTaken::what)))
    };
    let (home, elsewhere) = (Goto::leg(HOME_LEG), Goto::leg(HOME_LEG).not());
    let leave = me.any::<(Advance, Homeward)>();
    let away = me.any::<Goto>().and(elsewhere.clone());
    let outside = me.any::<Goto>().and(EventSet::region(fence.min, fence.max).not());
    let down = me.any::<(Land, Landed)>();
    let home_or_down = me.any::<(Return, Land, Landed)>();
    vec![
        Requirement::absence(
            "from a pilot's mode change until it is handed back, the agent moves nothing",
            me.any_in(MOTION),
            me.any::<(PilotTook, Slept)>(),
            me.any::<HandBack>(),
        ),
        Requirement::absence(
            "with a neighbour inside the emergency distance there is no leave to move",
            leave.clone(),
            me.any::<TooClose>(),
            me.any::<Clear>(),
        ),
        Requirement::absence(
            "while its position is doubted there is no leave to move",
            leave.clone(),
            me.any::<PositionDoubted>(),
            me.any::<(PositionTrusted, Land, Landed)>(),
        ),
        Requirement::absence(
            "along a path that is known to be blocked there is no leave to move",
            leave.clone(),
            me.any::<PathBlocked>(),
            me.any::<(Planned, Goto, Land)>(),
        ),
        Requirement::absence(
            "while another vehicle has the place of its leg there is no leave to move there",
            me.any::<Advance>(),
            me.any::<PlaceTaken>().and(PlaceTaken::leg(0)),
            me.any::<(PlaceFree, Arrived, Goto, Land, Landed)>(),
        ),
        Requirement::absence(
            "before a narrow passage there is no leave to move until it is entered, but to make way",
            leave,
            me.any::<(Passage, GiveWay)>(),
            me.any::<(Enter, Leave, Landed, MakeWay)>(),
        ),
        Requirement::absence_from_start(
            "no passage is entered without a confirmed claim",
            me.any::<Enter>(),
            me.any::<BlockLapsed>().and(BlockLapsed::bthread(RIGHT_OF_WAY)).or(me.any::<(
                Leave,
                Landed,
                PeerJoined,
                PeerLost,
                Stalled,
            )>()),
            me.any::<Confirmed>().and(Confirmed::bthread(RIGHT_OF_WAY)),
        ),
        Requirement::absence_from_start(
            "no take-off unless the checks pass",
            me.any::<Takeoff>(),
            me.any::<Unready>(),
            me.any::<Ready>(),
        ),
        Requirement::absence(
            "no take-off in the air",
            me.any::<Takeoff>(),
            me.any::<(Takeoff, Airborne, FoundAirborne)>(),
            me.any::<(Landed, CommandFailed)>(),
        ),
        Requirement::absence(
            "no take-off after the mission's end",
            me.any::<Takeoff>(),
            me.any::<(Complete, Failed)>(),
            EventSet::None,
        ),
        Requirement::absence(
            "found in the air, it flies no mission before it is ordered to",
            me.any::<(Takeoff, Goto, Advance, Homeward)>(),
            me.any::<FoundAirborne>(),
            order(&[What::Resume, What::Return]).or(me.any::<Landed>()),
        ),
        Requirement::absence(
            "while another process has its name, it neither takes off nor goes on",
            me.any::<(Takeoff, Advance, Enter)>(),
            me.any::<DuplicateName>(),
            order(&[What::Resume]),
        ),
        Requirement::absence(
            "held by an order, it has no leave to move",
            me.any::<Advance>(),
            order(&[What::Hold]),
            order(&[What::Resume, What::GoTo]).or(me.any::<(Return, Land)>()),
        ),
        Requirement::absence_from_start(
            "no waypoint outside the fence",
            outside,
            EventSet::None,
            EventSet::None,
        ),
        Requirement::absence(
            "battery emergency goes before fence, battery low, link and mission",
            me.any::<(Return, Goto)>(),
            me.any::<BatteryCritical>(),
            me.any::<Landed>(),
        ),
        Requirement::absence(
            "a fence breach goes before orders and mission",
            away.clone(),
            me.any::<FenceBreached>(),
            home_or_down.clone(),
        ),
        Requirement::absence(
            "a low battery goes before orders and mission",
            away.clone(),
            me.any::<BatteryLow>(),
            home_or_down.clone(),
        ),
        Requirement::absence(
            "on the way home or down, nothing leads elsewhere",
            away,
            me.any::<(Return, Land)>(),
            // What was ordered on the ground has no meaning in the air.
            me.any::<(Landed, Takeoff, FoundAirborne)>(),
        ),
        Requirement::absence(
            "on the way down, nothing leads up again",
            me.any::<Goto>(),
            me.any::<Land>(),
            me.any::<(Landed, Takeoff, FoundAirborne, HandBack)>(),
        ),
        Requirement::response_in_flight(
            "whoever returns heads for home or lands",
            me,
            // One that was found in the air waits for an order.
            me.any::<Takeoff>(),
            me.any::<Return>(),
            me.any::<Goto>().and(home).or(me.any::<(Land, Landed)>()),
        ),
        Requirement::response_in_flight(
            "an empty battery lands the vehicle",
            me,
            me.any::<InTheAir>(),
            me.any::<BatteryCritical>(),
            down.clone(),
        ),
        Requirement::response_in_flight(
            "a low battery sends it home",
            me,
            me.any::<InTheAir>(),
            me.any::<BatteryLow>(),
            home_or_down.clone(),
        ),
        Requirement::response_in_flight(
            "outside the fence it turns home",
            me,
            me.any::<InTheAir>(),
            me.any::<FenceBreached>(),
            home_or_down.clone(),
        ),
        Requirement::response(
            "ordered to land, it lands",
            me,
            order(&[What::Land]),
            down.or(me.any::<OrderTaken>()),
        ),
        Requirement::response(
            "ordered home, it goes home",
            me,
            order(&[What::Return]),
            home_or_down.or(me.any::<OrderTaken>()),
        ),
        Requirement::response(
            "a vehicle that is stuck plans anew or lands",
            me,
            me.any::<Stuck>(),
            me.any::<(Plan, Land, Goto, Landed)>(),
        ),
        Requirement::absence(
            "diverted by an operator, the mission waits to be resumed",
            me.any::<Goto>().and(Goto::leg(OPERATOR_LEG).not()).and(elsewhere),
            me.any::<Goto>().and(Goto::leg(OPERATOR_LEG)),
            order(&[What::Resume]).or(me.any::<Landed>()),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn after(mut requirement: Requirement, events: &[&str]) -> (Option<Bid>, bool) {
        let mut cx = Context::at(Duration::ZERO);
        for event in events {
            let event = Event::new(*event);
            if requirement.bid().unwrap().waits().contains(&event) {
                requirement.resume(&event, &mut cx);
            }
        }
        let failed = format!("{cx:?}").contains("happens");
        (requirement.bid(), failed)
    }

    #[test]
    fn absence_counts_between_its_two_events_only() {
        let rule = Requirement::absence("test", "x".into(), "from".into(), "until".into());
        for (events, fails) in [
            (&["x"][..], false),
            (&["from", "x"], true),
            (&["from", "until", "x"], false),
            (&["from", "until", "from", "x"], true),
        ] {
            assert_eq!(after(rule.clone(), events).1, fails, "{events:?}");
        }
    }

    #[test]
    fn a_response_is_due_until_it_comes_but_not_while_a_pilot_flies() {
        let me = Me::new("uav/1");
        let rule = Requirement::response("test", &me, "from".into(), "answer".into());
        for (events, due) in [
            (&[][..], false),
            (&["from"], true),
            (&["from", "answer"], false),
            (&["from", "uav/1/pilot"], false),
            (&["from", "uav/1/pilot", "uav/1/hand_back"], true),
            (&["uav/1/pilot", "from", "uav/1/hand_back"], true),
            (&["from", "answer", "uav/1/pilot", "uav/1/hand_back"], false),
            (&["answer", "from"], true),
        ] {
            assert_eq!(after(rule.clone(), events).0.unwrap().is_hot(), due, "{events:?}");
        }
    }

    #[test]
    fn a_response_in_flight_is_due_once_and_in_the_air_only() {
        let me = Me::new("uav/1");
        let rule = Requirement::response_in_flight(
            "test",
            &me,
            me.any::<InTheAir>(),
            "from".into(),
            "answer".into(),
        );
        for (events, due) in [
            (&["from"][..], false),
            (&["uav/1/takeoff", "from"], true),
            (&["uav/1/takeoff", "from", "uav/1/landed"], false),
            (&["uav/1/takeoff", "answer", "from"], false),
            (&["uav/1/takeoff", "answer", "uav/1/landed", "uav/1/takeoff", "from"], true),
        ] {
            assert_eq!(after(rule.clone(), events).0.unwrap().is_hot(), due, "{events:?}");
        }
    }
}
