//! G1: a node sees a home's occurrences in order; a hole is repaired, or becomes a `gap`.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::swarm::{Requester, Swarm, hostile, name, program};
use skein_dbp::NodeName;

const FLEET: [&str; 3] = ["uav/1", "uav/2", "uav/3"];

/// Each home's stream as `observer` has seen it must go on from where it was: by one, or over a gap that it was told
/// of.
fn check_order(swarm: &Swarm) {
    let mut last: BTreeMap<(NodeName, u64, NodeName), u64> = BTreeMap::new();
    for seen in &swarm.seen {
        let happened = &seen.happened;
        if happened.home == seen.node {
            if happened.event.kind() == "gap" {
                let home = name(happened.event.text("home").unwrap());
                let from = happened.event.int("from").unwrap() as u64;
                let at = last.entry((seen.node.clone(), seen.incarnation, home)).or_default();
                assert_eq!(from, *at + 1, "a gap that does not begin after the last occurrence");
                *at = happened.event.int("to").unwrap() as u64;
            }
            continue;
        }
        let at = last.entry((seen.node.clone(), seen.incarnation, happened.home.clone())).or_default();
        assert_eq!(
            happened.seq,
            *at + 1,
            "{} saw {} of {} after {at}",
            seen.node,
            happened.seq,
            happened.home
        );
        *at = happened.seq;
    }
}

fn fleet(seed: u64) -> Swarm {
    let mut swarm = Swarm::new(&FLEET, hostile(), seed);
    for node in FLEET {
        let mut program = program(seed);
        program.add("talk", Requester::new(&format!("{node}/word"), 40, Duration::from_millis(60)));
        swarm.start(node, 1, program);
    }
    swarm
}

#[test]
fn order_holds_under_loss_repetition_and_reordering_and_nothing_stays_missing() {
    for seed in 0..20 {
        let mut swarm = fleet(seed);
        swarm.run(Duration::from_secs(8));
        check_order(&swarm);
        for node in FLEET {
            for home in FLEET {
                let words: Vec<_> = swarm
                    .saw(node, &format!("{home}/word"))
                    .map(|seen| seen.happened.event.int("n").unwrap())
                    .collect();
                assert_eq!(words, (1..=40).collect::<Vec<_>>(), "{node} of {home}, seed {seed}");
            }
            assert_eq!(swarm.saw(node, &format!("{node}/gap")).count(), 0);
        }
    }
}

#[test]
fn order_holds_across_a_partition() {
    for seed in 0..20 {
        let mut swarm = fleet(seed);
        swarm.run(Duration::from_millis(700));
        swarm.network.partition(&[&[name("uav/1")]]);
        swarm.run(Duration::from_millis(2500));
        swarm.network.heal();
        swarm.run(Duration::from_secs(5));
        check_order(&swarm);
        assert_eq!(swarm.saw("uav/1", "uav/2/word").count(), 40, "seed {seed}");
        assert_eq!(swarm.saw("uav/2", "uav/1/word").count(), 40, "seed {seed}");
    }
}

#[test]
fn what_the_home_no_longer_keeps_is_told_as_a_gap() {
    let mut swarm = Swarm::new(&FLEET[..2], Default::default(), 1);
    let mut program = program(1);
    program.add("talk", Requester::new("uav/1/word", 60, Duration::from_millis(20)));
    let config = skein_dbp::NodeConfig { history: 8, ..swarm.config("uav/1", 1) };
    swarm.start_with(config, program);
    swarm.start("uav/2", 1, crate::swarm::program(1));
    swarm.run(Duration::from_millis(200));
    swarm.network.partition(&[&[name("uav/1")]]);
    swarm.run(Duration::from_secs(2));
    swarm.network.heal();
    swarm.run(Duration::from_secs(2));
    check_order(&swarm);
    assert!(swarm.saw("uav/2", "uav/2/gap").count() >= 1);
    let last = swarm.saw("uav/2", "uav/1/word").last().unwrap();
    assert_eq!(last.happened.event.int("n"), Some(60));
}

#[test]
fn a_restarted_home_is_heard_anew_from_its_first_occurrence() {
    for seed in 0..20 {
        let mut swarm = fleet(seed);
        swarm.run(Duration::from_millis(900));
        let mut program = program(seed);
        program.add("talk", Requester::new("uav/1/again", 10, Duration::from_millis(40)));
        swarm.start("uav/1", 2, program);
        let before = swarm.seen.len();
        swarm.run(Duration::from_secs(4));
        let again: Vec<_> = swarm.seen[before..]
            .iter()
            .filter(|seen| seen.node == name("uav/2") && seen.happened.event.name() == "uav/1/again")
            .map(|seen| seen.happened.event.int("n").unwrap())
            .collect();
        assert_eq!(again, (1..=10).collect::<Vec<_>>(), "seed {seed}");
    }
}

#[test]
fn a_late_joiner_hears_the_present_not_the_past() {
    let mut swarm = Swarm::new(&FLEET[..2], Default::default(), 1);
    let mut program = program(1);
    program.add("talk", Requester::new("uav/1/word", 100, Duration::from_millis(100)));
    swarm.start("uav/1", 1, program);
    swarm.run(Duration::from_secs(3));
    swarm.start("uav/2", 1, crate::swarm::program(1));
    swarm.run(Duration::from_secs(2));
    let first = swarm.saw("uav/2", "uav/1/word").next().unwrap().happened.event.int("n").unwrap();
    assert!(first > 20, "heard word {first} of long ago");
    assert_eq!(swarm.saw("uav/2", "uav/2/gap").count(), 0);
}
