//! Equal seeds give equal runs, faults and all.

use std::time::Duration;

use crate::swarm::{Blocker, Requester, Swarm, hostile, program};

fn run(seed: u64) -> (Vec<String>, skein_wire::NetworkStats) {
    let fleet = ["uav/1", "uav/2", "ground/main"];
    let mut swarm = Swarm::new(&fleet, hostile(), seed);
    for node in &fleet[..2] {
        let mut program = program(seed);
        program.add("fly", Requester::new(&format!("{node}/advance"), 100, Duration::from_millis(40)));
        swarm.start(node, 1, program);
    }
    let mut ground = program(seed);
    ground.add("hold", Blocker::new("uav/*/advance", Duration::from_secs(1), Duration::from_secs(1)));
    ground.add("ask", Requester::new("uav/1/order", 10, Duration::from_millis(100)));
    swarm.start("ground/main", 1, ground);
    swarm.run(Duration::from_secs(5));
    let stats = swarm.network.stats();
    (swarm.seen.iter().map(|seen| format!("{seen:?}")).collect(), stats)
}

#[test]
fn equal_seeds_give_equal_runs_and_others_differ() {
    assert_eq!(run(7), run(7));
    assert_ne!(run(7).0, run(8).0);
}
