//! G3: after `confirmed`, a blocked event does not occur until the block is withdrawn or its holder has been told
//! `block_lapsed`.

use std::time::Duration;

use crate::swarm::{Always, Blocker, LEASE, Requester, Swarm, hostile, name, program};
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, EventSet, Program};
use skein_dbp::{NodeConfig, Roster, facts};
use skein_wire::NetworkConfig;

const HOMES: [&str; 3] = ["uav/1", "uav/2", "uav/3"];
const HOLDER: &str = "ground/main";
const ALL: [&str; 4] = ["uav/1", "uav/2", "uav/3", HOLDER];

/// A home that does `step` all the time.
fn stepper(home: &str, seed: u64) -> Program {
    let mut program = program(seed);
    program.add("steps", Requester::new(&format!("{home}/step"), i64::MAX, crate::swarm::TICK));
    program
}

fn fleet(network: NetworkConfig, seed: u64) -> Swarm {
    let mut swarm = Swarm::new(&ALL, network, seed);
    for home in HOMES {
        swarm.start(home, 1, stepper(home, seed));
    }
    let mut holder = program(seed);
    holder.add("hold", Blocker::new("uav/*/step", Duration::from_millis(2500), Duration::from_millis(700)));
    swarm.start(HOLDER, 1, holder);
    swarm
}

/// Follows what the holder may rely on.
#[derive(Default)]
struct Witness {
    sure: bool,
    confirmed: usize,
    lapsed: usize,
    ticks_held: usize,
    steps: usize,
}

impl Witness {
    /// One tick, in which no home may step if the holder was sure before it and is after it.
    fn tick(&mut self, swarm: &mut Swarm) {
        let before = self.sure;
        let mut confirmed_at = None;
        let seen = swarm.tick().to_vec();
        for seen in seen.iter().filter(|seen| seen.node.as_str() == HOLDER) {
            match seen.happened.event.name() {
                "ground/main/confirmed" => {
                    confirmed_at = seen.happened.event.int("sync");
                    self.sure = true;
                    self.confirmed += 1;
                }
                "ground/main/block_lapsed" => {
                    self.sure = false;
                    self.lapsed += 1;
                }
                _ => {}
            }
        }
        let blocking = swarm.node(HOLDER).program().state_of::<Blocker>("hold").unwrap().blocking;
        self.sure &= blocking;
        if let (Some(sync), true) = (confirmed_at, blocking) {
            let now_at = swarm.node(HOLDER).program().bids().find(|(name, ..)| *name == "hold").unwrap().2;
            assert_eq!(sync as u64, now_at, "confirmed a synchronisation point that is over");
        }
        let steps = seen
            .iter()
            .filter(|seen| seen.happened.home == seen.node && seen.happened.event.kind() == "step")
            .count();
        self.steps += steps;
        if before && self.sure {
            self.ticks_held += 1;
            let who: Vec<_> = seen
                .iter()
                .filter(|seen| seen.happened.event.kind() == "step")
                .map(|seen| seen.node.to_string())
                .collect();
            assert_eq!(steps, 0, "{who:?} stepped at {:?} under a confirmed block", swarm.now);
        }
    }
}

#[test]
fn a_confirmed_wildcard_block_holds_under_loss_and_delay() {
    let mut total = Witness::default();
    for seed in 0..15 {
        let mut swarm = fleet(hostile(), seed);
        let mut witness = Witness::default();
        for _ in 0..1000 {
            witness.tick(&mut swarm);
        }
        total.confirmed += witness.confirmed;
        total.ticks_held += witness.ticks_held;
        total.steps += witness.steps;
    }
    assert!(total.confirmed > 30 && total.ticks_held > 1000 && total.steps > 1000, "the test says nothing");
}

#[test]
fn a_partition_is_told_to_the_holder_before_a_home_lets_go() {
    let mut lapsed = 0;
    for seed in 0..15 {
        let mut swarm = fleet(NetworkConfig { loss: 0.1, ..hostile() }, seed);
        let mut witness = Witness::default();
        for round in 0..6 {
            for _ in 0..(40 + 7 * seed) {
                witness.tick(&mut swarm);
            }
            let cut = name(HOMES[round % HOMES.len()]);
            swarm.network.partition(&[&[cut]]);
            for _ in 0..100 {
                witness.tick(&mut swarm);
            }
            swarm.network.heal();
        }
        lapsed += witness.lapsed;
    }
    assert!(lapsed > 10, "only {lapsed} blocks lapsed: the test says nothing");
}

#[test]
fn a_guarded_event_respects_a_confirmed_block_across_a_restart_of_its_home() {
    let mut held = 0;
    for seed in 0..20 {
        let mut swarm = fleet(NetworkConfig { loss: 0.1, ..hostile() }, seed);
        let mut witness = Witness::default();
        for incarnation in 1..8 {
            let config =
                NodeConfig { guarded: EventSet::from("uav/2/step"), ..swarm.config("uav/2", incarnation) };
            swarm.start_with(config, stepper("uav/2", seed));
            for _ in 0..(90 + 11 * seed) {
                witness.tick(&mut swarm);
            }
        }
        held += witness.ticks_held;
        assert!(
            swarm.occurred("uav/2", "uav/2/step").any(|seen| seen.incarnation > 1),
            "the guard was never lifted"
        );
    }
    assert!(held > 1000, "only {held} ticks under a confirmed block: the test says nothing");
}

#[test]
fn a_block_that_comes_with_a_request_stays_when_the_request_is_served() {
    for seed in 0..10 {
        let mut swarm = Swarm::new(&["uav/1", HOLDER], NetworkConfig { loss: 0.0, ..hostile() }, seed);
        swarm.start("uav/1", 1, stepper("uav/1", seed));
        let mut holder = program(seed);
        holder.add("move", Always(Bid::new().request("uav/1/turn").block("uav/1/step")));
        swarm.start(HOLDER, 1, holder);
        swarm.run(Duration::from_secs(10));
        let confirmed = swarm.saw(HOLDER, "ground/main/confirmed").next().unwrap().at;
        let turns = swarm.occurred("uav/1", "uav/1/turn").filter(|seen| seen.at > confirmed).count();
        assert!(turns > 5, "only {turns} turns: the test says nothing");
        assert!(swarm.occurred("uav/1", "uav/1/step").all(|seen| seen.at <= confirmed), "seed {seed}");
    }
}

#[test]
fn a_silent_member_keeps_a_wildcard_block_unconfirmed() {
    let mut swarm = Swarm::new(&ALL, NetworkConfig::default(), 1);
    for home in &HOMES[..2] {
        swarm.start(home, 1, stepper(home, 1));
    }
    let mut holder = program(1);
    holder.add("all", Always(Bid::new().block("uav/*/step")));
    holder.add("one", Always(Bid::new().block("uav/1/step")));
    swarm.start(HOLDER, 1, holder);
    swarm.run(Duration::from_secs(2));
    let confirmed = |swarm: &Swarm| -> Vec<String> {
        swarm
            .saw(HOLDER, "ground/main/confirmed")
            .map(|seen| seen.happened.event.text("bthread").unwrap().into())
            .collect()
    };
    assert_eq!(confirmed(&swarm), ["one"]);
    swarm.start("uav/3", 1, stepper("uav/3", 1));
    swarm.run(Duration::from_secs(1));
    assert_eq!(confirmed(&swarm), ["one", "all"]);
}

#[test]
fn a_fleet_of_one_confirms_at_once() {
    let mut swarm = Swarm::new(&[HOLDER], NetworkConfig::default(), 1);
    let mut holder = program(1);
    let confirmed = facts::confirmed(&name(HOLDER), "hold");
    holder.add("hold", Always(Bid::new().block("uav/*/step").wait_for(confirmed)));
    swarm.start(HOLDER, 1, holder);
    swarm.tick();
    assert!(swarm.saw(HOLDER, "ground/main/confirmed").count() >= 1);
}

/// Who claims awaits confirmation, and then stays with `claimed` until it is told that its block has lapsed.
fn claimant(claimed: &str) -> Script {
    let me = name(HOLDER);
    let claim = Bid::new().block("uav/*/step").wait_for(facts::confirmed(&me, "claim"));
    let act = Bid::new().block(claimed).wait_for(facts::block_lapsed(&me, "claim"));
    Script::new(&[Op::Sync(claim), Op::Sync(act), Op::Sync(Bid::new().request("ground/main/warned"))])
        .unwrap()
}

#[test]
fn who_moves_on_with_its_block_and_is_cut_off_is_told_before_a_home_lets_go() {
    for claimed in ["uav/*/step", "uav/1/step"] {
        let mut swarm = Swarm::new(&["uav/1", HOLDER], NetworkConfig::default(), 1);
        swarm.start("uav/1", 1, stepper("uav/1", 1));
        let mut holder = program(1);
        holder.add("claim", claimant(claimed));
        swarm.start(HOLDER, 1, holder);
        while swarm.saw(HOLDER, "ground/main/confirmed").next().is_none() {
            swarm.tick();
        }
        // Nobody has acknowledged the block as it is stated now.
        swarm.network.partition(&[&[name(HOLDER)]]);
        let cut = swarm.now;
        swarm.run(3 * LEASE);
        let warned = swarm.occurred(HOLDER, "ground/main/warned").next().unwrap().at;
        let stepped = swarm.occurred("uav/1", "uav/1/step").find(|seen| seen.at > cut).unwrap().at;
        assert!(warned < stepped, "{claimed}: warned at {warned:?}, and the first step was at {stepped:?}");
    }
}

#[test]
fn who_moves_on_with_a_larger_block_awaits_its_confirmation_anew() {
    let mut swarm = Swarm::new(&["uav/1", HOLDER], NetworkConfig::default(), 1);
    swarm.start("uav/1", 1, stepper("uav/1", 1));
    let mut holder = program(1);
    holder.add("claim", claimant("uav/*/*"));
    swarm.start(HOLDER, 1, holder);
    while swarm.saw(HOLDER, "ground/main/confirmed").next().is_none() {
        swarm.tick();
    }
    swarm.network.partition(&[&[name(HOLDER)]]);
    swarm.run(3 * LEASE);
    assert_eq!(swarm.saw(HOLDER, "ground/main/block_lapsed").count(), 0, "it relied on nothing");
    swarm.network.heal();
    swarm.run(LEASE);
    assert_eq!(swarm.saw(HOLDER, "ground/main/confirmed").count(), 2);
}

/// All under the roster of a term, which their operator orders them in turn.
fn order(swarm: &mut Swarm, term: u64, members: &[&str]) {
    let roster = Roster { term, ..Roster::first(name(HOLDER), members.iter().map(|member| name(member))) };
    for node in ALL {
        swarm.node(node).enqueue(roster.order(&name(node)));
    }
}

fn fleet_with_roster(bid: Bid) -> Swarm {
    let mut swarm = Swarm::new(&ALL, NetworkConfig::default(), 1);
    let joint = Some(Roster::first(name(HOLDER), HOMES.map(name)));
    for home in HOMES {
        let config = NodeConfig { joint: joint.clone(), ..swarm.config(home, 1) };
        let mut steps = stepper(home, 1);
        steps.add("never", Always(Bid::new().block(format!("{home}/never"))));
        swarm.start_with(config, steps);
    }
    let mut holder = program(1);
    holder.add("hold", Always(bid));
    let config = NodeConfig { joint, ..swarm.config(HOLDER, 1) };
    swarm.start_with(config, holder);
    swarm.run(LEASE);
    swarm
}

#[test]
fn a_home_that_comes_into_the_roster_makes_a_confirmed_block_unsure_until_it_has_heard_of_it() {
    let mut swarm = fleet_with_roster(Bid::new().block("uav/*/step"));
    order(&mut swarm, 2, &["uav/1", "uav/2"]);
    swarm.run(2 * LEASE);
    let confirmed = |swarm: &Swarm| swarm.saw(HOLDER, "ground/main/confirmed").count();
    let lapsed = |swarm: &Swarm| -> Vec<Option<String>> {
        let told = swarm.saw(HOLDER, "ground/main/block_lapsed");
        told.map(|seen| seen.happened.event.text("home").map(Into::into)).collect()
    };
    let before = confirmed(&swarm);
    assert_eq!(lapsed(&swarm), [], "one home fewer takes nothing away");
    assert!(swarm.occurred("uav/3", "uav/3/step").any(|seen| seen.at > 2 * LEASE), "it is free meanwhile");
    order(&mut swarm, 3, &HOMES);
    swarm.run(LEASE);
    assert_eq!(lapsed(&swarm), [Some("uav/3".to_owned())]);
    assert_eq!(confirmed(&swarm), before + 1);
}

#[test]
fn a_block_whose_only_home_leaves_the_roster_and_comes_back_is_unsure_until_that_has_heard_of_it() {
    let mut swarm = fleet_with_roster(Bid::new().block("uav/3/step"));
    order(&mut swarm, 2, &["uav/1", "uav/2"]);
    swarm.run(2 * LEASE);
    let told = |swarm: &Swarm, fact: &str| swarm.saw(HOLDER, fact).count();
    let before = told(&swarm, "ground/main/confirmed");
    assert_eq!(told(&swarm, "ground/main/block_lapsed"), 0);
    order(&mut swarm, 3, &HOMES);
    swarm.run(LEASE);
    assert_eq!(told(&swarm, "ground/main/block_lapsed"), 1);
    assert_eq!(told(&swarm, "ground/main/confirmed"), before + 1);
}

#[test]
fn who_moves_on_with_a_block_while_its_home_is_out_of_the_roster_is_told_when_that_comes_back_and_not_before()
{
    let mut swarm = fleet_with_roster(Bid::new().block("uav/3/step").wait_for("ground/main/tick"));
    order(&mut swarm, 2, &["uav/1", "uav/2"]);
    swarm.run(LEASE);
    let told = |swarm: &Swarm, fact: &str| swarm.saw(HOLDER, fact).count();
    let before = told(&swarm, "ground/main/confirmed");
    swarm.node(HOLDER).enqueue("ground/main/tick");
    swarm.run(LEASE);
    assert_eq!(told(&swarm, "ground/main/confirmed"), before, "there is nobody to confirm it");
    order(&mut swarm, 3, &HOMES);
    swarm.run(LEASE);
    assert_eq!(told(&swarm, "ground/main/block_lapsed"), 1);
    assert_eq!(told(&swarm, "ground/main/confirmed"), before + 1);
}

#[test]
fn an_acknowledgement_from_before_the_home_came_back_into_the_roster_confirms_nothing() {
    // What is requested there goes on, whoever is in the roster, and is acknowledged.
    let mut swarm = fleet_with_roster(Bid::new().request("uav/3/never").block("uav/3/step"));
    order(&mut swarm, 2, &["uav/1", "uav/2"]);
    swarm.run(2 * LEASE);
    swarm.network.partition(&[&[name("uav/3")]]);
    order(&mut swarm, 3, &HOMES);
    let ordered = swarm.now;
    swarm.run(LEASE);
    let confirmed = |swarm: &Swarm| swarm.saw(HOLDER, "ground/main/confirmed").any(|seen| seen.at >= ordered);
    assert!(!confirmed(&swarm), "uav/3 has not heard of the block");
    swarm.network.heal();
    swarm.run(2 * LEASE);
    assert!(confirmed(&swarm));
}
