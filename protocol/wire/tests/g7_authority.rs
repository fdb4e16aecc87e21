//! G7: a bid outside its sender's rights counts for nothing, and both ends are told why.

use crate::swarm::{Always, LEASE, Requester, Swarm, TICK, hostile, program};
use skein_bp::{Bid, EventSet};
use skein_dbp::{Authority, Grant, NodeConfig, Role};

/// The ground may request all and block `step`; vehicles may block `enter`; scripts may request `step` at most.
fn authority() -> Authority {
    let role = |name: &str, nodes: &str, request: EventSet, block: &str| Role {
        name: name.into(),
        nodes: vec![nodes.into()],
        grant: Grant { request, block: block.into() },
    };
    Authority::new(
        vec![
            role("ground", "ground/*", "uav/*/*".into(), "uav/*/step"),
            role("vehicle", "uav/*", EventSet::None, "uav/*/enter"),
        ],
        Some(Grant { request: "uav/*/step".into(), block: EventSet::None }),
    )
}

fn swarm(seed: u64) -> Swarm {
    let mut swarm = Swarm::new(&["uav/1", "uav/2", "ground/main", "other/one"], hostile(), seed);
    let config = NodeConfig { authority: authority(), ..swarm.config("uav/1", 1) };
    let mut home = program(seed);
    home.add("enters", Requester::new("uav/1/enter", i64::MAX, TICK));
    swarm.start_with(config, home);
    swarm
}

/// The reasons that `node` was given, and those that the home has noted for it.
fn reasons(swarm: &Swarm, node: &str) -> (Vec<String>, Vec<String>) {
    let text = |seen: &crate::swarm::Seen, key: &str| seen.happened.event.text(key).unwrap().to_owned();
    let refusal = format!("{node}/refused");
    let refused = swarm.saw(node, &refusal).map(|seen| text(seen, "reason"));
    let denied = swarm
        .occurred("uav/1", "uav/1/denied")
        .filter(|seen| text(seen, "node") == node)
        .map(|seen| text(seen, "reason"));
    (refused.collect(), denied.collect())
}

fn both(reason: &str) -> (Vec<String>, Vec<String>) {
    (vec![reason.to_owned()], vec![reason.to_owned()])
}

#[test]
fn what_a_role_grants_is_honoured() {
    for seed in 0..10 {
        let mut swarm = swarm(seed);
        let mut ground = program(seed);
        ground.add("ask", Requester::new("uav/1/step", 3, TICK));
        swarm.start("ground/main", 1, ground);
        let mut other = program(seed);
        other.add(
            "hold",
            Always(Bid::new().block(EventSet::from("uav/*/enter").and(EventSet::from("uav/2/*").not()))),
        );
        swarm.start("uav/2", 1, other);
        swarm.run(8 * LEASE);
        let held = swarm.now - 4 * LEASE;
        assert_eq!(swarm.occurred("uav/1", "uav/1/step").count(), 3, "seed {seed}");
        assert_eq!(
            swarm.occurred("uav/1", "uav/1/enter").filter(|seen| seen.at > held).count(),
            0,
            "seed {seed}"
        );
        assert_eq!(reasons(&swarm, "ground/main"), (vec![], vec![]));
        assert_eq!(reasons(&swarm, "uav/2"), (vec![], vec![]));
    }
}

#[test]
fn a_request_beyond_ones_rights_is_never_served_and_both_ends_say_so() {
    for seed in 0..10 {
        let mut swarm = swarm(seed);
        for node in ["uav/2", "other/one"] {
            let mut asker = program(seed);
            asker.add("ask", Requester::new("uav/1/step", 1, TICK));
            swarm.start(node, 1, asker);
        }
        swarm.run(5 * LEASE);
        assert_eq!(swarm.occurred("uav/1", "uav/1/step").count(), 0, "seed {seed}");
        assert_eq!(reasons(&swarm, "uav/2"), both("may_not_request"), "seed {seed}");
        assert_eq!(reasons(&swarm, "other/one"), both("may_not_request"), "one without a role, seed {seed}");
    }
}

#[test]
fn a_block_of_more_than_ones_rights_blocks_nothing_and_is_never_confirmed() {
    for seed in 0..10 {
        let mut swarm = swarm(seed);
        let mut ground = program(seed);
        ground.add("hold", Always(Bid::new().block("uav/1/**")));
        swarm.start("ground/main", 1, ground);
        swarm.run(5 * LEASE);
        let since = swarm.now - LEASE;
        assert!(swarm.occurred("uav/1", "uav/1/enter").any(|seen| seen.at > since), "seed {seed}");
        assert_eq!(swarm.saw("ground/main", "ground/main/confirmed").count(), 0);
        assert_eq!(reasons(&swarm, "ground/main"), both("may_not_block"), "seed {seed}");
    }
}

#[test]
fn a_script_needs_its_nodes_rights_and_those_of_scripts() {
    let mut swarm = swarm(1);
    for (node, granted) in [("ground/main", true), ("uav/2", false)] {
        let mut program = program(1);
        program.add("script/walk", Requester::new("uav/1/step", 1, TICK));
        program.add("script/run", Requester::new("uav/1/run", 1, TICK));
        swarm.start(node, 1, program);
        swarm.run(3 * LEASE);
        assert_eq!(
            swarm.occurred("uav/1", "uav/1/step").count(),
            1,
            "the ground's is served, the vehicle's not"
        );
        assert_eq!(swarm.occurred("uav/1", "uav/1/run").count(), 0);
        let refused = if granted { 1 } else { 2 };
        assert_eq!(swarm.saw(node, &format!("{node}/refused")).count(), refused);
    }
}
