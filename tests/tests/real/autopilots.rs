//! Real autopilots in the simulated world, where `SKEIN_PX4` and `SKEIN_ARDUPILOT` name their programs.

use std::path::PathBuf;

use skein_sim::autopilots::{Autopilots, make::Make};
use skein_tests::{flight, fly};

use crate::turn::turn;

/// The program that a variable names; says that the test is left out without one.
fn program(variable: &str) -> Option<PathBuf> {
    let named = std::env::var_os(variable).map(PathBuf::from);
    if named.is_none() {
        skein_tests::skipped(&format!("{variable}, the path of that autopilot's program"));
    }
    named
}

fn flies(scenario: &str, vehicles: usize, autopilots: Autopilots) {
    let _turn = turn();
    let mut flight = flight(scenario, 1);
    flight.world.overrides.vehicles = Some(vehicles);
    flight.autopilots = autopilots;
    let summary = fly(flight);
    assert!(summary.succeeded, "{:?}", summary.reason);
    assert_eq!((summary.collisions.obstacle, summary.collisions.vehicle), (0, 0));
    assert!(summary.min_separation_m.is_some_and(|apart_m| apart_m >= 1.4), "{:?}", summary.min_separation_m);
    assert_eq!(summary.trace_hash, None, "such a run does not replay");
}

#[test]
fn px4s_swap_places_across_a_circle() {
    let Some(px4) = program("SKEIN_PX4") else { return };
    flies("antipodal", 4, Autopilots { autopilot: Some(Make::Px4), px4: Some(px4), ..Autopilots::default() });
}

#[test]
fn arducopters_swap_places_across_a_circle() {
    let Some(ardupilot) = program("SKEIN_ARDUPILOT") else { return };
    let autopilots =
        Autopilots { autopilot: Some(Make::Ardupilot), ardupilot: Some(ardupilot), ..Autopilots::default() };
    flies("antipodal", 4, autopilots);
}
