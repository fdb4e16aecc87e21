//! One vehicle alone through places 1.2 m wide.

use std::time::Duration;

use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;

/// A wall 0.3 m thick with a door.
const DOOR: &str = r#"
[[obstacle]]
centre_m = [0.0, 10.6, 4.0]
box_m = [0.3, 20.0, 10.0]
[[obstacle]]
centre_m = [0.0, -10.6, 4.0]
box_m = [0.3, 20.0, 10.0]
[[vehicle]]
start_m = [-9.0, 3.0]
waypoints_m = [[9.0, -2.0, 2.0]]
"#;

const CORRIDOR: &str = r#"
[[obstacle]]
centre_m = [0.0, 10.6, 4.0]
box_m = [14.0, 20.0, 10.0]
[[obstacle]]
centre_m = [0.0, -10.6, 4.0]
box_m = [14.0, 20.0, 10.0]
[[vehicle]]
start_m = [-11.0, 2.0]
waypoints_m = [[11.0, -2.0, 2.0]]
"#;

/// East, and then north. South of it there is a little room along the fence, which leads nowhere.
const BEND: &str = r#"
[[obstacle]]
centre_m = [-4.6, 10.6, 4.0]
box_m = [8.0, 20.0, 10.0]
[[obstacle]]
centre_m = [-4.0, -6.7, 4.0]
box_m = [9.2, 12.2, 10.0]
[[obstacle]]
centre_m = [6.6, 0.4, 4.0]
box_m = [12.0, 14.0, 10.0]
[[vehicle]]
start_m = [-11.0, 0.5]
waypoints_m = [[2.5, 10.5, 2.0]]
"#;

/// Whether it arrives without touching anything, and how long that takes, s.
fn fly(walls: &str, seed: u64) -> Option<f64> {
    let text = format!("[bounds]\nmin_m = [-14.0, -13.0, -1.0]\nmax_m = [14.0, 13.0, 9.0]\n{walls}");
    let scenario = Scenario::from_toml(&text, "narrow.toml", None, seed).unwrap();
    let mut lockstep = Lockstep::of(scenario);
    while lockstep.swarm.now() < Duration::from_secs(120) && !lockstep.swarm.is_over() {
        lockstep.step();
    }
    let arrived = lockstep.swarm.outcomes().next().unwrap() == Some(&Outcome::Complete);
    let touched = lockstep.swarm.truth().collisions_obstacle > 0;
    (arrived && !touched).then(|| lockstep.swarm.now().as_secs_f64())
}

#[test]
fn a_door_a_corridor_and_a_bend_of_twelve_decimetres_are_flown_through() {
    for (name, walls) in [("door", DOOR), ("corridor", CORRIDOR), ("bend", BEND)] {
        for seed in [1, 2, 3] {
            assert!(fly(walls, seed).is_some(), "{name}, seed {seed}");
        }
    }
}
