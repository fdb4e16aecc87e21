//! Rule 5: interrupts come first.

use crate::support::{START, plain, superstep};
use serde_json::json;

#[test]
fn an_interrupted_bthread_ends_even_if_it_waits_for_the_event_too() {
    let mut program = plain([
        ("asks", json!([{"sync": {"request": ["boom"]}}])),
        (
            "victim",
            json!([{"sync": {"wait": "boom", "interrupt": "boom"}}, {"sync": {"request": ["never"]}}]),
        ),
    ]);
    let selections = program.superstep(START).unwrap();
    assert_eq!(selections.len(), 1);
    assert_eq!(selections[0].interrupted[..], ["victim".into()]);
    assert_eq!(selections[0].resumed[..], ["asks".into()]);
    assert!(!program.has_bthreads());
}

#[test]
fn one_whose_own_request_interrupts_it_ends_and_is_named_as_requester() {
    let mut program = plain([(
        "self",
        json!([{"sync": {"request": ["a"], "interrupt": "a"}}, {"sync": {"request": ["b"]}}]),
    )]);
    let selections = program.superstep(START).unwrap();
    assert_eq!(selections.len(), 1);
    assert_eq!(
        (&selections[0].requested_by[..], &selections[0].interrupted[..]),
        (&["self".into()][..], &["self".into()][..])
    );
}

#[test]
fn handlers_enqueue_before_resumed_bthreads_do() {
    let mut program = plain([
        (
            "asks",
            json!([{"sync": {"request": ["boom"]}}, {"enqueue": ["second"]}, {"sync": {"wait": "never"}}]),
        ),
        ("victim", json!([{"on_interrupt_enqueue": ["first", "$event"]}, {"sync": {"interrupt": "boom"}}])),
    ]);
    assert_eq!(superstep(&mut program), ["boom", "first", "boom", "second"]);
}

#[test]
fn the_blocks_of_an_interrupted_bthread_are_gone() {
    let mut program = plain([
        ("asks", json!([{"sync": {"request": ["boom"]}}, {"sync": {"request": ["after"]}}])),
        ("victim", json!([{"sync": {"interrupt": "boom", "block": "after"}}])),
    ]);
    assert_eq!(superstep(&mut program), ["boom", "after"]);
}
