//! Vehicles that are not where they believe to be.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_sim::summary::{Collisions, Summary};
use skein_tests::{Lockstep, flight, fly};
use skein_wire::event::{Declared as _, FenceBreached, PositionDoubted, PositionTrusted};

/// A scenario's file with more in it, flown whole.
fn fly_text(text: &str, seed: u64, vehicles: Option<usize>) -> Summary {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.toml");
    std::fs::write(&file, text).unwrap();
    let mut flight = flight(file.to_str().unwrap(), seed);
    flight.world.overrides.vehicles = vehicles;
    fly(flight)
}

fn assert_flown(summary: &Summary, least_m: f64) {
    assert_eq!(summary.reason, None, "seed {}", summary.seed);
    assert_eq!(summary.collisions, Collisions { obstacle: 0, vehicle: 0 });
    assert!(summary.min_separation_m.unwrap() >= least_m, "seed {}", summary.seed);
}

const OPEN: &str =
    "generator = \"open\"\nvehicles = 4\n[open]\nspacing_m = 8.0\n[position_error]\nsigma_m = 1.0\n";

#[test]
fn four_cross_a_field_though_each_is_a_metre_beside_where_it_believes_to_be() {
    for seed in [1, 6, 10] {
        assert_flown(&fly_text(OPEN, seed, None), 1.4);
    }
}

#[test]
fn three_cross_a_forest_with_a_drift_of_thirty_centimetres() {
    let forest = include_str!("../../../sim-bridge/scenarios/forest.toml");
    let text = format!("{forest}\n[position_error]\nsigma_m = 0.3\n");
    for seed in [1, 5, 7] {
        assert_flown(&fly_text(&text, seed, Some(3)), 1.4);
    }
}

#[test]
fn an_honest_drift_is_told_and_raises_no_alarm() {
    let mut lockstep = Lockstep::of(Scenario::from_toml(OPEN, "open.toml", None, 2).unwrap());
    let mut told_m: f64 = 0.0;
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        let happened = lockstep.step();
        let is_alarm =
            |name: &str| name.ends_with(FenceBreached::NAME) || name.ends_with(PositionDoubted::NAME);
        assert!(!happened.selections.iter().any(|selection| is_alarm(selection.event.name())));
        if lockstep.swarm.now() > Duration::from_secs(5) {
            let states = lockstep.swarm.agents().map(|agent| agent.position_sigma_m());
            told_m = states.fold(told_m, f64::max);
        }
    }
    assert!((1.0..1.2).contains(&told_m), "{told_m}");
}

/// What one vehicle did in which the fault of this table began at 15 s, on a way of 50 m eastward.
struct Flown {
    /// When its position was doubted first, and trusted last, s; and why it was doubted.
    doubted_s: Option<f64>,
    trusted_s: Option<f64>,
    why: String,
    /// The greatest standard deviation that it told, m.
    told_m: f64,
    /// Its way from where it was when the doubt began until it went on, m.
    strayed_m: f64,
    /// Its greatest speed while it was doubted, a second and a half after the doubt began, m/s.
    held_m_s: f64,
    outcome: Option<Outcome>,
}

fn flown(fault: &str) -> Flown {
    let text = format!(
        "time_limit_s = 90.0\n[bounds]\nmin_m = [-30.0, -30.0, -1.0]\nmax_m = [80.0, 30.0, 15.0]\n\
         [[position_fault]]\nat_s = 15.0\n{fault}\n\
         [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[50.0, 0.0, 3.0]]\n"
    );
    let mut lockstep = Lockstep::from_text(&text);
    let mut flown = Flown {
        doubted_s: None,
        trusted_s: None,
        why: String::new(),
        told_m: 0.0,
        strayed_m: 0.0,
        held_m_s: 0.0,
        outcome: None,
    };
    let mut from: Option<Vector3<f64>> = None;
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        let happened = lockstep.step();
        let now_s = lockstep.swarm.now().as_secs_f64();
        let motion = lockstep.swarm.simulation().vehicle(0).unwrap().motion;
        for selection in &happened.selections {
            if let Some(doubted) =
                PositionDoubted::read(&selection.event).filter(|_| flown.doubted_s.is_none())
            {
                (flown.doubted_s, flown.why) = (Some(now_s), doubted.why.to_string());
                from = Some(motion.position);
            }
            if selection.event.name() == format!("uav/1/{}", PositionTrusted::NAME) {
                flown.trusted_s = Some(now_s);
            }
        }
        let sigma_m = lockstep.swarm.agents().next().unwrap().position_sigma_m();
        flown.told_m = flown.told_m.max(sigma_m);
        if let (Some(from), None, Some(since_s)) = (from, flown.trusted_s, flown.doubted_s) {
            flown.strayed_m = flown.strayed_m.max((motion.position - from).xy().norm());
            if now_s > since_s + 1.5 {
                flown.held_m_s = flown.held_m_s.max(motion.velocity.xy().norm());
            }
        }
    }
    assert_eq!(lockstep.swarm.truth().collisions_vehicle + lockstep.swarm.truth().collisions_obstacle, 0);
    flown.outcome = lockstep.swarm.outcomes().next().unwrap().cloned();
    flown
}

/// It noticed the fault soon, named it, stopped without being thrown, and went on.
fn assert_goes_on(fault: &str, why: &str, most_strayed_m: f64) -> Flown {
    let flown = flown(fault);
    assert!(
        flown.doubted_s.is_some_and(|at_s| (15.0..16.5).contains(&at_s)),
        "{fault}: {:?}",
        flown.doubted_s
    );
    assert!(flown.why.contains(why), "{fault}: {}", flown.why);
    assert!(flown.strayed_m < most_strayed_m, "{fault}: it strayed {} m", flown.strayed_m);
    assert!(flown.held_m_s < 0.6, "{fault}: it flew {} m/s", flown.held_m_s);
    assert_eq!(flown.outcome, Some(Outcome::Complete), "{fault}");
    assert!(flown.trusted_s.is_some(), "{fault}");
    flown
}

/// It stopped, and landed where it was.
fn assert_lands(fault: &str, why: &str, most_strayed_m: f64) {
    let flown = flown(fault);
    assert!(
        matches!(&flown.outcome, Some(Outcome::Failed(said)) if said.contains(why)),
        "{:?}",
        flown.outcome
    );
    assert!(flown.strayed_m < most_strayed_m, "{fault}: it strayed {} m", flown.strayed_m);
}

#[test]
fn a_jump_stops_the_vehicle_widens_what_it_tells_and_does_not_throw_it() {
    let aside = assert_goes_on("jump_m = [0.0, -8.0, 0.0]", "jumped by 8", 4.0);
    assert!(aside.told_m > 7.5, "{}", aside.told_m);
    assert_goes_on("jump_m = [0.0, 2.0, 0.0]", "jumped by 2", 4.0);
    assert_goes_on("jump_m = [0.0, 0.0, 2.0]", "jumped by", 4.0);
}

#[test]
fn a_glitch_that_ends_leaves_no_doubt() {
    let flown = assert_goes_on("jump_m = [8.0, 8.0, 0.0]\nfor_s = 3.0", "jumped by 11", 4.0);
    // Three seconds after the second jump, which brought it back.
    assert!(flown.trusted_s.unwrap() < 15.0 + 3.0 + 3.5, "{:?}", flown.trusted_s);
}

#[test]
fn a_jump_beyond_all_doubt_lands_the_vehicle_where_it_is() {
    assert_lands("jump_m = [0.0, -25.0, 0.0]", "jumped by 25", 5.0);
}

#[test]
fn a_moved_origin_a_frozen_or_late_estimate_lost_satellites_and_a_restart_are_survived() {
    assert_goes_on("origin_moves_m = [13.0, 0.0, 1.0]", "origin moved", 4.0);
    assert_goes_on("freezes = true\nfor_s = 3.0", "frozen", 4.0);
    assert_goes_on("late_s = 0.5\nfor_s = 4.0", "late", 4.0);
    assert_goes_on("gps_lost = true\nfor_s = 5.0", "satellites", 4.0);
    assert_goes_on("resets = true", "anew", 4.0);
}

#[test]
fn an_estimate_that_stays_away_lands_the_vehicle() {
    assert_lands("freezes = true", "frozen", 5.0);
    assert_lands("late_s = 0.5", "late", 5.0);
    // Without satellites the autopilot drifts on its way down.
    assert_lands("gps_lost = true", "satellites", 15.0);
}

#[test]
fn an_autopilot_that_says_that_it_is_uncertain_by_three_metres_does_not_take_off() {
    let text = "time_limit_s = 20.0\n[position_error]\nsigma_m = 0.1\ntold_m = 3.0\n\
                [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[20.0, 0.0, 3.0]]\n";
    let mut lockstep = Lockstep::from_text(text);
    lockstep.run_until(Duration::from_secs(20));
    assert!(!lockstep.swarm.simulation().vehicle(0).unwrap().airborne);
    let status = lockstep.swarm.agents().next().unwrap().status(lockstep.swarm.now());
    assert!(status.waiting_for.contains("uncertain by 3.0 m, more than 2 m"), "{}", status.waiting_for);
}
