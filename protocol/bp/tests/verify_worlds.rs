//! The verifier on programs with a world around them: when the world may act, whether the program comes to rest, what
//! stays within reach, and what was met.

use crate::support::plain;
use serde_json::{Value, json};
use skein_bp::verify::{Inspection, Timers, Verifier, ViolationKind};
use skein_bp::{Bid, Event, Program};

fn repeat(syncs: Value) -> Value {
    json!([{"repeat": "forever", "do": syncs}])
}

/// A lamp that a switch in the world turns on and off; each time it blinks twice.
fn lamp() -> Program {
    let blinks = repeat(json!([
        {"sync": {"wait": ["switch"]}},
        {"sync": {"request": ["blink"]}},
        {"sync": {"request": ["blink"]}},
    ]));
    plain([("lamp", blinks), ("hand", repeat(json!([{"sync": {"request": ["switch"]}}])))])
}

fn traces_of(report: &skein_bp::verify::Report) -> Vec<String> {
    report.verdict.iter().flat_map(|violation| &violation.trace).map(ToString::to_string).collect()
}

#[test]
fn the_world_acts_when_the_program_rests() {
    let twice_in_a_row = json!([
        {"sync": {"wait": ["switch"]}},
        {"sync": {"wait": ["switch", "blink"]}},
        {"on": {"switch": [{"assert_fail": "switched while it was at it"}]}},
    ]);
    let mut program = lamp();
    let watch: Vec<skein_bp::script::Op> = serde_json::from_value(twice_in_a_row).unwrap();
    program.add("watch", skein_bp::script::Script::new(&watch).unwrap());
    let waits = Verifier::new(program.clone()).world(["hand"]).inspect([Inspection::FailedAssertion]).run();
    assert_eq!(waits.verdict, None, "{waits}");
    // As one of the program, it may cut in.
    let cuts_in = Verifier::new(program).inspect([Inspection::FailedAssertion]).run();
    assert_eq!(traces_of(&cuts_in), ["switch", "switch"], "{cuts_in}");
}

#[test]
fn a_burst_is_counted_and_one_without_end_is_found() {
    let settles = Inspection::Unsettled;
    let report = Verifier::new(lamp()).world(["hand"]).inspect([settles.clone()]).run();
    assert_eq!((report.verdict, report.longest_burst), (None, Some(2)));
    let endless = plain([
        (
            "lamp",
            json!([{"sync": {"wait": ["switch"]}}, {"repeat": "forever", "do": [{"sync": {"request": ["blink"]}}]}]),
        ),
        ("hand", repeat(json!([{"sync": {"request": ["switch"]}}]))),
    ]);
    let violation = Verifier::new(endless).world(["hand"]).inspect([settles]).run().verdict.unwrap();
    assert_eq!(violation.kind, ViolationKind::Unsettled);
    assert_eq!(violation.violators, ["lamp".into()]);
    assert_eq!((violation.stem(), violation.cycle()), (&["switch".into()][..], Some(&["blink".into()][..])));
}

#[test]
fn what_comes_out_of_reach_is_found_with_the_way_there() {
    let door = json!([{"repeat": 2, "do": [{"sync": {"wait": ["open"], "block": ["pass"]}}, {"sync": {"wait": ["shut"]}}]},
        {"sync": {"block": ["pass"]}}]);
    let people = repeat(json!([{"sync": {"request": ["open", "shut", "pass"]}}]));
    let open = |view: &skein_bp::verify::View<'_>| {
        !view.bids().any(|(_, bid)| bid.blocks().contains(&Event::new("pass")))
    };
    let program = plain([("door", door), ("people", people)]);
    let report = Verifier::new(program.clone()).inspect([]).always_within_reach("an open door", open).run();
    assert_eq!(traces_of(&report), ["open", "shut", "open", "shut"], "{report}");
    assert_eq!(report.verdict.unwrap().kind, ViolationKind::OutOfReach { goal: "an open door".to_owned() });
    // What was not looked at might lead there.
    let bounded =
        Verifier::new(program).inspect([]).always_within_reach("an open door", open).most_states(4).run();
    assert_eq!(bounded.verdict, None, "{bounded}");
}

#[test]
fn a_bid_that_must_not_be_is_found_where_it_is_first_stated() {
    let grumpy = json!([{"sync": {"wait": ["switch"]}}, {"sync": {"request": ["blink"], "block": ["help"]}}]);
    let hand = repeat(json!([{"sync": {"request": ["switch"]}}]));
    let help = |_: &str, bid: &Bid| match bid.blocks().contains(&"help".into()) {
        true => Err("help is blocked".to_owned()),
        false => Ok(()),
    };
    let program = plain([("grumpy", grumpy), ("hand", hand)]);
    let violation = Verifier::new(program).every_bid("help", help).run().verdict.unwrap();
    assert_eq!(violation.violators, ["grumpy".into()]);
    assert_eq!(violation.trace, ["switch".into()]);
}

#[test]
fn deadlines_at_rest_wait_until_nothing_else_can_happen() {
    let timed = json!([
        {"sync": {"wait": ["switch"]}},
        {"within_s": 1.0, "do": [{"sync": {"request": ["blink"]}}]},
        {"sync": {"request": ["over"]}},
    ]);
    let hand = json!([{"sync": {"request": ["switch"]}}]);
    let traces = |timers| {
        let graph =
            Verifier::new(plain([("lamp", timed.clone()), ("hand", hand.clone())])).timers(timers).graph();
        graph.edges.into_iter().filter(|edge| edge.event.name() == "timeout").count()
    };
    assert_eq!((traces(Timers::AtRest), traces(Timers::AnyTime)), (0, 1));
}

#[test]
fn what_was_met_is_told() {
    let (_, coverage) = Verifier::new(lamp()).world(["hand"]).run_and_cover();
    assert_eq!(coverage.happened, ["blink".into(), "switch".into()].into());
    let lamp = &coverage.bthreads["lamp"];
    assert_eq!((lamp.states, lamp.bids.len(), lamp.timed_out), (3, 2, false));
}
