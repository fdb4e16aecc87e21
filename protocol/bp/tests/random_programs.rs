//! Properties of whole runs, on programs made at random.

use std::collections::BTreeMap;

use crate::recipes::{bid, event};
use crate::support::START;
use proptest::prelude::*;
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Event, EventSet, Origin, Program, ProgramConfig, Selection, Strategy as Selecting};

const STEPS: usize = 60;

/// B-threads that go round a few bids, and external events.
#[derive(Clone, Debug)]
struct Recipe {
    bthreads: Vec<Vec<Bid>>,
    externals: Vec<Event>,
    strategy: Selecting,
}

impl Recipe {
    fn program(&self, seed: u64) -> Program {
        let mut program =
            Program::new(ProgramConfig { strategy: self.strategy, seed, ..ProgramConfig::default() });
        for (at, bids) in self.bthreads.iter().enumerate() {
            let body: Vec<Op> = bids.iter().cloned().map(Op::Sync).collect();
            // Half of them end and half go on, so that places in the program are freed and used.
            let body = if at % 2 == 0 { Op::forever(body) } else { Op::repeat(3, body) };
            program.add(format!("t{at:02}"), Script::new(&[body]).unwrap());
        }
        self.externals.iter().for_each(|event| program.enqueue(event));
        program
    }
}

fn recipe() -> impl Strategy<Value = Recipe> {
    use Selecting::{BThreadPriority, Ordered, Simple, SyncPriority};
    let bthreads = prop::collection::vec(prop::collection::vec(bid(), 1..4), 1..7);
    let strategy = prop_oneof![Just(Simple), Just(Ordered), Just(SyncPriority), Just(BThreadPriority)];
    (bthreads, prop::collection::vec(event(), 0..4), strategy)
        .prop_map(|(bthreads, externals, strategy)| Recipe { bthreads, externals, strategy })
}

/// Every bid on the table, by name.
fn table(program: &Program) -> BTreeMap<String, Bid> {
    program.bids().map(|(name, bid, _)| (name.to_owned(), bid.clone())).collect()
}

fn is_blocked(table: &BTreeMap<String, Bid>, event: &Event) -> bool {
    table.values().any(|bid| bid.blocks().contains(event))
}

/// What the rules say by looking at every bid, without any index.
fn naive_selectable(table: &BTreeMap<String, Bid>, strategy: Selecting) -> Vec<Event> {
    let mut offers: Vec<(Option<i32>, Event)> = Vec::new();
    for bid in table.values() {
        let mut open: Vec<&Event> = bid.requests().iter().filter(|event| !is_blocked(table, event)).collect();
        if strategy == Selecting::Ordered {
            open.truncate(1);
        }
        let rank = if strategy == Selecting::SyncPriority { bid.given_priority() } else { None };
        offers.extend(open.into_iter().map(|event| (rank, event.clone())));
    }
    let best = offers.iter().map(|(rank, _)| *rank).max();
    let mut events: Vec<Event> =
        offers.into_iter().filter(|(rank, _)| Some(*rank) == best).map(|(_, event)| event).collect();
    events.sort();
    events.dedup();
    events
}

fn names(table: &BTreeMap<String, Bid>, wanted: impl Fn(&Bid) -> bool) -> Vec<String> {
    table.iter().filter(|(_, bid)| wanted(bid)).map(|(name, _)| name.clone()).collect()
}

fn check_step(
    before: &BTreeMap<String, Bid>,
    selection: &Selection,
    selectable: &[Event],
) -> Result<(), TestCaseError> {
    let event = &selection.event;
    prop_assert!(!is_blocked(before, event), "{} is blocked", event);
    prop_assert!(
        selection.origin == Origin::External || selectable.contains(event),
        "{} is not selectable",
        event
    );
    prop_assert_eq!(selection.origin == Origin::External, selectable.is_empty());
    prop_assert_eq!(as_strings(&selection.requested_by), names(before, |bid| bid.requests().contains(event)));
    prop_assert_eq!(
        as_strings(&selection.interrupted),
        names(before, |bid| bid.interrupts().contains(event))
    );
    let wakes = |bid: &Bid| bid.requests().contains(event) || bid.waits().contains(event);
    prop_assert_eq!(
        as_strings(&selection.resumed),
        names(before, |bid| wakes(bid) && !bid.interrupts().contains(event))
    );
    Ok(())
}

fn as_strings(names: &[std::sync::Arc<str>]) -> Vec<String> {
    names.iter().map(|name| name.to_string()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn indexed_selection_equals_a_naive_scan(recipe in recipe(), seed: u64) {
        let mut program = recipe.program(seed);
        for _ in 0..STEPS {
            program.synchronise(START).unwrap();
            let before = table(&program);
            let selectable = naive_selectable(&before, recipe.strategy);
            let mut offered = program.selectable();
            offered.sort();
            if !selectable.is_empty() {
                prop_assert_eq!(&offered, &selectable);
            }
            match program.step(START).unwrap() {
                Some(selection) => check_step(&before, &selection, &selectable)?,
                None => {
                    prop_assert!(offered.is_empty() && selectable.is_empty());
                    let requested = before.values().any(|bid| !bid.requests().is_empty());
                    prop_assert_eq!(program.is_deadlocked(), requested);
                    break;
                }
            }
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_run_also_from_a_clone(recipe in recipe(), seed: u64, fork in 0..STEPS) {
        let mut one = recipe.program(seed);
        let mut other = recipe.program(seed);
        for at in 0..STEPS {
            if at == fork {
                other = one.clone();
            }
            prop_assert_eq!(one.step(START).unwrap(), other.step(START).unwrap());
            prop_assert_eq!(&one, &other);
            prop_assert_eq!(one.state_digest(), other.state_digest());
        }
    }

    #[test]
    fn every_selectable_event_can_be_chosen(recipe in recipe(), seed: u64) {
        let mut program = recipe.program(seed);
        for _ in 0..10 {
            program.synchronise(START).unwrap();
            for event in program.selectable() {
                prop_assert_eq!(program.clone().choose(&event, START).unwrap().event, event);
            }
            if program.step(START).unwrap().is_none() {
                break;
            }
        }
    }

    #[test]
    fn nobody_who_stays_selectable_is_passed_over_for_long(count in 2..8_usize, seed: u64, limit in 1..20_u32) {
        let mut program = Program::new(ProgramConfig { seed, passed_over_limit: Some(limit), ..ProgramConfig::default() });
        for at in 0..count {
            // They restate their requests at every event, and still do not lose their place.
            let bid = Bid::new().request(format!("e{at}")).wait_for(EventSet::All);
            program.add(format!("t{at}"), Script::new(&[Op::forever([Op::Sync(bid.clone()), Op::Sync(bid)])]).unwrap());
        }
        let mut last = vec![0; count];
        for now in 1..500_usize {
            let event = program.step(START).unwrap().unwrap().event;
            let at: usize = event.name()[1..].parse().unwrap();
            last[at] = now;
            let longest = last.iter().map(|last| now - last).max().unwrap();
            prop_assert!(longest <= limit as usize + count, "passed over {} times", longest);
        }
    }
}

#[test]
fn every_order_of_independent_events_is_reached() {
    let run = |seed| {
        let mut program = Program::new(ProgramConfig { seed, ..ProgramConfig::default() });
        for event in ["a", "b", "c", "d"] {
            program.add(event, Script::new(&[Op::Sync(Bid::new().request(event))]).unwrap());
        }
        crate::support::superstep(&mut program)
    };
    let orders: std::collections::BTreeSet<_> = (0..500).map(run).collect();
    assert_eq!(orders.len(), 24);
}

#[test]
fn a_run_does_not_depend_on_the_order_in_which_equals_were_added() {
    let run = |order: [&str; 3]| {
        let mut program = Program::new(ProgramConfig::default());
        for event in order {
            program.add(event, Script::new(&[Op::Sync(Bid::new().request(event))]).unwrap());
        }
        crate::support::superstep(&mut program)
    };
    assert_eq!(run(["a", "b", "c"]), run(["c", "a", "b"]));
}

#[test]
fn spawning_without_end_over_time_frees_what_has_ended() {
    let child = Op::Spawn(skein_bp::script::Spawn::Inline(skein_bp::script::ScriptSource {
        name: "child".to_owned(),
        body: vec![Op::Sync(Bid::new().request("child").wait_for("never"))],
        priority: None,
    }));
    let mut program = Program::new(ProgramConfig::default());
    program
        .add("parent", Script::new(&[Op::forever([child, Op::Sync(Bid::new().wait_for("child"))])]).unwrap());
    for step in 0..5000 {
        assert_eq!(program.step(START).unwrap().unwrap().requested_by[..], ["child".into()], "step {step}");
    }
    assert_eq!(
        program.bids().map(|(name, _, sync)| (name, sync)).collect::<Vec<_>>(),
        [("child", 5001), ("parent", 5001)]
    );
}
