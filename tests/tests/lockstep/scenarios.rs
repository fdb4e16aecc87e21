//! The built-in scenarios fly, and nothing flies without b-threads.

use skein_sim::cli::Controller;
use skein_sim::summary::{Collisions, Summary};
use skein_tests::{flight, fly};

/// Succeeded, at this separation at least, with events that crossed the network.
fn assert_flown(summary: &Summary, separation_m: f64) {
    assert_eq!(summary.reason, None, "{} seed {}", summary.scenario, summary.seed);
    assert_eq!(summary.collisions, Collisions { obstacle: 0, vehicle: 0 });
    let closest_m = summary.min_separation_m.unwrap_or(f64::INFINITY);
    assert!(closest_m >= separation_m, "{} seed {}: {closest_m} m", summary.scenario, summary.seed);
    assert!(summary.events.remote > 0 && summary.network.messages > 0);
}

#[test]
fn eight_cross_a_forest_they_have_never_seen() {
    for seed in [1, 17, 47] {
        assert_flown(&fly(flight("forest", seed)), 1.0);
    }
}

#[test]
fn eight_swap_places_across_a_circle() {
    for seed in [1, 20] {
        assert_flown(&fly(flight("antipodal", seed)), 1.0);
    }
}

#[test]
fn sixteen_swap_places_across_a_circle() {
    let mut flight = flight("antipodal", 2);
    flight.world.overrides.vehicles = Some(16);
    assert_flown(&fly(flight), 1.0);
}

#[test]
fn two_groups_pass_one_opening_both_ways() {
    for seed in [4, 17] {
        assert_flown(&fly(flight("window", seed)), 0.6);
    }
}

#[test]
fn four_cross_an_empty_field() {
    assert_flown(&fly(flight("open", 1)), 1.0);
}

#[test]
fn without_b_threads_nothing_flies() {
    let mut flight = flight("open", 1);
    flight.controller = Controller::None;
    let summary = fly(flight);
    assert!(!summary.succeeded);
    assert!(summary.per_vehicle.iter().all(|vehicle| vehicle.flight_time_s == 0.0));
}
