//! What must hold of a vehicle's program: b-threads that watch it and fail.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{BLOCK_LAPSED, CONFIRMED, DUPLICATE_NAME, PEER_JOINED, PEER_LOST, STALLED};
use skein_wire::vocabulary::{
    ADVANCE, AIRBORNE, BATTERY_CRITICAL, BATTERY_LOW, CLEAR, COMMAND_FAILED, COMPLETE, ENTER, FAILED,
    FENCE_BREACHED, FOUND_AIRBORNE, GOTO, HAND_BACK, HOLD, HOMEWARD, LAND, LANDED, LEAVE, ORDER, PASSAGE,
    PATH_BLOCKED, PILOT, PLAN, PLANNED, READY, RETURN, SLEPT, STUCK, TAKEOFF, TOO_CLOSE, UNREADY,
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
    #[must_use]
    pub fn absence(name: &str, never: EventSet, from: EventSet, until: EventSet) -> Self {
        Self { name: name.to_owned(), rule: Rule::Absence { never, from, until, is_on: false } }
    }

    /// The same, and it is asked from the start.
    #[must_use]
    pub fn absence_from_start(name: &str, never: EventSet, from: EventSet, until: EventSet) -> Self {
        Self { name: name.to_owned(), rule: Rule::Absence { never, from, until, is_on: true } }
    }

    /// After each event of `from` one of `answer` happens before the vehicle `me` rests for good, unless a pilot has it.
    #[must_use]
    pub fn response(name: &str, me: &Me, from: EventSet, answer: EventSet) -> Self {
        Self::answered(name, me, from, answer, None)
    }

    /// The same once in each flight that begins with one of `begins`: an answer that came before counts.
    #[must_use]
    pub fn response_in_flight(
        name: &str,
        me: &Me,
        begins: &[&str],
        from: EventSet,
        answer: EventSet,
    ) -> Self {
        let flight =
            Flight { begins: me.any_of(begins), ends: me.any_of(&[LANDED, COMMAND_FAILED]), is_on: false };
        Self::answered(name, me, from, answer, Some(flight))
    }

    fn answered(name: &str, me: &Me, from: EventSet, answer: EventSet, flight: Option<Flight>) -> Self {
        let pilot = Pilot { takes: me.any_of(&[PILOT, SLEPT]), gives_back: me.any(HAND_BACK), has_it: false };
        let rule = Rule::Response { from, answer, flight, pilot, is_due: false, is_answered: false };
        Self { name: name.to_owned(), rule }
    }

    /// What must hold, in a few words.
    #[must_use]
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

/// What a flight begins with.
const IN_THE_AIR: [&str; 2] = [TAKEOFF, FOUND_AIRBORNE];

/// What must hold of every vehicle, whatever its mission.
#[must_use]
pub fn requirements(me: &Me, fence: &Fence) -> Vec<Requirement> {
    let order = |what: &[&str]| {
        me.any(ORDER).and(EventSet::any_of(what.iter().map(|what| EventSet::field_is("what", *what))))
    };
    let leg = |number: i64| EventSet::field_is("leg", number);
    let about_claim = |fact: &str| me.any(fact).and(EventSet::field_is("bthread", RIGHT_OF_WAY));
    let moves = me.any_of(&[TAKEOFF, GOTO, PLAN, ADVANCE, HOMEWARD, ENTER, HOLD, LAND, RETURN]);
    let leave = me.any_of(&[ADVANCE, HOMEWARD]);
    let away = me.any(GOTO).and(leg(HOME_LEG).not());
    let outside = me.any(GOTO).and(EventSet::region(fence.min, fence.max).not());
    let down = me.any_of(&[LAND, LANDED]);
    let home_or_down = me.any_of(&[RETURN, LAND, LANDED]);
    vec![
        Requirement::absence(
            "from a pilot's mode change until it is handed back, the agent moves nothing",
            moves,
            me.any_of(&[PILOT, SLEPT]),
            me.any(HAND_BACK),
        ),
        Requirement::absence(
            "with a neighbour inside the emergency distance there is no leave to move",
            leave.clone(),
            me.any(TOO_CLOSE),
            me.any(CLEAR),
        ),
        Requirement::absence(
            "along a path that is known to be blocked there is no leave to move",
            leave.clone(),
            me.any(PATH_BLOCKED),
            me.any_of(&[PLANNED, GOTO, LAND]),
        ),
        Requirement::absence(
            "before a narrow passage there is no leave to move until it is entered",
            leave,
            me.any(PASSAGE),
            me.any_of(&[ENTER, LEAVE, LANDED]),
        ),
        Requirement::absence_from_start(
            "no passage is entered without a confirmed claim",
            me.any(ENTER),
            about_claim(BLOCK_LAPSED).or(me.any_of(&[LEAVE, LANDED, PEER_JOINED, PEER_LOST, STALLED])),
            about_claim(CONFIRMED),
        ),
        Requirement::absence_from_start(
            "no take-off unless the checks pass",
            me.any(TAKEOFF),
            me.any(UNREADY),
            me.any(READY),
        ),
        Requirement::absence(
            "no take-off in the air",
            me.any(TAKEOFF),
            me.any_of(&[TAKEOFF, AIRBORNE, FOUND_AIRBORNE]),
            me.any_of(&[LANDED, COMMAND_FAILED]),
        ),
        Requirement::absence(
            "no take-off after the mission's end",
            me.any(TAKEOFF),
            me.any_of(&[COMPLETE, FAILED]),
            EventSet::None,
        ),
        Requirement::absence(
            "found in the air, it flies no mission before it is ordered to",
            me.any_of(&[TAKEOFF, GOTO, ADVANCE, HOMEWARD]),
            me.any(FOUND_AIRBORNE),
            order(&["resume", "return"]).or(me.any(LANDED)),
        ),
        Requirement::absence(
            "while another process has its name, it neither takes off nor goes on",
            me.any_of(&[TAKEOFF, ADVANCE, ENTER]),
            me.any(DUPLICATE_NAME),
            order(&["resume"]),
        ),
        Requirement::absence(
            "held by an order, it has no leave to move",
            me.any(ADVANCE),
            order(&["hold"]),
            order(&["resume", "goto"]).or(me.any_of(&[RETURN, LAND])),
        ),
        Requirement::absence_from_start(
            "no waypoint outside the fence",
            outside,
            EventSet::None,
            EventSet::None,
        ),
        Requirement::absence(
            "battery emergency goes before fence, battery low, link and mission",
            me.any_of(&[RETURN, GOTO]),
            me.any(BATTERY_CRITICAL),
            me.any(LANDED),
        ),
        Requirement::absence(
            "a fence breach goes before orders and mission",
            away.clone(),
            me.any(FENCE_BREACHED),
            home_or_down.clone(),
        ),
        Requirement::absence(
            "a low battery goes before orders and mission",
            away.clone(),
            me.any(BATTERY_LOW),
            home_or_down.clone(),
        ),
        Requirement::absence(
            "on the way home or down, nothing leads elsewhere",
            away,
            me.any_of(&[RETURN, LAND]),
            // What was ordered on the ground has no meaning in the air.
            me.any_of(&[LANDED, TAKEOFF, FOUND_AIRBORNE]),
        ),
        Requirement::absence(
            "on the way down, nothing leads up again",
            me.any(GOTO),
            me.any(LAND),
            me.any_of(&[LANDED, TAKEOFF, FOUND_AIRBORNE, HAND_BACK]),
        ),
        Requirement::response_in_flight(
            "whoever returns heads for home or lands",
            me,
            // One that was found in the air waits for an order.
            &[TAKEOFF],
            me.any(RETURN),
            me.any(GOTO).and(leg(HOME_LEG)).or(me.any_of(&[LAND, LANDED])),
        ),
        Requirement::response_in_flight(
            "an empty battery lands the vehicle",
            me,
            &IN_THE_AIR,
            me.any(BATTERY_CRITICAL),
            down.clone(),
        ),
        Requirement::response_in_flight(
            "a low battery sends it home",
            me,
            &IN_THE_AIR,
            me.any(BATTERY_LOW),
            home_or_down.clone(),
        ),
        Requirement::response_in_flight(
            "outside the fence it turns home",
            me,
            &IN_THE_AIR,
            me.any(FENCE_BREACHED),
            home_or_down.clone(),
        ),
        Requirement::response("ordered to land, it lands", me, order(&["land"]), down.or(me.any(ORDER))),
        Requirement::response(
            "ordered home, it goes home",
            me,
            order(&["return"]),
            home_or_down.or(me.any(ORDER)),
        ),
        Requirement::response(
            "a vehicle that is stuck plans anew or lands",
            me,
            me.any(STUCK),
            me.any_of(&[PLAN, LAND, GOTO, LANDED]),
        ),
        Requirement::absence(
            "diverted by an operator, the mission waits to be resumed",
            me.any(GOTO).and(leg(OPERATOR_LEG).not()).and(leg(HOME_LEG).not()),
            me.any(GOTO).and(leg(OPERATOR_LEG)),
            order(&["resume"]).or(me.any(LANDED)),
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
        let rule = Requirement::response_in_flight("test", &me, &IN_THE_AIR, "from".into(), "answer".into());
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
