//! What sends little light back is seen late: then it is braked for hard, which is counted, and never touched.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;

/// A flight towards a wall across the way.
struct Flown {
    arrived: bool,
    touched: u32,
    hard_brakes: u64,
    /// How far the nose was off the way, at most, after the first ten metres, rad.
    nose_off_way: f64,
}

fn fly(reflectivity: f64, nose: &str, seed: u64) -> Flown {
    let text = format!(
        "local = \"vfh\"\nnose = \"{nose}\"\ncruise_speed_m_s = 5.0\n\
         [bounds]\nmin_m = [-45.0, -25.0, -1.0]\nmax_m = [55.0, 25.0, 12.0]\n\
         [[obstacle]]\ncentre_m = [15.0, 0.0, 4.0]\nbox_m = [1.0, 24.0, 8.0]\nreflectivity = {reflectivity:?}\n\
         [[vehicle]]\nstart_m = [-40.0, 0.0]\nyaw_rad = 1.0\nwaypoints_m = [[45.0, 0.0, 3.0]]\n"
    );
    let mut lockstep = Lockstep::of(Scenario::from_toml(&text, "wall.toml", None, seed).unwrap());
    let mut nose_off_way: f64 = 0.0;
    while lockstep.swarm.now() < Duration::from_secs(200) && !lockstep.swarm.is_over() {
        lockstep.step();
        let motion = &lockstep.swarm.simulation().vehicle(0).unwrap().motion;
        if (-30.0..-10.0).contains(&motion.position.x) {
            let nose = motion.attitude * Vector3::x();
            nose_off_way = nose_off_way.max(nose.xy().angle(&motion.velocity.xy()));
        }
    }
    Flown {
        arrived: lockstep.swarm.outcomes().next().unwrap() == Some(&Outcome::Complete),
        touched: lockstep.swarm.truth().collisions_obstacle,
        hard_brakes: lockstep.swarm.agents().next().unwrap().set_points().hard_brakes,
        nose_off_way,
    }
}

#[test]
fn a_dark_wall_is_braked_for_hard_and_a_white_one_gently() {
    for (reflectivity, is_dark) in [(0.02, true), (1.0, false)] {
        for seed in [1, 2] {
            let flown = fly(reflectivity, "along", seed);
            assert!(flown.arrived && flown.touched == 0, "{reflectivity}, seed {seed}");
            assert_eq!(flown.hard_brakes > 0, is_dark, "{reflectivity}, seed {seed}: {}", flown.hard_brakes);
        }
    }
}

#[test]
fn the_nose_points_along_the_way_or_stays_as_configured() {
    let [along, held] = ["along", "held"].map(|nose| fly(1.0, nose, 1).nose_off_way);
    assert!(along < 0.15, "{along}");
    assert!((held - 1.0).abs() < 0.15, "{held}");
}
