//! Rules 1 to 7: which event is selected, and whom it resumes.

use crate::support::{START, names, plain, program, script, superstep};
use serde_json::json;
use skein_bp::{Bid, Event, Program, ProgramConfig, Strategy};

fn with(strategy: Strategy) -> ProgramConfig {
    ProgramConfig { strategy, ..ProgramConfig::default() }
}

/// What may be selected before anything has happened.
fn selectable(mut program: Program) -> Vec<String> {
    program.synchronise(START).unwrap();
    let mut names: Vec<String> = program.selectable().iter().map(Event::to_string).collect();
    names.sort();
    names
}

#[test]
fn a_requested_event_resumes_all_who_requested_or_wait_for_it() {
    let mut program = plain([
        ("asks", json!([{"sync": {"request": ["go"]}}])),
        ("asks too", json!([{"sync": {"request": ["go"]}}])),
        ("waits", json!([{"sync": {"wait": "go"}}])),
        ("elsewhere", json!([{"sync": {"wait": "stop"}}])),
    ]);
    let selections = program.superstep(START).unwrap();
    assert_eq!(names(&selections), ["go"]);
    assert_eq!(selections[0].requested_by[..], ["asks".into(), "asks too".into()]);
    assert_eq!(selections[0].resumed[..], ["asks".into(), "asks too".into(), "waits".into()]);
    assert_eq!(program.bids().map(|(name, ..)| name).collect::<Vec<_>>(), ["elsewhere"]);
}

#[test]
fn bthreads_that_go_round_are_found_by_their_present_bid_only() {
    // More loops than the index remembers replaced bids.
    let round = |n: usize| {
        let syncs = (n..n + 3)
            .map(|k| json!({"sync": {"wait": format!("e{}", k % 5), "block": format!("b{}", k % 7)}}));
        json!([{"repeat": "forever", "do": syncs.collect::<Vec<_>>()}])
    };
    let mut program = plain([]);
    for n in 0..30 {
        program.add(format!("round {n}"), script(round(n)));
    }
    program.add(
        "asks",
        script(json!([{"repeat": "forever", "do": [{"sync": {"request": ["b0", "b3"], "wait": "e0"}}]}])),
    );
    let mut happened = 0;
    for step in 0..500 {
        program.enqueue(format!("e{}", (step * 3 + step / 7) % 5));
        program.synchronise(START).unwrap();
        let bids: Vec<_> = program.bids().map(|(name, bid, _)| (name.to_owned(), bid.clone())).collect();
        let blocked = |event: &str| bids.iter().any(|(_, bid)| bid.blocks().contains(&event.into()));
        let free: Vec<&str> = ["b0", "b3"].into_iter().filter(|event| !blocked(event)).collect();
        let Some(selection) = program.step(START).unwrap() else {
            panic!("an external event is always there")
        };
        if !free.is_empty() {
            assert!(free.contains(&selection.event.name()), "{step}: {}", selection.event);
        }
        let concerns =
            |bid: &Bid| bid.waits().contains(&selection.event) || bid.requests().contains(&selection.event);
        let mut resumed: Vec<String> = selection.resumed.iter().map(|name| name.to_string()).collect();
        resumed.sort();
        let concerned = bids.iter().filter(|(_, bid)| concerns(bid)).map(|(name, _)| name.clone());
        assert_eq!(resumed, concerned.collect::<Vec<_>>(), "{step}: {}", selection.event);
        happened += usize::from(!resumed.is_empty());
    }
    assert!(happened > 300, "hardly anybody was woken: {happened}");
}

#[test]
fn a_blocked_event_is_not_selected_until_the_block_is_gone() {
    let mut program = plain([
        ("taker", json!([{"sync": {"request": ["take off"]}}])),
        ("check", json!([{"sync": {"request": ["checked"], "block": "take off"}}])),
    ]);
    assert_eq!(superstep(&mut program), ["checked", "take off"]);
}

#[test]
fn who_requests_and_blocks_the_same_event_blocks_it() {
    let mut program = plain([("torn", json!([{"sync": {"request": ["a", "b"], "block": "a"}}]))]);
    assert_eq!(superstep(&mut program), ["b"]);
}

#[test]
fn equality_is_name_and_data() {
    let mut program = plain([
        ("asks", json!([{"sync": {"request": [{"name": "e", "data": {"k": 1}}]}}])),
        (
            "blocks another",
            json!([{"sync": {"block": ["e", {"name": "e", "data": {"k": 2}}, {"name": "e", "data": {"k": "1"}}]}}]),
        ),
    ]);
    assert_eq!(superstep(&mut program), ["e{k: 1}"]);
    let mut program = plain([
        ("asks", json!([{"sync": {"request": [{"name": "e", "data": {"k": 1}}]}}])),
        ("blocks the same", json!([{"sync": {"block": {"name": "e", "data": {"k": 1.0}}}}])),
    ]);
    assert!(superstep(&mut program).is_empty(), "numbers compare as numbers");
}

#[test]
fn all_bthreads_reach_a_synchronisation_point_before_a_selection() {
    let mut program = plain([
        (
            "parent",
            json!([{"spawn": {"name": "child", "body": [{"sync": {"block": "a", "wait": "b"}}]}}, {"sync": {"request": ["a"]}}]),
        ),
        ("other", json!([{"sync": {"request": ["b"]}}])),
    ]);
    assert_eq!(superstep(&mut program), ["b", "a"]);
}

#[test]
fn every_request_of_a_bthread_counts_except_under_ordered() {
    let bthreads = || {
        [
            ("first", json!([{"sync": {"request": ["a", "b", "c"]}}])),
            ("second", json!([{"sync": {"request": ["c", "d"]}}])),
            ("blocker", json!([{"sync": {"block": "a"}}])),
        ]
    };
    assert_eq!(selectable(program(with(Strategy::Simple), bthreads())), ["b", "c", "d"]);
    assert_eq!(selectable(program(with(Strategy::Ordered), bthreads())), ["b", "c"]);
}

#[test]
fn the_greatest_priority_among_unblocked_bids_wins() {
    let bthreads = || {
        [
            ("none", json!([{"sync": {"request": ["none"]}}])),
            ("least", json!([{"sync": {"request": ["least"], "prio": i32::MIN}}])),
            ("high", json!([{"sync": {"request": ["high"], "prio": 7}}])),
            ("also high", json!([{"sync": {"request": ["also high"], "prio": 7}}])),
            ("blocked", json!([{"sync": {"request": ["blocked"], "prio": 9}}])),
        ]
    };
    let blocker = json!([{"sync": {"block": "blocked"}}]);
    let mut flown = program(with(Strategy::SyncPriority), bthreads());
    flown.add("blocker", crate::support::script(blocker));
    assert_eq!(selectable(flown.clone()), ["also high", "high"]);
    let order = superstep(&mut flown);
    assert_eq!(order[2..], ["least", "none"], "no priority is lower than the least one");
}

#[test]
fn an_event_has_the_priority_of_the_best_bid_that_requests_it() {
    let mut program = program(
        with(Strategy::SyncPriority),
        [
            ("low", json!([{"sync": {"request": ["shared"], "prio": 1}}])),
            ("middle", json!([{"sync": {"request": ["other"], "prio": 2}}])),
            ("high", json!([{"sync": {"request": ["shared"], "prio": 3}}])),
        ],
    );
    assert_eq!(superstep(&mut program), ["shared", "other"]);
}

#[test]
fn bthread_priority_goes_by_bthread_and_ignores_bids() {
    use skein_bp::script::{Library, Op, Script};
    use skein_bp::{Bid, DEFAULT_BTHREAD_PRIORITY};
    let mut program = Program::new(with(Strategy::BThreadPriority));
    let script = |event: &str, priority: Option<i32>| {
        let ops = [Op::Sync(Bid::new().request(event).priority(100 - priority.unwrap_or(0)))];
        Script::with_library(&ops, priority, &Library::default()).unwrap()
    };
    program.add("a", script("low", Some(DEFAULT_BTHREAD_PRIORITY - 1)));
    program.add("b", script("default", None));
    program.add("c", script("high", Some(3)));
    assert_eq!(superstep(&mut program), ["high", "default", "low"]);
}

#[test]
fn deadlock_is_a_request_that_nothing_allows() {
    let deadlocked = |bthreads| {
        let mut program: Program = plain::<2>(bthreads);
        program.superstep(START).unwrap();
        program.is_deadlocked()
    };
    let blocker = json!([{"sync": {"block": "a"}}]);
    assert!(deadlocked([("asks", json!([{"sync": {"request": ["a"]}}])), ("blocks", blocker.clone())]));
    assert!(!deadlocked([("waits", json!([{"sync": {"wait": "a"}}])), ("blocks", blocker)]), "pure waiting");
    assert!(!deadlocked([("ends", json!([])), ("ends too", json!([]))]), "nothing left");
}

#[test]
fn a_failed_assertion_stops_the_program_and_names_the_bthread() {
    let mut program = plain([
        ("guard", json!([{"sync": {"wait": "bad"}}, {"assert_fail": "bad happened"}])),
        ("doer", json!([{"repeat": "forever", "do": [{"sync": {"request": ["bad"]}}]}])),
    ]);
    assert_eq!(superstep(&mut program), ["bad"]);
    assert_eq!(program.failed(), Some(("guard", "bad happened")));
    let error = program.step(START).unwrap_err().to_string();
    assert_eq!(error, "b-thread `guard` failed: bad happened");
}

#[test]
fn a_superstep_that_does_not_settle_names_the_bthreads() {
    let config = ProgramConfig { settle_limit: Some(50), ..ProgramConfig::default() };
    let mut program = program(
        config,
        [
            ("busy", json!([{"repeat": "forever", "do": [{"sync": {"request": ["again"]}}]}])),
            ("once", json!([{"sync": {"request": ["once"]}}])),
        ],
    );
    match program.superstep(START) {
        Err(skein_bp::ProgramError::Unsettled { limit: 50, bthreads, selections }) => {
            assert_eq!(bthreads, ["busy".into()]);
            assert_eq!(selections.len(), 51);
        }
        other => panic!("expected Unsettled, got {other:?}"),
    }
}

#[test]
fn a_superstep_of_exactly_the_limit_settles() {
    let config = ProgramConfig { settle_limit: Some(50), ..ProgramConfig::default() };
    let mut program =
        program(config, [("busy", json!([{"repeat": 50, "do": [{"sync": {"request": ["a"]}}]}]))]);
    assert_eq!(program.superstep(START).unwrap().len(), 50);
}

#[test]
fn choose_takes_what_is_selectable_and_nothing_else() {
    let mut program = plain([("asks", json!([{"sync": {"request": ["a", "b"], "block": "b"}}]))]);
    let error = program.choose(&"b".into(), START).unwrap_err().to_string();
    assert_eq!(error, "`b` is not selectable now; selectable are [a]");
    assert_eq!(program.choose(&"a".into(), START).unwrap().resumed[..], ["asks".into()]);
}

#[test]
fn a_name_that_is_taken_gets_a_number_and_one_that_is_free_again_goes_on_counting() {
    let mut program = plain([]);
    let once = || crate::support::script(json!([{"sync": {"request": ["a"]}}, {"sync": {"wait": "b"}}]));
    assert_eq!(&*program.add("t", once()), "t");
    assert_eq!(&*program.add("t", once()), "t~2");
    superstep(&mut program);
    assert_eq!(
        program.bids().map(|(name, _, sync)| (name, sync)).collect::<Vec<_>>(),
        [("t", 2), ("t~2", 2)]
    );
    program.enqueue("b");
    superstep(&mut program);
    assert!(!program.has_bthreads());
    assert_eq!(&*program.add("t", once()), "t");
    program.synchronise(START).unwrap();
    assert_eq!(program.bids().map(|(name, _, sync)| (name, sync)).collect::<Vec<_>>(), [("t", 3)]);
}

#[test]
fn the_revision_changes_when_a_bid_does() {
    let mut program = plain([("asks", json!([{"repeat": 2, "do": [{"sync": {"request": ["a"]}}]}]))]);
    program.synchronise(START).unwrap();
    let mut revisions = vec![program.revision()];
    while program.step(START).unwrap().is_some() {
        revisions.push(program.revision());
    }
    assert_eq!(program.step(START).unwrap(), None);
    assert_eq!(revisions.len(), 3);
    assert!(revisions.is_sorted_by(|a, b| a < b), "{revisions:?}");
    assert_eq!(program.revision(), revisions[2], "nothing happened");
}

#[test]
fn a_selection_says_at_which_priority_it_went_before_what() {
    let body = |request: &str, priority: i32| json!([{"sync": {"request": [request], "prio": priority}}]);
    let config = ProgramConfig { rivals: 2, ..with(Strategy::SyncPriority) };
    let mut program = program(
        config,
        [
            ("battery", body("land", 50)),
            ("mission", body("go", 10)),
            ("navigation", body("advance", 60)),
            ("hold", json!([{"sync": {"block": "advance", "wait": "land"}}])),
            ("one too many", body("z", 1)),
        ],
    );
    let selections = program.superstep(START).unwrap();
    let first = &selections[0];
    assert_eq!((first.event.name(), first.priority), ("land", Some(50)));
    let rivals: Vec<String> = first.rivals.iter().map(ToString::to_string).collect();
    assert_eq!(rivals, ["go by mission (priority 10)", "advance by navigation (blocked)"]);
    assert_eq!(selections.last().map(|last| last.rivals.len()), Some(0));
}
