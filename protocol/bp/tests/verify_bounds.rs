//! What a verification says of its bounds, deadlines and progress, and the graph that it draws.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use crate::support::plain;
use serde_json::json;
use skein_bp::script::{Op, Script};
use skein_bp::verify::{Inspection, Omission, Search, Timers, Verifier, ViolationKind};
use skein_bp::{Bid, Event, Program, ProgramConfig};

/// Counts to `rounds` and fails.
fn counter(rounds: u32) -> Program {
    plain([(
        "counter",
        json!([{"repeat": rounds, "do": [{"sync": {"request": ["tick"]}}]}, {"assert_fail": "counted"}]),
    )])
}

#[test]
fn a_bound_that_was_reached_is_reported() {
    for order in [Search::BreadthFirst, Search::DepthFirst] {
        let report = Verifier::new(counter(100)).order(order).most_states(10).run();
        assert_eq!(report.not_covered, [Omission::StateBound { most_states: 10, unexplored: 1 }]);
        assert!(report.verdict.is_none() && report.states == 10);
        assert!(
            report.to_string().contains("not covered: the search ended at the bound of 10 states"),
            "{report}"
        );

        let report = Verifier::new(counter(100)).order(order).deepest(99).run();
        assert_eq!(report.not_covered, [Omission::DepthBound { deepest: 99, moves: 1 }]);
        assert!(report.verdict.is_none() && report.depth == 99);

        let report = Verifier::new(counter(100)).order(order).deepest(100).run();
        assert!(report.verdict.is_some() && report.is_complete(), "{report}");
    }
}

#[test]
fn a_search_that_ends_at_a_violation_says_what_it_has_not_seen() {
    let failing = json!([{"sync": {"request": ["a"]}}, {"assert_fail": "a"}]);
    let other = json!([{"repeat": 5, "do": [{"sync": {"request": ["b"]}}]}]);
    let report = Verifier::new(plain([("fails", failing), ("other", other)])).run();
    assert!(matches!(report.not_covered[..], [Omission::StoppedAtViolation { unexplored: 1.. }]), "{report}");
    assert!(report.to_string().starts_with("failed assertion: a (fails)\n    1 a\n"), "{report}");
}

#[test]
fn progress_is_told_along_a_long_search() {
    let told = Rc::new(Cell::new(0));
    let note = told.clone();
    let report = Verifier::new(counter(100_000))
        .on_progress(move |progress| {
            assert!(progress.states > note.get() && progress.edges > 0, "{progress}");
            note.set(progress.states);
        })
        .run();
    assert!(told.get() > 60_000 && report.states == 100_001, "{report}");
}

/// A watchdog that has to be fed, and a feeder that may be slow.
fn watchdog() -> Program {
    let mut program = Program::new(ProgramConfig::default());
    let deadline = Duration::from_secs(5);
    let watch = Script::new(&[
        Op::Sync(Bid::new().wait_for("food").deadline(deadline)),
        Op::On([("timeout".to_owned(), vec![Op::AssertFail("hungry".to_owned())])].into()),
    ]);
    program.add("watchdog", watch.unwrap());
    program.add("feeder", Script::new(&[Op::Sync(Bid::new().request("food"))]).unwrap());
    program
}

#[test]
fn deadlines_fire_at_any_time_or_never_and_then_that_is_reported() {
    let never = Verifier::new(watchdog()).run();
    assert_eq!(never.verdict, None);
    assert!(
        never.to_string().contains("not covered: the deadlines of watchdog, which never fire here"),
        "{never}"
    );

    let any_time = Verifier::new(watchdog()).timers(Timers::AnyTime).run();
    let violation = any_time.verdict.unwrap();
    assert_eq!(violation.kind, ViolationKind::FailedAssertion { message: "hungry".into() });
    assert_eq!(violation.trace, [Event::timeout().with("bthread", "watchdog")]);
}

#[test]
fn a_program_that_waits_for_a_deadline_is_not_deadlocked() {
    let program = |deadline: Option<u64>| {
        let bid = Bid::new().request("a").block("a").hot();
        let bid = deadline.map_or(bid.clone(), |at| bid.deadline(Duration::from_secs(at)));
        let mut program = Program::new(ProgramConfig::default());
        program.add("t", Script::new(&[Op::Sync(bid)]).unwrap());
        Verifier::new(program)
    };
    for (inspection, kind) in [
        (Inspection::Deadlock, ViolationKind::Deadlock),
        (Inspection::HotTermination, ViolationKind::HotTermination),
    ] {
        let found = program(None).inspect([inspection.clone()]).run().verdict;
        assert_eq!(found.map(|violation| violation.kind), Some(kind));
        assert_eq!(program(Some(1)).inspect([inspection]).run().verdict, None);
    }
    let fired = program(Some(1)).timers(Timers::AnyTime).run();
    assert!(fired.verdict.is_none() && fired.is_complete() && fired.states == 2, "{fired}");
}

#[test]
fn where_external_events_get_their_turn_they_may_come_at_any_time() {
    let externals_after = Some(16);
    let run = |externals_after| {
        let config = ProgramConfig { externals_after, ..ProgramConfig::default() };
        let endless = json!([{"repeat": "forever", "do": [{"sync": {"request": ["own"]}}]}]);
        let waiting = json!([{"sync": {"wait": "far"}}, {"assert_fail": "came"}]);
        let mut program = crate::support::program(config, [("endless", endless), ("waiting", waiting)]);
        program.enqueue("far");
        Verifier::new(program).run().verdict.is_some()
    };
    assert!(run(externals_after));
    assert!(!run(None), "the endless one never lets it in");
}

#[test]
fn a_daemon_is_fed_when_it_rests() {
    let fed = || ["x", "y"].map(Event::new);
    let waiting =
        |times: u32| json!([{"daemon": true}, {"repeat": times, "do": [{"sync": {"wait": {"all": true}}}]}]);
    let report = Verifier::new(plain([("w", waiting(3))])).feed(fed()).run();
    assert_eq!((report.states, report.edges), (3, 2));
    // What is blocked stays in the queue, and the next one is taken.
    let blocked = json!([{"daemon": true}, {"sync": {"wait": {"all": true}, "block": "x"}}]);
    let report = Verifier::new(plain([("w", blocked)])).feed(fed()).run();
    assert_eq!((report.states, report.edges), (2, 1));
}

fn two_ways() -> Program {
    plain([(
        "t",
        json!([
            {"sync": {"request": ["say \"hi\"", {"name": "b", "data": {"k": 1}}], "hot": true}},
            {"on": {"b": [{"assert_fail": "b\\c"}]}},
        ]),
    )])
}

#[test]
fn the_graph_is_drawn() {
    let dot = Verifier::new(two_ways()).graph().to_dot();
    let expected = r#"digraph states {
  node [shape=circle];
  0 [tooltip="t: {\"at\":0,\"on_interrupt\":null,\"rounds\":[]}", color=orange];
  1 [tooltip="", shape=doublecircle];
  2 [tooltip="t: b\\c", shape=doublecircle, color=red];
  0 -> 1 [label="say \"hi\""];
  0 -> 2 [label="b{k: 1}"];
}
"#;
    assert_eq!(dot, expected);
}

#[test]
fn the_graph_is_written_as_json() {
    let graph = Verifier::new(two_ways()).graph().to_json().unwrap();
    let expected = json!({
        "states": [
            {"bthreads": [["t", {"at": 0, "on_interrupt": null, "rounds": []}]], "hot": ["t"]},
            {"bthreads": []},
            {"bthreads": [], "failure": "t: b\\c"},
        ],
        "edges": [
            {"from": 0, "event": "say \"hi\"", "to": 1},
            {"from": 0, "event": {"name": "b", "data": {"k": 1}}, "to": 2},
        ],
    });
    assert_eq!(graph, expected);
}

#[test]
fn a_graph_beyond_its_bound_says_so() {
    let graph = Verifier::new(counter(100)).most_states(5).graph();
    assert_eq!((graph.states.len(), graph.edges.len(), graph.not_covered.len()), (5, 4, 1));
}
