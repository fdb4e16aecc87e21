//! What lets a channel join programs on several nodes: homes, proxies, occurrences.

use crate::support::{START, plain, program, superstep};
use serde_json::json;
use skein_bp::{Bid, Event, EventSet, Origin, Program, ProgramConfig, Strategy};

#[test]
fn only_events_of_the_home_are_selected() {
    let mut program = plain([(
        "asks",
        json!([{"sync": {"request": ["uav/2/go", "uav/1/go"]}}, {"sync": {"request": ["uav/2/go"]}}]),
    )]);
    program.set_home("uav/1/**");
    program.enqueue("uav/2/x");
    assert_eq!(superstep(&mut program), ["uav/1/go"]);
    let (_, bid, sync) = program.bids().next().unwrap();
    assert_eq!((bid.requests(), sync), (&["uav/2/go".into()][..], 2), "the remote request stays open");
    assert!(!program.is_deadlocked(), "it is up to another node");
}

#[test]
fn an_occurrence_happens_first_and_cannot_be_blocked() {
    let mut program = plain([
        ("asks", json!([{"sync": {"request": ["uav/1/local"]}}, {"sync": {"wait": "never"}}])),
        ("remote", json!([{"sync": {"request": ["uav/2/go"]}}])),
        ("waits", json!([{"sync": {"wait": {"any_data": "uav/2/go"}}}])),
        ("victim", json!([{"sync": {"interrupt": "uav/2/go"}}])),
        ("blocks", json!([{"sync": {"block": {"all": true}}}])),
    ]);
    program.set_home("uav/1/**");
    program.occurred("uav/2/go");
    let selections = program.superstep(START).unwrap();
    assert_eq!(selections.len(), 1);
    let first = &selections[0];
    assert_eq!((first.origin, first.event.name()), (Origin::Occurred, "uav/2/go"));
    assert_eq!(first.requested_by[..], ["remote".into()]);
    assert_eq!(first.resumed[..], ["remote".into(), "waits".into()]);
    assert_eq!(first.interrupted[..], ["victim".into()]);
}

#[test]
fn a_request_that_was_withdrawn_is_waited_for_until_the_next_synchronisation_point() {
    let mut program = plain([
        ("asks", json!([{"sync": {"request": ["go"]}}, {"sync": {"request": ["done"]}}])),
        ("others", json!([{"sync": {"wait": "now"}}, {"sync": {"request": ["go"]}}])),
    ]);
    program.synchronise(START).unwrap();
    program.withdraw_requests("asks");
    assert_eq!(superstep(&mut program), Vec::<String>::new());
    let (_, bid, sync) = program.bids().find(|(name, ..)| *name == "asks").unwrap();
    assert_eq!((bid.requests(), sync), (&[][..], 1), "it is where it was");
    program.enqueue("now");
    assert_eq!(superstep(&mut program), ["now", "go", "done"]);
}

#[test]
fn occurrences_keep_their_order() {
    let mut program = plain([("w", json!([{"sync": {"wait": "b"}}, {"assert_fail": "b"}]))]);
    program.occurred("a");
    program.occurred("b");
    assert_eq!(superstep(&mut program), ["a", "b"]);
    assert_eq!(program.failed(), Some(("w", "b")));
}

#[test]
fn a_proxy_requests_until_it_is_served() {
    let mut program = plain([("waits", json!([{"repeat": "forever", "do": [{"sync": {"wait": "a"}}]}]))]);
    program.put_proxy("uav/2#t", &Bid::new().request("a").block("b"));
    let selections = program.superstep(START).unwrap();
    assert_eq!(selections.len(), 1);
    assert_eq!(selections[0].requested_by[..], ["uav/2#t".into()]);
    assert_eq!(selections[0].resumed[..], ["waits".into()], "a proxy does not run here");
    assert_eq!(program.proxies().collect::<Vec<_>>(), [("uav/2#t", &Bid::new())]);
    program.put_proxy("uav/2#t", &Bid::new().request("a"));
    assert_eq!(superstep(&mut program), ["a"]);
}

#[test]
fn a_proxy_alone_keeps_a_home_going() {
    let mut program = plain([]);
    program.put_proxy("p", &Bid::new().request("a"));
    program.enqueue("x");
    assert_eq!(superstep(&mut program), ["a", "x"]);
}

#[test]
fn a_proxy_blocks_until_removed_and_that_is_no_deadlock() {
    let mut program = plain([("asks", json!([{"sync": {"request": ["a"]}}]))]);
    program.put_proxy("p", &Bid::new().block("a"));
    assert_eq!(superstep(&mut program), [""; 0]);
    assert!(!program.is_deadlocked(), "stalled");
    assert!(program.remove_proxy("p"));
    assert!(!program.remove_proxy("p"));
    assert_eq!(superstep(&mut program), ["a"]);
}

#[test]
fn a_proxy_cannot_block_what_is_protected() {
    let config = ProgramConfig { protected: EventSet::from("uav/1/land"), ..ProgramConfig::default() };
    let mut program =
        program(config, [("asks", json!([{"sync": {"request": ["uav/1/land", "uav/1/advance"]}}]))]);
    program.put_proxy("ground#hold", &Bid::new().block("uav/1/**"));
    assert_eq!(superstep(&mut program), ["uav/1/land"]);
}

#[test]
fn a_proxys_waits_interrupts_and_deadline_do_not_count() {
    let mut program = plain([("asks", json!([{"sync": {"request": ["a"]}}]))]);
    program.put_proxy("p", &Bid::new().wait_for("a").interrupt("a").deadline(START).block("z"));
    let selections = program.superstep(START).unwrap();
    assert!(selections[0].interrupted.is_empty());
    assert_eq!(program.next_deadline(), None);
    assert_eq!(program.proxies().next().unwrap().1, &Bid::new().block("z"));
}

#[test]
fn a_proxys_priority_counts() {
    let config = ProgramConfig { strategy: Strategy::SyncPriority, ..ProgramConfig::default() };
    let mut program = program(config, [("asks", json!([{"sync": {"request": ["low"], "prio": 1}}]))]);
    program.put_proxy("p", &Bid::new().request("high").priority(2));
    assert_eq!(superstep(&mut program), ["high", "low"]);
}

#[test]
fn proxies_do_not_touch_the_revision_or_the_bids() {
    let mut program = Program::new(ProgramConfig::default());
    let before = program.revision();
    program.put_proxy("p", &Bid::new().request(Event::new("a")));
    superstep(&mut program);
    assert_eq!((program.revision(), program.bids().count()), (before, 0));
}
