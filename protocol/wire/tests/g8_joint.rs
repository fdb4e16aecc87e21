//! G8: a joint event has one decision, which every member learns before it acts on a later one; it is taken only on
//! fresh word from the whole roster, and the roster changes by operator order, which fences the old term.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::swarm::{Always, LEASE, Requester, Swarm, TICK, hostile, name, program};
use skein_bp::catalogue::Declared as _;
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Event, Origin};
use skein_dbp::{NodeConfig, Roster, facts};
use skein_wire::NetworkConfig;

const GROUND: &str = "ground/main";
const VEHICLES: [&str; 3] = ["uav/1", "uav/2", "uav/3"];

fn roster() -> Roster {
    Roster::first(name(GROUND), VEHICLES.map(name))
}

fn config(swarm: &Swarm, node: &str, incarnation: u64) -> NodeConfig {
    NodeConfig { joint: Some(roster()), durable: true, ..swarm.config(node, incarnation) }
}

/// The ground decides `count` times, as often as it can.
fn start_ground(swarm: &mut Swarm, incarnation: u64, count: i64) {
    let mut ground = program(incarnation);
    ground.add("decide", Requester::new("swarm/go", count, Duration::ZERO));
    swarm.start_with(config(swarm, GROUND, incarnation), ground);
}

fn start_vehicle(swarm: &mut Swarm, node: &str, incarnation: u64) {
    let mut vehicle = program(incarnation);
    vehicle.add("listen", Always(Bid::new().wait_for("swarm/**")));
    swarm.start_with(config(swarm, node, incarnation), vehicle);
}

fn fleet(network: NetworkConfig, seed: u64) -> Swarm {
    let mut swarm = Swarm::new(&[GROUND, "uav/1", "uav/2", "uav/3"], network, seed);
    for vehicle in VEHICLES {
        start_vehicle(&mut swarm, vehicle, 1);
    }
    swarm
}

/// By node and life: number in the term, the event's own number, and when.
type Learned = BTreeMap<(String, u64), Vec<(u64, i64, Duration)>>;

/// The decisions that each life of each node has seen, with the times.
fn learned(swarm: &Swarm) -> Learned {
    let mut learned: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for seen in swarm.seen.iter().filter(|seen| seen.happened.event.name() == "swarm/go") {
        let number = seen.happened.event.int("n").unwrap();
        learned.entry((seen.node.to_string(), seen.incarnation)).or_default().push((
            seen.happened.seq,
            number,
            seen.at,
        ));
    }
    learned
}

#[test]
fn nobody_acts_on_a_decision_before_everybody_has_learned_the_one_before() {
    for seed in 0..20 {
        let mut swarm = fleet(hostile(), seed);
        start_ground(&mut swarm, 1, 5);
        swarm.run(60 * LEASE);
        let learned = learned(&swarm);
        assert_eq!(learned.len(), 4, "seed {seed}");
        for decisions in learned.values() {
            let numbers: Vec<_> = decisions.iter().map(|(seq, n, _)| (*seq, *n)).collect();
            assert_eq!(numbers, [(1, 1), (2, 2), (3, 3), (4, 4), (5, 5)], "seed {seed}");
        }
        for later in 1..5 {
            let first_of_later = learned.values().map(|all| all[later].2).min();
            let last_of_earlier = learned.values().map(|all| all[later - 1].2).max();
            assert!(first_of_later > last_of_earlier, "seed {seed}");
        }
    }
}

#[test]
fn nothing_is_decided_while_a_member_is_away_and_it_learns_what_was_before_it_is_told_that_it_is_in_step() {
    for seed in 0..10 {
        let mut swarm = fleet(NetworkConfig::default(), seed);
        start_ground(&mut swarm, 1, 1000);
        swarm.run(2 * LEASE);
        swarm.network.partition(&[&[name("uav/2")]]);
        let cut = swarm.now;
        swarm.run(6 * LEASE);
        let stopped = cut + 3 * LEASE / 2;
        assert!(learned(&swarm).values().flatten().all(|(_, _, at)| *at < stopped), "decided without uav/2");
        swarm.network.heal();
        let healed = swarm.now;
        swarm.run(3 * LEASE);
        let learned = learned(&swarm);
        assert!(learned.values().all(|all| all.last().unwrap().2 > healed), "it never went on");
        let numbers =
            |node: &str| -> Vec<i64> { learned[&(node.to_owned(), 1)].iter().map(|(_, n, _)| *n).collect() };
        let all: Vec<i64> = (1..=i64::try_from(numbers("uav/2").len()).unwrap()).collect();
        assert_eq!(numbers("uav/2"), all, "a decision was missed");
        // In step again: told after what was missed.
        let told = swarm.saw("uav/2", "uav/2/in_step").find(|seen| seen.at > healed).unwrap();
        let decided = told.happened.event.int("decided").unwrap();
        let before = learned[&("uav/2".to_owned(), 1)].iter().filter(|(_, _, at)| *at <= told.at).count();
        assert!(i64::try_from(before).unwrap() >= decided, "seed {seed}");
    }
}

#[test]
fn who_restarts_learns_the_terms_decisions_and_the_coordinator_remembers_its_own() {
    for seed in 0..10 {
        let mut swarm = fleet(hostile(), seed);
        start_ground(&mut swarm, 1, 2);
        swarm.run(30 * LEASE);
        start_vehicle(&mut swarm, "uav/3", 2);
        swarm.crash(GROUND);
        swarm.run(2 * LEASE);
        // What it recalls has happened: it asks for the rest only.
        start_ground(&mut swarm, 2, 5);
        swarm.run(60 * LEASE);
        let learned = learned(&swarm);
        let seqs = |node: &str, life: u64| -> Vec<u64> {
            learned[&(node.to_owned(), life)].iter().map(|(seq, _, _)| *seq).collect()
        };
        assert_eq!(seqs("uav/1", 1), [1, 2, 3, 4, 5], "seed {seed}");
        assert_eq!(seqs("uav/3", 2), [1, 2, 3, 4, 5], "seed {seed}");
        assert_eq!(seqs(GROUND, 2), [1, 2, 3, 4, 5], "seed {seed}");
    }
}

#[test]
fn an_operator_moves_the_coordinator_and_leaves_out_who_is_lost_and_the_old_term_is_over() {
    let mut swarm = fleet(NetworkConfig::default(), 1);
    start_ground(&mut swarm, 1, i64::MAX);
    swarm.run(2 * LEASE);
    // The ground station and uav/3 are cut off; the operator, at uav/1, goes on without them.
    swarm.network.partition(&[&[name("uav/1"), name("uav/2")]]);
    swarm.run(2 * LEASE);
    let next = Roster { term: 2, ..Roster::first(name("uav/1"), [name("uav/2")]) };
    for vehicle in ["uav/1", "uav/2"] {
        swarm.node(vehicle).enqueue(next.order(&name(vehicle)));
    }
    ask(&mut swarm, "uav/2");
    swarm.run(3 * LEASE);
    let decided: Vec<_> =
        learned(&swarm)[&("uav/2".to_owned(), 1)].iter().map(|(seq, n, _)| (*seq, *n)).collect();
    assert_eq!(decided.last(), Some(&(1, -1)), "the first decision of the new term");
    // When all are back, the old coordinator decides nothing, for its members are in another term.
    let last = learned(&swarm)[&(GROUND.to_owned(), 1)].len();
    swarm.network.heal();
    swarm.run(5 * LEASE);
    let after: Vec<_> = learned(&swarm)[&(GROUND.to_owned(), 1)].iter().map(|(_, n, _)| *n).collect();
    assert_eq!(after.len(), last, "the old term went on: {after:?}");
    let told = swarm.saw(GROUND, "ground/main/out_of_step").last().unwrap();
    assert_eq!(told.happened.event.int("term"), Some(2));
    // Ordered into a new term, with everybody, it goes on; and a restart does not bring the old term back.
    let third = Roster { term: 3, ..roster() };
    for node in [GROUND, "uav/1", "uav/2", "uav/3"] {
        swarm.node(node).enqueue(third.order(&name(node)));
    }
    start_vehicle(&mut swarm, "uav/2", 2);
    assert_eq!(swarm.node("uav/2").roster().unwrap().term, 2, "it was restarted before it took the order");
    swarm.node("uav/2").enqueue(third.order(&name("uav/2")));
    swarm.run(5 * LEASE);
    let resumed = learned(&swarm)[&(GROUND.to_owned(), 1)].len();
    assert!(resumed > after.len());
}

/// Asks once for `swarm/go`, number -1, and stays there.
fn ask(swarm: &mut Swarm, node: &str) {
    let ask = Script::new(&[Op::Sync(Bid::new().request(Event::new("swarm/go").with("n", -1)))]).unwrap();
    swarm.node(node).program_mut().add("ask", ask);
}

/// How often the one event that was asked for was decided, by any coordinator.
fn decided(swarm: &Swarm) -> usize {
    let here = |seen: &&crate::swarm::Seen| seen.happened.origin == Origin::Internal;
    let asked = |seen: &&crate::swarm::Seen| seen.happened.event.int("n") == Some(-1);
    swarm.seen.iter().filter(here).filter(asked).count()
}

fn take_order(swarm: &mut Swarm, roster: &Roster, nodes: &[&str]) {
    for node in nodes {
        swarm.node(node).enqueue(roster.order(&name(node)));
    }
}

/// What `node` was told to be unknown: event, b-thread, and who was asked.
fn unknown(swarm: &Swarm, node: &str) -> Vec<[String; 3]> {
    let told = swarm.seen.iter().filter(|seen| seen.node.as_str() == node);
    let told = told.filter_map(|seen| facts::Unknown::read(&seen.happened.event));
    told.map(|fact| [fact.event.to_string(), fact.bthread.to_string(), fact.home.to_string()]).collect()
}

#[test]
fn what_was_asked_of_a_former_coordinator_is_unknown_and_not_asked_of_the_next() {
    let mut swarm = fleet(NetworkConfig::default(), 1);
    start_ground(&mut swarm, 1, 0);
    swarm.crash("uav/3");
    swarm.run(2 * LEASE);
    // Nothing can be decided without uav/3: the request stays open.
    ask(&mut swarm, "uav/2");
    swarm.run(LEASE);
    assert_eq!((decided(&swarm), unknown(&swarm, "uav/2").len()), (0, 0));
    let next = Roster { term: 2, ..Roster::first(name("uav/1"), [name("uav/2")]) };
    take_order(&mut swarm, &next, &["uav/1", "uav/2"]);
    swarm.run(2 * LEASE);
    assert_eq!(unknown(&swarm, "uav/2"), [["swarm/go", "ask", GROUND]]);
    assert_eq!(decided(&swarm), 0, "it was asked again by itself");
    // Who asks anew is heard, and what then happens resumes who had asked before.
    ask(&mut swarm, "uav/1");
    swarm.run(2 * LEASE);
    assert_eq!(decided(&swarm), 1);
    assert!(swarm.node("uav/2").program().bid("ask").is_none());
}

#[test]
fn who_becomes_coordinator_does_not_decide_what_it_has_asked_of_the_former_one() {
    let mut swarm = fleet(NetworkConfig::default(), 1);
    start_ground(&mut swarm, 1, 0);
    swarm.crash("uav/2");
    swarm.run(2 * LEASE);
    ask(&mut swarm, "uav/1");
    swarm.run(LEASE / 2);
    // As soon as uav/2 is back, the ground station decides; uav/1 is cut off just then and does not hear of it.
    start_vehicle(&mut swarm, "uav/2", 2);
    swarm.network.partition(&[&[name("uav/1")]]);
    swarm.run(LEASE);
    assert_eq!(decided(&swarm), 1, "the test says nothing");
    let alone = Roster { term: 2, ..Roster::first(name("uav/1"), []) };
    take_order(&mut swarm, &alone, &["uav/1"]);
    swarm.run(2 * LEASE);
    assert_eq!(unknown(&swarm, "uav/1"), [["swarm/go", "ask", GROUND]]);
    assert_eq!(decided(&swarm), 1, "one request was served twice");
}

#[test]
fn a_block_of_everything_does_not_keep_a_node_in_a_term_that_is_over() {
    let mut swarm = fleet(NetworkConfig::default(), 1);
    let mut ground = program(1);
    ground.add("hold", Always(Bid::new().block("uav/**")));
    swarm.start_with(config(&swarm, GROUND, 1), ground);
    swarm.run(LEASE);
    assert!(swarm.saw(GROUND, "ground/main/confirmed").next().is_some());
    take_order(&mut swarm, &Roster { term: 2, ..roster() }, &["uav/1"]);
    swarm.run(LEASE);
    assert_eq!(swarm.node("uav/1").roster().unwrap().term, 2);
}

#[test]
fn an_order_that_makes_no_roster_is_refused_with_its_reason() {
    let mut swarm = fleet(NetworkConfig::default(), 1);
    let node = name("uav/1");
    let good = Roster { term: 2, ..roster() };
    let stranger = Roster { term: 2, ..Roster::first(name("uav/9"), []) };
    for order in [
        roster().order(&node),
        stranger.order(&node),
        good.order(&node).with("members", "uav/1 uav"),
        good.order(&node).with("members", "uav/1 uav/2"),
        Event::new("uav/1/roster"),
    ] {
        swarm.node("uav/1").enqueue(order);
    }
    swarm.run(10 * TICK);
    let why: Vec<_> = swarm
        .saw("uav/1", "uav/1/roster_refused")
        .map(|seen| seen.happened.event.text("why").unwrap().to_owned())
        .collect();
    assert_eq!(why.len(), 5, "{why:?}");
    assert!(why[0].contains("over") && why[1].contains("uav/9") && why[2].contains("`uav`"), "{why:?}");
    assert_eq!(swarm.node("uav/1").roster(), Some(&roster()));
}
