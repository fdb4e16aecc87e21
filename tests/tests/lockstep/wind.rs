//! A vehicle turns at its point of no return: whatever the wind, it lands at home.

use std::time::Duration;

use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;

const X500: &str = include_str!("../../../sim-bridge/world/vehicles/x500.toml");

/// A vehicle that leans little and has a small battery.
struct Vehicle {
    tilt_rad: f64,
    capacity_wh: f64,
}

const SMALL: Vehicle = Vehicle { tilt_rad: 0.2, capacity_wh: 12.0 };

/// The end of a flight.
#[derive(Debug)]
struct Flown {
    /// Farthest from home, and where it landed, m.
    farthest_m: f64,
    landed_m: f64,
    outcome: Option<Outcome>,
}

/// Flies 250 m out towards `course_rad` and back, in this wind, m/s.
fn fly(vehicle: &Vehicle, course_rad: f64, wind: [f64; 2], gust_m_s: f64, seed: u64) -> Flown {
    let folder = tempfile::tempdir().unwrap();
    let model = X500
        .replace("max_tilt_rad = 0.61", &format!("max_tilt_rad = {}", vehicle.tilt_rad))
        .replace("capacity_wh = 74.0", &format!("capacity_wh = {}", vehicle.capacity_wh));
    std::fs::write(folder.path().join("small.toml"), model).unwrap();
    let (x, y) = (250.0 * course_rad.cos(), 250.0 * course_rad.sin());
    let text = format!(
        "model = \"small.toml\"\ncruise_speed_m_s = 4.0\n[bounds]\nmin_m = [-400.0, -400.0, -1.0]\n\
         max_m = [400.0, 400.0, 40.0]\n[wind]\nmean_m_s = [{:?}, {:?}, 0.0]\ngust_m_s = {gust_m_s:?}\n\
         [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[{x:?}, {y:?}, 6.0], [0.0, 0.0, 6.0]]\n",
        wind[0], wind[1]
    );
    let path = folder.path().join("there.toml");
    let scenario = Scenario::from_toml(&text, path.to_str().unwrap(), None, seed).unwrap();
    let mut lockstep = Lockstep::of(scenario);
    let mut farthest_m: f64 = 0.0;
    let place = |lockstep: &Lockstep| lockstep.swarm.simulation().vehicle(0).unwrap();
    while lockstep.swarm.now() < Duration::from_secs(400) && !lockstep.swarm.is_over() {
        lockstep.step();
        farthest_m = farthest_m.max(place(&lockstep).motion.position.xy().norm());
    }
    let end = place(&lockstep);
    Flown {
        farthest_m,
        landed_m: end.motion.position.xy().norm(),
        outcome: lockstep.swarm.outcomes().next().unwrap().cloned(),
    }
}

fn failure(flown: &Flown) -> &str {
    match &flown.outcome {
        Some(Outcome::Failed(why)) => why,
        _ => "",
    }
}

#[test]
fn out_with_the_wind_it_turns_in_time_and_says_that_it_is_the_wind() {
    let nimble = Vehicle { tilt_rad: 0.3, ..SMALL };
    for (vehicle, course_rad, wind) in [
        (&SMALL, 0.0, [6.0, 0.0]),
        (&SMALL, 0.0, [7.0, 0.0]),
        (&SMALL, 2.0, [-5.0, 5.0]),
        (&nimble, 0.0, [9.0, 0.0]),
    ] {
        let flown = fly(vehicle, course_rad, wind, 1.0, 1);
        assert!(failure(&flown).contains("s home in a wind of"), "{wind:?}: {flown:?}");
        assert!(flown.landed_m < 2.0, "{wind:?}: {flown:?}");
        assert!((60.0..180.0).contains(&flown.farthest_m), "{wind:?}: {flown:?}");
    }
}

#[test]
fn without_wind_or_with_a_battery_that_holds_it_the_wind_is_no_reason() {
    let flown = fly(&SMALL, 0.0, [0.0, 0.0], 0.0, 1);
    assert_eq!((failure(&flown), flown.landed_m < 2.0), ("battery low", true), "{flown:?}");
    assert!(flown.farthest_m > 200.0, "{flown:?}");
    let full = Vehicle { capacity_wh: 30.0, ..SMALL };
    let flown = fly(&full, 0.0, [5.0, 0.0], 1.0, 1);
    assert_eq!(flown.outcome, Some(Outcome::Complete), "{flown:?}");
}

#[test]
fn a_mission_that_the_battery_does_not_hold_is_not_begun() {
    let flown = fly(&Vehicle { capacity_wh: 9.0, ..SMALL }, 0.0, [0.0, 0.0], 0.0, 1);
    assert_eq!((flown.outcome, flown.farthest_m), (None, 0.0));
}
