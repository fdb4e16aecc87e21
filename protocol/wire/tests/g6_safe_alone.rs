//! G6: safety events never wait for the network, and remote requests for them enter through one gateway.

use std::time::Duration;

use crate::swarm::{Always, Requester, Swarm, TICK, program};
use skein_bp::{Bid, EventSet};
use skein_dbp::NodeConfig;
use skein_wire::NetworkConfig;

fn vehicle(swarm: &mut Swarm, bid: Bid) {
    let mut home = program(1);
    home.add("own", Requester::new("uav/1/land", 1, Duration::ZERO));
    home.add("other", Always(bid));
    let config = NodeConfig { safety: EventSet::from("uav/1/land"), ..swarm.config("uav/1", 1) };
    swarm.start_with(config, home);
}

#[test]
fn a_remote_block_of_everything_does_not_stop_a_safety_event() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut ground = program(1);
    ground.add("hold", Always(Bid::new().block(EventSet::All)));
    swarm.start("ground/main", 1, ground);
    let mut home = program(1);
    home.add("land", Requester::new("uav/1/land", 1, Duration::ZERO));
    home.add(
        "wait",
        crate::swarm::Blocker {
            blocking: true,
            until: Duration::from_secs(1),
            ..crate::swarm::Blocker::new("uav/1/land", TICK, 5 * TICK)
        },
    );
    home.add("fly", Requester::new("uav/1/fly", 1000, TICK));
    let config = NodeConfig { safety: EventSet::from("uav/1/land"), ..swarm.config("uav/1", 1) };
    swarm.start_with(config, home);
    swarm.run(Duration::from_millis(900));
    assert_eq!(swarm.occurred("uav/1", "uav/1/land").count(), 0, "the vehicle's own b-threads may block it");
    let flown = swarm.occurred("uav/1", "uav/1/fly").count();
    swarm.run(Duration::from_secs(2));
    assert_eq!(swarm.occurred("uav/1", "uav/1/land").count(), 1);
    assert_eq!(swarm.occurred("uav/1", "uav/1/fly").count(), flown, "the remote block blocked nothing");
}

#[test]
fn a_safety_event_cannot_be_requested_from_afar_and_the_refusal_is_told() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut ground = program(1);
    ground.add("ask", Requester::new("uav/1/land", 1, Duration::ZERO));
    swarm.start("ground/main", 1, ground);
    let config = NodeConfig { safety: EventSet::from("uav/1/land"), ..swarm.config("uav/1", 1) };
    swarm.start_with(config, program(1));
    swarm.run(Duration::from_secs(3));
    assert_eq!(swarm.occurred("uav/1", "uav/1/land").count(), 0);
    let refused: Vec<_> = swarm.saw("ground/main", "ground/main/refused").collect();
    assert!(!refused.is_empty());
    assert!(refused.iter().all(|seen| seen.happened.event.text("reason") == Some("safety")));
}

#[test]
fn an_order_enters_by_the_gateway_whoever_else_blocks_it() {
    let mut swarm = Swarm::new(&["uav/1", "uav/2", "ground/main"], NetworkConfig::default(), 1);
    let mut other = program(1);
    other.add("obstinate", Always(Bid::new().block("uav/1/**")));
    swarm.start("uav/2", 1, other);
    let config = NodeConfig { safety: EventSet::from("uav/1/**"), ..swarm.config("uav/1", 1) };
    swarm.start_with(config, program(1));
    let mut ground = program(1);
    ground.add("ask", Requester::new("uav/1/order", 1, Duration::ZERO));
    swarm.start("ground/main", 1, ground);
    swarm.run(Duration::from_secs(1));
    assert_eq!(swarm.occurred("uav/1", "uav/1/order").count(), 1);
}

#[test]
fn a_vehicle_alone_goes_on_without_any_network() {
    let mut swarm =
        Swarm::new(&["uav/1", "ground/main"], NetworkConfig { loss: 1.0, ..Default::default() }, 1);
    vehicle(&mut swarm, Bid::new().wait_for("uav/1/land"));
    swarm.tick();
    assert_eq!(swarm.occurred("uav/1", "uav/1/land").count(), 1);
}

#[test]
fn a_nodes_facts_cannot_be_forged_from_afar() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut ground = program(1);
    ground.add("liar", Requester::new("uav/1/confirmed", 1, Duration::ZERO));
    swarm.start("ground/main", 1, ground);
    swarm.start("uav/1", 1, program(1));
    swarm.run(Duration::from_secs(2));
    assert_eq!(swarm.occurred("uav/1", "uav/1/confirmed").count(), 0);
    let reason = swarm
        .saw("ground/main", "ground/main/refused")
        .next()
        .unwrap()
        .happened
        .event
        .text("reason")
        .map(str::to_owned);
    assert_eq!(reason.as_deref(), Some("reserved"));
}
