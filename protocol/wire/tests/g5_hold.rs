//! G5: a block that is stated to outlive its holder stays, through the loss of the holder and the restart of the home,
//! until the holder withdraws it or an authority lifts it.

use std::time::Duration;

use crate::swarm::{Always, LEASE, Requester, Swarm, TICK, hostile, name, program};
use skein_bp::{Bid, Event};
use skein_dbp::{NodeConfig, Roster};
use skein_wire::NetworkConfig;

const ROSTER: [&str; 3] = ["uav/1", "ground/main", "ground/spare"];

fn start_home(swarm: &mut Swarm, incarnation: u64, seed: u64) {
    let mut home = program(seed);
    home.add("steps", Requester::new("uav/1/step", i64::MAX, TICK));
    let config = NodeConfig { durable: true, ..swarm.config("uav/1", incarnation) };
    swarm.start_with(config, home);
}

fn start_holder(swarm: &mut Swarm, incarnation: u64, bid: Bid, until: Duration) {
    let mut ground = program(1);
    let end = Event::new("ground/main/enough");
    ground.add("hold", Always(bid.block("uav/1/step").interrupt(&end)));
    ground.add(
        "end",
        crate::swarm::Requester {
            resting_until: Some(until),
            ..Requester::new("ground/main/enough_said", 1, TICK)
        },
    );
    ground.add(
        "tell",
        skein_bp::script::Script::new(&[
            skein_bp::script::Op::Sync(Bid::new().wait_for("ground/main/enough_said")),
            skein_bp::script::Op::Sync(Bid::new().request(end)),
        ])
        .unwrap(),
    );
    swarm.start("ground/main", incarnation, ground);
}

fn steps_since(swarm: &Swarm, since: Duration) -> usize {
    swarm.occurred("uav/1", "uav/1/step").filter(|seen| seen.at >= since).count()
}

/// The operator at the home lifts the holder's block.
fn lift(swarm: &mut Swarm) {
    let lift = Event::new("uav/1/lift").with("node", "ground/main").with("bthread", "hold");
    swarm.node("uav/1").enqueue(lift);
}

const NEVER: Duration = Duration::from_secs(1_000_000);

#[test]
fn it_stays_when_its_holder_and_then_its_home_are_lost() {
    for seed in 0..20 {
        let mut swarm = Swarm::new(&ROSTER, hostile(), seed);
        start_home(&mut swarm, 1, seed);
        start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
        swarm.run(5 * LEASE);
        assert_eq!(swarm.saw("ground/main", "ground/main/confirmed").count(), 1, "seed {seed}");
        assert_eq!(
            swarm.saw("ground/main", "ground/main/block_lapsed").count(),
            0,
            "it cannot lapse, seed {seed}"
        );
        swarm.crash("ground/main");
        let lost = swarm.now;
        swarm.run(5 * LEASE);
        assert_eq!(steps_since(&swarm, lost), 0, "the holder is lost, seed {seed}");
        let told = swarm.saw("uav/1", "uav/1/peer_lost").last().unwrap();
        assert_eq!(told.happened.event.text("held"), Some("hold"));
        start_home(&mut swarm, 2, seed);
        swarm.run(5 * LEASE);
        assert_eq!(steps_since(&swarm, lost), 0, "the home has restarted, seed {seed}");
        // Its holder's next life takes it over, and may withdraw it.
        let until = swarm.now + 2 * LEASE;
        start_holder(&mut swarm, 2, Bid::new().hold_when_lost(), until);
        swarm.run(2 * LEASE);
        assert_eq!(steps_since(&swarm, lost), 0, "the holder is back, seed {seed}");
        swarm.run(4 * LEASE);
        assert!(steps_since(&swarm, until) > 0, "it was withdrawn, seed {seed}");
    }
}

#[test]
fn a_new_life_that_does_not_state_it_does_not_end_it_but_an_authority_does() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
    swarm.run(2 * LEASE);
    swarm.crash("ground/main");
    let lost = swarm.now;
    swarm.start("ground/main", 2, program(1));
    swarm.run(3 * LEASE);
    assert_eq!(steps_since(&swarm, lost), 0);
    let mut spare = program(1);
    let lift = Event::new("uav/1/lift").with("node", "ground/main").with("bthread", "hold");
    spare.add(
        "lift",
        skein_bp::script::Script::new(&[skein_bp::script::Op::Sync(Bid::new().request(lift))]).unwrap(),
    );
    swarm.start("ground/spare", 1, spare);
    swarm.run(3 * LEASE);
    assert!(steps_since(&swarm, lost) > 0);
    start_home(&mut swarm, 2, 1);
    let restarted = swarm.now;
    swarm.run(2 * LEASE);
    assert!(steps_since(&swarm, restarted) > 0, "what was lifted is not kept");
}

#[test]
fn a_new_life_withdraws_it_whether_the_home_has_become_the_coordinator_meanwhile_or_is_it_no_more() {
    for (first, second) in [("ground/spare", "uav/1"), ("uav/1", "ground/spare")] {
        let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
        let mut home = program(1);
        home.add("steps", Requester::new("uav/1/step", i64::MAX, TICK));
        let led_by = |coordinator: &str| Roster::first(name(coordinator), [name("uav/1")]);
        let config = NodeConfig { durable: true, joint: Some(led_by(first)), ..swarm.config("uav/1", 1) };
        swarm.start_with(config, home);
        start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
        swarm.run(2 * LEASE);
        swarm.crash("ground/main");
        let order = Roster { term: 2, ..led_by(second) }.order(&name("uav/1"));
        swarm.node("uav/1").enqueue(order);
        swarm.run(LEASE);
        let until = swarm.now + 2 * LEASE;
        start_holder(&mut swarm, 2, Bid::new().hold_when_lost(), until);
        swarm.run(4 * LEASE);
        assert!(steps_since(&swarm, until) > 0, "it was withdrawn in vain from {second}'s member");
    }
}

#[test]
fn one_that_is_lifted_while_its_holder_lives_is_lapsed_and_refused() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
    swarm.run(2 * LEASE);
    let held = swarm.now;
    lift(&mut swarm);
    swarm.run(2 * LEASE);
    assert!(steps_since(&swarm, held) > 0);
    let reasons: Vec<_> = swarm
        .saw("ground/main", "ground/main/refused")
        .map(|seen| seen.happened.event.text("reason").unwrap().to_owned())
        .collect();
    assert_eq!(reasons, ["lifted"]);
    assert_eq!(swarm.saw("ground/main", "ground/main/block_lapsed").count(), 1);
}

#[test]
fn a_home_without_a_store_refuses_it() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    swarm.start("uav/1", 1, program(1));
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
    swarm.run(2 * LEASE);
    assert_eq!(swarm.saw("ground/main", "ground/main/confirmed").count(), 0);
    let refused = swarm.saw("ground/main", "ground/main/refused").next().unwrap();
    assert_eq!(refused.happened.event.text("reason"), Some("hold_unsupported"));
}

#[test]
fn a_holder_that_lives_withdraws_it_from_a_home_that_has_restarted() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    let until = 6 * LEASE;
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), until);
    swarm.run(2 * LEASE);
    start_home(&mut swarm, 2, 1);
    let restarted = swarm.now;
    swarm.run(2 * LEASE);
    assert_eq!(steps_since(&swarm, restarted), 0, "what was promised is kept");
    swarm.run(6 * LEASE);
    assert!(steps_since(&swarm, until) > 0, "its holder withdrew it in vain");
}

#[test]
fn a_new_life_that_has_taken_it_over_withdraws_it_while_the_home_is_down() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
    swarm.run(2 * LEASE);
    start_holder(&mut swarm, 2, Bid::new().hold_when_lost(), 5 * LEASE);
    let lost = swarm.now;
    swarm.run(2 * LEASE);
    assert_eq!(steps_since(&swarm, lost), 0, "the new life holds it too");
    swarm.crash("uav/1");
    swarm.run(4 * LEASE);
    start_home(&mut swarm, 2, 1);
    swarm.run(2 * LEASE);
    assert!(steps_since(&swarm, lost) > 0, "its holder withdrew it in vain");
}

#[test]
fn what_a_former_life_has_left_stays_through_a_restart_of_the_home_beside_what_the_present_one_holds() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost(), NEVER);
    swarm.run(2 * LEASE);
    let mut ground = program(1);
    ground.add("other", Always(Bid::new().block("uav/1/turn").hold_when_lost()));
    swarm.start("ground/main", 2, ground);
    let lost = swarm.now;
    swarm.run(2 * LEASE);
    start_home(&mut swarm, 2, 1);
    swarm.run(2 * LEASE);
    assert_eq!(steps_since(&swarm, lost), 0, "a life that never stated it has withdrawn it");
}

#[test]
fn what_an_authority_has_lifted_stays_lifted_while_its_holder_moves_on_with_it() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost().wait_for("ground/main/tick"), NEVER);
    swarm.run(2 * LEASE);
    assert_eq!(swarm.saw("ground/main", "ground/main/confirmed").count(), 1);
    // Both at once: neither knows of the other yet.
    swarm.node("ground/main").enqueue("ground/main/tick");
    lift(&mut swarm);
    let lifted = swarm.now;
    swarm.run(2 * LEASE);
    assert!(steps_since(&swarm, lifted) > 10, "the new statement brought the block back");
    assert_eq!(swarm.saw("ground/main", "ground/main/block_lapsed").count(), 1, "its holder has to know");
    // Now it knows, and may state it anew.
    swarm.node("ground/main").enqueue("ground/main/tick");
    swarm.run(LEASE);
    let stated = swarm.now;
    swarm.run(LEASE);
    assert_eq!(steps_since(&swarm, stated), 0);
}

#[test]
fn the_order_that_lifts_a_block_cannot_be_blocked_by_it() {
    let mut swarm = Swarm::new(&ROSTER, NetworkConfig::default(), 1);
    start_home(&mut swarm, 1, 1);
    start_holder(&mut swarm, 1, Bid::new().hold_when_lost().block("uav/1/**"), NEVER);
    swarm.run(2 * LEASE);
    swarm.crash("ground/main");
    lift(&mut swarm);
    let lifted = swarm.now;
    swarm.run(2 * LEASE);
    assert!(steps_since(&swarm, lifted) > 10);
}
