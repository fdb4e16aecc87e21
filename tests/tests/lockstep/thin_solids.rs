//! What a planar lidar does not see: level and thin.

use std::time::Duration;

use skein_tests::Lockstep;

/// Two vehicles cross two wires, one at the height of the lower and one between the two.
const WIRES: &str = r#"
name = "wires"
model = "x500-vertical-scanner"
time_limit_s = 120.0
[[vehicle]]
start_m = [0.0, -4.0]
waypoints_m = [[28.0, -4.0, 3.0]]
[[vehicle]]
start_m = [0.0, 4.0]
waypoints_m = [[28.0, 4.0, 3.4]]
[[obstacle]]
name = "lower wire"
centre_m = [13.0, 0.0, 3.0]
box_m = [0.03, 30.0, 0.03]
[[obstacle]]
name = "upper wire"
centre_m = [13.0, 0.0, 3.8]
box_m = [0.03, 30.0, 0.03]
"#;

#[test]
fn a_vehicle_with_an_upright_scanner_flies_over_or_under_wires() {
    let mut lockstep = Lockstep::from_text(WIRES);
    let end = Duration::from_secs_f64(lockstep.scenario.time_limit_s);
    while lockstep.swarm.now() < end && !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        lockstep.step();
    }
    let truth = lockstep.swarm.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&skein_agent::Outcome::Complete)));
    assert!(truth.min_clearance_m.unwrap() > 0.1, "{truth:?}");
}
