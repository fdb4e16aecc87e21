//! Rule 4: external events.

use crate::support::{START, plain, program, superstep};
use serde_json::json;
use skein_bp::{Origin, ProgramConfig};

#[test]
fn an_external_event_waits_until_nothing_internal_is_selectable() {
    let mut program = plain([(
        "busy",
        json!([{"repeat": 3, "do": [{"sync": {"request": ["in"]}}]}, {"sync": {"wait": "out"}}]),
    )]);
    program.enqueue("out");
    assert_eq!(superstep(&mut program), ["in", "in", "in", "out"]);
}

#[test]
fn a_blocked_one_stays_and_the_next_is_taken() {
    let mut program =
        plain([("picky", json!([{"sync": {"wait": "b", "block": "a"}}, {"sync": {"wait": "c"}}]))]);
    program.enqueue("a");
    program.enqueue("b");
    assert_eq!(superstep(&mut program), ["b", "a"]);
    assert!(program.external_queue().next().is_none());
}

#[test]
fn one_that_nobody_waits_for_is_consumed_and_reported() {
    let mut program = plain([("waits", json!([{"sync": {"wait": "a"}}]))]);
    program.enqueue("x");
    let selections = program.superstep(START).unwrap();
    assert_eq!(selections[0].event, "x".into());
    assert_eq!(selections[0].origin, Origin::External);
    assert!(selections[0].resumed.is_empty());
    assert_eq!(program.external_queue().len(), 0);
}

#[test]
fn the_queue_is_left_alone_when_no_bthread_lives() {
    let mut program = plain([("ends", json!([{"sync": {"request": ["a"]}}]))]);
    program.enqueue("x");
    assert_eq!(superstep(&mut program), ["a"]);
    assert_eq!(program.external_queue().len(), 1);
}

#[test]
fn an_external_event_gets_its_turn_after_so_many_internal_ones() {
    let config = ProgramConfig { externals_after: Some(4), ..ProgramConfig::default() };
    let busy = json!([{"repeat": 12, "do": [{"sync": {"request": ["in"]}}]}, {"sync": {}}]);
    let mut program = program(config, [("busy", busy)]);
    program.enqueue("x");
    program.enqueue("y");
    let order = superstep(&mut program).concat();
    assert_eq!(order, "inininin".to_owned() + "x" + "inininin" + "y" + "inininin");
}

#[test]
fn internal_events_before_the_external_one_came_do_not_count() {
    let config = ProgramConfig { externals_after: Some(2), ..ProgramConfig::default() };
    let mut program =
        program(config, [("busy", json!([{"repeat": "forever", "do": [{"sync": {"request": ["in"]}}]}]))]);
    let mut step = || program.step(START).unwrap().unwrap().event.to_string();
    assert_eq!([step(), step(), step()], ["in", "in", "in"]);
    program.enqueue("x");
    let mut step = || program.step(START).unwrap().unwrap().event.to_string();
    assert_eq!([step(), step(), step()], ["in", "in", "x"]);
}

#[test]
fn a_bthread_enqueues_behind_what_waits_already() {
    let mut program = plain([(
        "t",
        json!([{"sync": {"request": ["go"]}}, {"enqueue": ["b", "c"]}, {"sync": {"wait": "c"}}]),
    )]);
    program.enqueue("a");
    assert_eq!(superstep(&mut program), ["go", "a", "b", "c"]);
}

#[test]
fn an_internal_selection_leaves_an_equal_event_in_the_queue() {
    let mut program = plain([("t", json!([{"sync": {"request": ["a"]}}, {"sync": {"wait": "b"}}]))]);
    program.enqueue("a");
    assert_eq!(program.step(START).unwrap().unwrap().origin, Origin::Internal);
    assert_eq!(program.external_queue().len(), 1);
}
