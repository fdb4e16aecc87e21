//! G5: what a lost node requested and blocked lapses with its lease, and those who remain are told.

use std::time::Duration;

use crate::swarm::{Always, LEASE, Requester, Swarm, TICK, hostile, name, program};
use skein_bp::Bid;
use skein_wire::NetworkConfig;

const LONGEST_DELAY: Duration = Duration::from_millis(300);

#[test]
fn the_block_of_a_lost_node_lapses_with_its_lease() {
    for seed in 0..20 {
        let mut swarm = Swarm::new(&["uav/1", "ground/main"], hostile(), seed);
        let mut home = program(seed);
        home.add("steps", Requester::new("uav/1/step", i64::MAX, TICK));
        swarm.start("uav/1", 1, home);
        let mut ground = program(seed);
        ground.add("hold", Always(Bid::new().block("uav/1/step")));
        swarm.start("ground/main", 1, ground);
        swarm.run(Duration::from_secs(4));
        let held = swarm.now;
        swarm.crash("ground/main");
        swarm.run(Duration::from_secs(4));
        let freed = swarm
            .occurred("uav/1", "uav/1/step")
            .map(|seen| seen.at)
            .find(|at| *at >= held)
            .expect("held for ever");
        assert!(freed <= held + LONGEST_DELAY + LEASE + 2 * TICK, "freed only at {freed:?}, seed {seed}");
        let lost: Vec<_> =
            swarm.saw("uav/1", "uav/1/peer_lost").map(|seen| seen.at).filter(|at| *at >= held).collect();
        assert_eq!(lost.len(), 1, "seed {seed}");
        assert!(lost[0] <= held + LONGEST_DELAY + LEASE + 2 * TICK);
    }
}

#[test]
fn the_request_of_a_lost_node_lapses_with_its_lease() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut home = program(1);
    home.add(
        "gate",
        crate::swarm::Blocker {
            blocking: true,
            until: Duration::from_secs(4),
            ..crate::swarm::Blocker::new("uav/1/do", LEASE, LEASE)
        },
    );
    swarm.start("uav/1", 1, home);
    let mut ground = program(1);
    ground.add("ask", Requester::new("uav/1/do", 1, Duration::ZERO));
    swarm.start("ground/main", 1, ground);
    swarm.run(Duration::from_secs(2));
    assert!(!swarm.node("uav/1").explain("uav/1/do").remote.is_empty(), "the request never arrived");
    swarm.crash("ground/main");
    swarm.run(Duration::from_secs(5));
    assert_eq!(swarm.occurred("uav/1", "uav/1/do").count(), 0);
}

#[test]
fn a_partition_heals_without_being_mistaken_for_a_restart() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut home = program(1);
    home.add("steps", Requester::new("uav/1/step", i64::MAX, TICK));
    swarm.start("uav/1", 1, home);
    let mut ground = program(1);
    ground.add("hold", Always(Bid::new().block("uav/1/step")));
    swarm.start("ground/main", 1, ground);
    swarm.run(Duration::from_secs(1));
    swarm.network.partition(&[&[name("uav/1")]]);
    swarm.run(Duration::from_secs(3));
    swarm.network.heal();
    swarm.run(Duration::from_secs(1));
    let healed = swarm.now;
    swarm.run(Duration::from_secs(1));
    for node in ["uav/1", "ground/main"] {
        assert_eq!(swarm.saw(node, &format!("{node}/peer_lost")).count(), 1);
        assert_eq!(swarm.saw(node, &format!("{node}/peer_joined")).count(), 2);
        assert_eq!(swarm.saw(node, &format!("{node}/unknown")).count(), 0);
    }
    assert!(
        swarm.occurred("uav/1", "uav/1/step").all(|seen| seen.at < healed),
        "the block did not come back"
    );
    assert_eq!(swarm.saw("ground/main", "ground/main/confirmed").count(), 2);
    assert_eq!(swarm.saw("ground/main", "ground/main/block_lapsed").count(), 1);
}

#[test]
fn a_process_that_takes_a_name_in_use_is_noticed_by_both() {
    let mut swarm = Swarm::new(&["uav/1", "uav/2"], NetworkConfig::default(), 1);
    swarm.start("uav/1", 5, program(1));
    swarm.start("uav/2", 1, program(1));
    swarm.run(Duration::from_secs(2));
    let other = skein_dbp::Node::new(swarm.config("uav/1", 4), program(1));
    let mut other = skein_wire::NodeLink::new(other, skein_wire::Fleet::new("test").unwrap());
    let mut link = swarm.network.join(&name("uav/1"));
    for _ in 0..50 {
        swarm.tick();
        other.pump(swarm.now, &mut link).unwrap();
    }
    assert_eq!(swarm.saw("uav/1", "uav/1/duplicate_name").count(), 1);
    let noticed = other
        .node_mut()
        .take_selections()
        .iter()
        .filter(|happened| happened.event.name() == "uav/1/duplicate_name")
        .count();
    assert_eq!(noticed, 1);
    let heard = swarm
        .saw("uav/2", "uav/1/duplicate_name")
        .filter(|seen| seen.happened.event.int("incarnation") == Some(4));
    assert_eq!(heard.count(), 1, "others did not hear of it from the node that they trust");
}
