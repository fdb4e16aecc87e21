//! A behaviour shapes motion: not above a height near a neighbour, and every vehicle arrives.

use std::fs;
use std::time::Duration;

use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;

const KEEP_LOW: &str = include_str!("../../../agent/scripts/keep-low.toml");
/// The statement that makes the difference.
const STATEMENT: &str = "state = { name = \"{me}/limit\", data = { max_z = \"{ceiling_m}\" } }, ";
/// Vehicles that start further from one another than they are to be low, and meet in the middle.
const SWAP: &str = r#"
    generator = "antipodal"
    vehicles = 4
    cruise_speed_m_s = 2.0
    takeoff_height_m = 6.0
    time_limit_s = 180.0
    [antipodal]
    radius_m = 20.0
    height_m = 6.0
    [[script]]
    file = "keep-low.toml"
    with = { ceiling_m = 4.0 }"#;
const CEILING_M: f64 = 4.0;
const NEAR_M: f64 = 10.0;

/// How a flight went.
struct Flown {
    /// How far above the ceiling a vehicle near another one was, m; negative if none was above.
    highest_m: f64,
    /// Whether somebody was above the ceiling at all.
    is_high_elsewhere: bool,
    /// Whether each vehicle was explained to be limited by the script.
    explained: Vec<bool>,
    arrived: bool,
}

fn fly(script: &str, seed: u64) -> Flown {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("keep-low.toml"), script).unwrap();
    let beside = folder.path().join("swap.toml");
    let scenario = Scenario::from_toml(SWAP, beside.to_str().unwrap(), None, seed).unwrap();
    let mut lockstep = Lockstep::of(scenario);
    let mut flown = Flown {
        highest_m: f64::NEG_INFINITY,
        is_high_elsewhere: false,
        explained: vec![false; 4],
        arrived: false,
    };
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        lockstep.step();
        assert!(lockstep.swarm.now() < Duration::from_secs(180), "it is not over");
        let simulation = lockstep.swarm.simulation();
        let armed: Vec<_> = (0..4).map(|index| simulation.vehicle(index).unwrap()).collect();
        let places: Vec<_> =
            armed.iter().map(|vehicle| vehicle.motion.position).filter(|place| place.z > 0.5).collect();
        for place in &places {
            let is_near =
                |other: &&nalgebra::Vector3<f64>| *other != place && (*other - place).norm() < NEAR_M;
            if places.iter().any(|other| is_near(&other)) {
                flown.highest_m = flown.highest_m.max(place.z - CEILING_M);
            } else {
                flown.is_high_elsewhere |= place.z > CEILING_M + 1.0;
            }
        }
        if lockstep.swarm.now().as_millis().is_multiple_of(1000) {
            for (index, vehicle) in lockstep.nodes[..4].iter().enumerate() {
                let explanation = lockstep.swarm.ground().explain(vehicle);
                let names_it = |limit: &String| limit == "script/keep-low limits z to at most 4 m";
                flown.explained[index] |=
                    explanation.is_some_and(|explanation| explanation.limits.iter().any(names_it));
            }
        }
    }
    let truth = lockstep.swarm.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    flown.arrived = lockstep.swarm.outcomes().all(|outcome| outcome == Some(&Outcome::Complete));
    flown
}

#[test]
fn near_a_neighbour_vehicles_stay_under_the_ceiling_and_all_arrive() {
    for seed in 1..=10 {
        let Flown { highest_m, is_high_elsewhere, explained, arrived } = fly(KEEP_LOW, seed);
        assert!(highest_m <= 0.0 && highest_m > -2.0, "seed {seed}: {highest_m} m above the ceiling");
        assert!(is_high_elsewhere, "seed {seed}: the limit is lifted where nobody is near");
        assert!(explained.iter().all(|explained| *explained), "seed {seed}: {explained:?}");
        assert!(arrived, "seed {seed}");
    }
}

#[test]
fn a_script_that_drops_the_limit_does_not_keep_it() {
    assert!(KEEP_LOW.contains(STATEMENT));
    let Flown { highest_m, explained, arrived, .. } = fly(&KEEP_LOW.replace(STATEMENT, ""), 1);
    assert!(highest_m > 1.0, "{highest_m}");
    assert!(arrived && explained == [false; 4]);
}
