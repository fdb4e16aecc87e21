//! What must hold of a vehicle's program: b-threads that watch it and fail.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{BLOCK_LAPSED, CONFIRMED, DUPLICATE_NAME, PEER_JOINED, PEER_LOST, STALLED};
use skein_wire::vocabulary::{
    ADVANCE, BATTERY_CRITICAL, BATTERY_LOW, CLEAR, COMPLETE, ENTER, FAILED, FENCE_BREACHED, FOUND_AIRBORNE,
    GOTO, HAND_BACK, HOLD, HOMEWARD, LAND, LANDED, LEAVE, ORDER, PASSAGE, PATH_BLOCKED, PILOT, PLAN, PLANNED,
    READY, RETURN, SLEPT, STUCK, TAKEOFF, TOO_CLOSE, UNREADY,
};

use crate::bthreads::{HOME_LEG, OPERATOR_LEG, RIGHT_OF_WAY};
use crate::config::Fence;
use crate::me::Me;

/// One thing that must hold in every run.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Requirement {
    name: String,
    rule: Rule,
    phase: Phase,
}

/// The forms of requirements, as in the patterns of Dwyer, Avrunin and Corbett 1999.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Rule {
    /// Absence between: from an event of `from` to the next of `until`, none of `never` happens.
    Absence { never: EventSet, from: EventSet, until: EventSet },
    /// Response: after an event of `from` one of `answer` happens, unless the pilot has the vehicle, and for as long. It is
    /// asked for anew after an event of `anew`.
    Response { from: EventSet, answer: EventSet, anew: EventSet, taken: EventSet, given_back: EventSet },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    /// Nothing is asked.
    Idle,
    /// Absence is asked, or an answer is due.
    Due,
    /// An answer has been given.
    Answered,
    /// The pilot has the vehicle; what was the case before.
    Taken { due: bool, answered: bool },
}

impl Requirement {
    /// None of `never` happens from an event of `from` to the next of `until`.
    #[must_use]
    pub fn absence(name: &str, never: EventSet, from: EventSet, until: EventSet) -> Self {
        Self { name: name.to_owned(), rule: Rule::Absence { never, from, until }, phase: Phase::Idle }
    }

    /// The same, and it is asked from the start.
    #[must_use]
    pub fn absence_from_start(name: &str, never: EventSet, from: EventSet, until: EventSet) -> Self {
        Self { phase: Phase::Due, ..Self::absence(name, never, from, until) }
    }

    /// After an event of `from` one of `answer` happens before the vehicle `me` rests for good, unless a pilot has it.
    #[must_use]
    pub fn response(name: &str, me: &Me, from: EventSet, answer: EventSet) -> Self {
        let rule = Rule::Response {
            from,
            answer,
            anew: me.any(LANDED),
            taken: me.any_of(&[PILOT, SLEPT]),
            given_back: me.any(HAND_BACK),
        };
        Self { name: name.to_owned(), rule, phase: Phase::Idle }
    }

    /// What must hold, in a few words.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The events that make it ask for something.
    #[must_use]
    pub fn begins_with(&self) -> &EventSet {
        match &self.rule {
            Rule::Absence { from, .. } | Rule::Response { from, .. } => from,
        }
    }

    /// Whether it asks for something from the start.
    #[must_use]
    pub fn is_due_at_start(&self) -> bool {
        self.phase == Phase::Due
    }

    fn bid_of_response(&self) -> Option<Bid> {
        let Rule::Response { from, answer, anew, taken, given_back } = &self.rule else { return None };
        let bid = Bid::new().wait_for(anew.clone());
        Some(match self.phase {
            Phase::Idle => bid.wait_for(from.clone()).wait_for(taken.clone()),
            Phase::Due => bid.wait_for(answer.clone()).wait_for(taken.clone()).hot(),
            Phase::Answered => bid.wait_for(taken.clone()),
            Phase::Taken { .. } => bid.wait_for(from.clone()).wait_for(given_back.clone()),
        })
    }
}

impl BThread for Requirement {
    fn bid(&self) -> Option<Bid> {
        match &self.rule {
            Rule::Absence { never, from, until } => Some(match self.phase {
                Phase::Due => Bid::new().wait_for(never.clone()).wait_for(until.clone()),
                _ => Bid::new().wait_for(from.clone()),
            }),
            Rule::Response { .. } => self.bid_of_response(),
        }
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match (&self.rule, self.phase) {
            (Rule::Absence { never, .. }, Phase::Due) if never.contains(event) => {
                return cx.fail(format!("{}: {event} happens", self.name));
            }
            (Rule::Absence { .. }, Phase::Due) => Phase::Idle,
            (Rule::Absence { .. }, _) => Phase::Due,
            (Rule::Response { anew, .. }, _) if anew.contains(event) => Phase::Idle,
            (Rule::Response { taken, .. }, phase) if taken.contains(event) => {
                Phase::Taken { due: phase == Phase::Due, answered: phase == Phase::Answered }
            }
            (Rule::Response { given_back, .. }, Phase::Taken { due, answered }) => {
                match (given_back.contains(event), due, answered) {
                    (true, true, _) => Phase::Due,
                    (true, false, true) => Phase::Answered,
                    (true, false, false) => Phase::Idle,
                    (false, _, answered) => Phase::Taken { due: !answered, answered },
                }
            }
            (Rule::Response { .. }, Phase::Idle) => Phase::Due,
            (Rule::Response { .. }, Phase::Due) => Phase::Answered,
            (Rule::Response { .. }, phase) => phase,
        };
    }
}

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
        Requirement::absence("on the way home or down, nothing leads elsewhere", away, me.any_of(&[RETURN, LAND]), me.any(LANDED)),
        Requirement::response(
            "an empty battery lands the vehicle",
            me,
            me.any(BATTERY_CRITICAL),
            down.clone(),
        ),
        Requirement::response(
            "a low battery sends it home",
            me,
            me.any(BATTERY_LOW),
            home_or_down.clone(),
        ),
        Requirement::response(
            "outside the fence it turns home",
            me,
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
            let bid = requirement.bid().unwrap();
            if bid.waits().contains(&event) {
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
            (&["from", "uav/1/landed"], false),
        ] {
            assert_eq!(after(rule.clone(), events).0.unwrap().is_hot(), due, "{events:?}");
        }
    }
}
