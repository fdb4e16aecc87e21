//! Vehicles without lidars, as those of shows and surveys are: they fly by what they say to one another.

use std::time::Duration;

use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;

#[test]
fn vehicles_without_lidars_swap_places_and_keep_apart() {
    for seed in [1, 2] {
        let mut scenario = Scenario::built_in("antipodal", Some(4), seed).unwrap();
        for vehicle in &mut scenario.vehicles {
            vehicle.model.lidar = None;
        }
        let mut lockstep = Lockstep::of(scenario);
        while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
            lockstep.step();
            assert!(lockstep.swarm.now() < Duration::from_secs(90), "seed {seed}: it is not over");
        }
        assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&Outcome::Complete)));
        let truth = lockstep.swarm.truth();
        assert_eq!(truth.collisions_vehicle, 0);
        let closest_m = truth.min_separation_m.unwrap();
        assert!(closest_m >= 1.4, "seed {seed}: {closest_m} m");
    }
}
