//! G4: a request is served at most once, whatever is lost, repeated or reordered, and whoever restarts.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::swarm::{LEASE, Requester, Swarm, TICK, hostile, name, program};
use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::NetworkConfig;

/// How often each numbered event has occurred at its home, over all lives of the home.
fn times_occurred(swarm: &Swarm, event: &str) -> BTreeMap<i64, usize> {
    let mut times = BTreeMap::new();
    for seen in swarm.occurred("uav/1", event) {
        *times.entry(seen.happened.event.int("n").unwrap()).or_default() += 1;
    }
    times
}

#[test]
fn every_request_is_served_exactly_once_on_a_hostile_network() {
    for seed in 0..20 {
        let mut swarm = Swarm::new(&["uav/1", "uav/2", "uav/3"], hostile(), seed);
        swarm.start("uav/1", 1, program(seed));
        for asker in ["uav/2", "uav/3"] {
            let mut program = program(seed);
            program.add(
                "ask",
                Requester::new(&format!("uav/1/do-{}", name(asker).id()), 15, Duration::from_millis(30)),
            );
            swarm.start(asker, 1, program);
        }
        swarm.run(Duration::from_secs(40));
        for id in ["2", "3"] {
            let times = times_occurred(&swarm, &format!("uav/1/do-{id}"));
            assert_eq!(times, (1..=15).map(|n| (n, 1)).collect(), "seed {seed}");
            assert_eq!(swarm.saw(&format!("uav/{id}"), &format!("uav/1/do-{id}")).count(), 15);
        }
    }
}

#[test]
fn one_occurrence_serves_all_who_ask_for_the_same() {
    for seed in 0..10 {
        let mut swarm = Swarm::new(&["uav/1", "uav/2", "uav/3"], hostile(), seed);
        let mut home = program(seed);
        home.add(
            "gate",
            crate::swarm::Blocker::new("uav/1/do", Duration::from_millis(700), Duration::from_millis(100)),
        );
        swarm.start("uav/1", 1, home);
        for asker in ["uav/2", "uav/3"] {
            let mut program = program(seed);
            program.add("ask", Requester::new("uav/1/do", 4, Duration::ZERO));
            swarm.start(asker, 1, program);
        }
        swarm.run(Duration::from_secs(20));
        for asker in ["uav/2", "uav/3"] {
            let ended = swarm.node(asker).program().bids().all(|(name, ..)| name != "ask");
            assert!(ended, "{asker} still asks, seed {seed}");
        }
        // Who asked late for what had occurred already is content with that.
        assert_eq!(times_occurred(&swarm, "uav/1/do"), (1..=4).map(|n| (n, 1)).collect(), "seed {seed}");
    }
}

#[test]
fn after_a_restart_of_the_home_open_requests_are_unknown_and_never_served_again() {
    let mut unknown = 0;
    for seed in 0..30 {
        let mut swarm = Swarm::new(&["uav/1", "ground/main"], hostile(), seed);
        swarm.start("uav/1", 1, program(seed));
        let mut ground = program(seed);
        ground.add("ask", Requester::new("uav/1/do", 20, Duration::from_millis(30)));
        swarm.start("ground/main", 1, ground);
        for incarnation in 2..5 {
            swarm.run(Duration::from_millis(1100 + 17 * seed));
            swarm.start("uav/1", incarnation, program(seed));
        }
        swarm.run(Duration::from_secs(5));
        for (n, times) in times_occurred(&swarm, "uav/1/do") {
            assert_eq!(times, 1, "request {n} served {times} times, seed {seed}");
        }
        unknown += swarm.saw("ground/main", "ground/main/unknown").count();
    }
    assert!(unknown >= 10, "only {unknown} requests became unknown: the test says nothing");
}

#[test]
fn a_restarted_requester_begins_anew_and_its_old_requests_are_dropped() {
    for seed in 0..20 {
        let mut swarm = Swarm::new(&["uav/1", "ground/main"], hostile(), seed);
        swarm.start("uav/1", 1, program(seed));
        for incarnation in 1..4 {
            let mut ground = program(seed);
            ground
                .add("ask", Requester::new(&format!("uav/1/do-{incarnation}"), 6, Duration::from_millis(30)));
            swarm.start("ground/main", incarnation, ground);
            swarm.run(Duration::from_millis(2000 + 31 * seed));
        }
        swarm.run(Duration::from_secs(12));
        for incarnation in 1..4 {
            let times = times_occurred(&swarm, &format!("uav/1/do-{incarnation}"));
            assert!(times.values().all(|times| *times == 1), "{times:?}, seed {seed}");
        }
        assert_eq!(
            times_occurred(&swarm, "uav/1/do-3").len(),
            6,
            "the last life was not served, seed {seed}"
        );
        let lives: Vec<_> = swarm.seen.iter().filter(|seen| seen.node == name("uav/1")).collect();
        let first_of = |what: &str| lives.iter().position(|seen| seen.happened.event.name() == what);
        let last_of = |what: &str| lives.iter().rposition(|seen| seen.happened.event.name() == what);
        if let (Some(last), Some(first)) = (last_of("uav/1/do-1"), first_of("uav/1/do-2")) {
            assert!(last < first, "a request of a life that was over was served");
        }
    }
}

#[test]
fn a_requester_that_has_missed_its_own_occurrence_is_not_served_again() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut home = program(1);
    let gate = crate::swarm::Blocker {
        blocking: true,
        until: Duration::from_secs(1),
        ..crate::swarm::Blocker::new("uav/1/do", TICK, LEASE * 9)
    };
    home.add("gate", gate);
    home.add("talk", Requester::new("uav/1/word", 100, TICK));
    let config = skein_dbp::NodeConfig {
        history: 8,
        lease: 5 * LEASE,
        longest_lease: 5 * LEASE,
        ..swarm.config("uav/1", 1)
    };
    swarm.start_with(config, home);
    let mut ground = program(1);
    ground.add("ask", Requester::new("uav/1/do", 1, Duration::ZERO));
    let config = skein_dbp::NodeConfig {
        lease: 5 * LEASE,
        longest_lease: 5 * LEASE,
        ..swarm.config("ground/main", 1)
    };
    swarm.start_with(config, ground);
    swarm.run(Duration::from_millis(900));
    swarm.network.partition(&[&[name("uav/1")]]);
    swarm.run(Duration::from_secs(3));
    swarm.network.heal();
    swarm.run(Duration::from_secs(3));
    assert_eq!(swarm.saw("ground/main", "ground/main/gap").count(), 1);
    assert_eq!(swarm.saw("ground/main", "uav/1/do").count(), 0, "it was not missed: the test says nothing");
    assert_eq!(swarm.occurred("uav/1", "uav/1/do").count(), 1);
}

/// Asks, and goes its own way when that takes too long.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct AsksOnce {
    until: Option<Duration>,
}

impl BThread for AsksOnce {
    fn bid(&self) -> Option<Bid> {
        Some(match self.until {
            Some(until) => Bid::new().request("uav/1/do").deadline(until),
            None => Bid::new(),
        })
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.until = None;
    }
}

#[test]
fn what_occurs_after_its_requester_has_moved_on_is_an_orphan() {
    let slow = NetworkConfig {
        latency: (Duration::from_millis(250), Duration::from_millis(250)),
        ..Default::default()
    };
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], slow, 1);
    swarm.start("uav/1", 1, program(1));
    let mut ground = program(1);
    ground.add("ask", AsksOnce { until: Some(Duration::from_millis(700)) });
    swarm.start("ground/main", 1, ground);
    swarm.run(Duration::from_secs(3));
    assert_eq!(swarm.occurred("uav/1", "uav/1/do").count(), 1);
    let orphan =
        &swarm.saw("ground/main", "ground/main/orphan").next().expect("the orphan went unnoticed").happened;
    assert_eq!(orphan.event.text("event"), Some("uav/1/do"));
    assert_eq!(orphan.event.text("bthread"), Some("ask"));
}
