//! Flights where no satellite is.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;
use skein_wire::event::{Declared as _, FlyBy, PositionDoubted};

const INDOOR: &str = include_str!("../../../sim-bridge/scenarios/indoor.toml");
const FOREST: &str = include_str!("../../../sim-bridge/scenarios/forest.toml");

/// What the first vehicle of a scenario did.
struct Flown {
    outcome: Option<Outcome>,
    /// The sources that were flown, in turn.
    sources: Vec<String>,
    was_doubted: bool,
    /// The greatest error of its estimate, and the most by which that moved in a tick beside its velocity, m.
    error_m: f64,
    step_m: f64,
    /// The share of ticks in which all errors were inside 3 sigma.
    inside: f64,
    crashed: bool,
}

fn fly(scenario: Scenario) -> Flown {
    let mut lockstep = Lockstep::of(scenario);
    let mut flown = Flown {
        outcome: None,
        sources: Vec::new(),
        was_doubted: false,
        error_m: 0.0,
        step_m: 0.0,
        inside: 0.0,
        crashed: false,
    };
    let (mut ticks, mut inside) = (0.0, 0.0);
    let mut last: Option<(Duration, Vector3<f64>)> = None;
    let end = Duration::from_secs(180);
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) && lockstep.swarm.now() < end {
        let happened = lockstep.step();
        for event in happened.selections.iter().map(|selection| &selection.event) {
            if event.name() == format!("uav/1/{}", FlyBy::NAME) {
                flown.sources.extend(FlyBy::read(event).map(|chosen| chosen.source.to_string()));
            }
            flown.was_doubted |= event.name() == format!("uav/1/{}", PositionDoubted::NAME);
        }
        let now = lockstep.swarm.now();
        let truth = lockstep.swarm.simulation().vehicle(0).unwrap();
        let estimate = *lockstep.swarm.agents().next().unwrap().estimate();
        flown.crashed |= truth.crashed;
        let Some(motion) = estimate.motion.filter(|_| happened.ticked && truth.airborne) else { continue };
        let (position, _) = estimate.pose_at(now).unwrap();
        let error = position - truth.motion.position;
        flown.error_m = flown.error_m.max(error.norm());
        ticks += 1.0;
        let is_inside = (0..3).all(|axis| error[axis].abs() < 3.0 * motion.value.axis_sigma_m(axis));
        inside += f64::from(u8::from(is_inside));
        if let Some((before, at)) = last.replace((now, position)) {
            let moved = position - at - motion.value.velocity * (now - before).as_secs_f64();
            flown.step_m = flown.step_m.max(moved.norm());
        }
    }
    flown.inside = inside / ticks;
    flown.outcome = lockstep.swarm.outcomes().next().flatten().cloned();
    flown
}

fn indoor(more: &str, seed: u64) -> Flown {
    fly(Scenario::from_toml(&format!("{INDOOR}\n{more}"), "indoor.toml", None, seed).unwrap())
}

#[test]
fn a_vehicle_without_satellites_flies_past_obstacles_by_markers() {
    let flown = indoor("", 2);
    assert_eq!((flown.outcome, flown.crashed), (Some(Outcome::Complete), false));
    assert!(flown.error_m < 0.15 && flown.step_m < 0.05, "{} {}", flown.error_m, flown.step_m);
    assert!(flown.inside > 0.99, "{}", flown.inside);
    assert!(!flown.was_doubted);
}

#[test]
fn markers_missed_for_three_seconds_are_flown_through_and_for_good_end_in_a_landing() {
    let missed = "[[position_fault]]\nat_s = 10.0\nmarkers_missed = true\n";
    let flown = indoor(&format!("{missed}for_s = 3.0\n"), 2);
    assert_eq!((flown.outcome, flown.crashed), (Some(Outcome::Complete), false));
    assert_eq!(flown.sources.get(..2).unwrap(), ["dead_reckoning", "markers"], "{:?}", flown.sources);
    assert!(flown.error_m < 0.15 && flown.step_m < 0.05, "{} {}", flown.error_m, flown.step_m);
    assert!(!flown.was_doubted && flown.inside > 0.99);

    let flown = indoor(missed, 2);
    assert!(matches!(flown.outcome, Some(Outcome::Failed(_))) && !flown.crashed, "{:?}", flown.outcome);
    assert!(flown.was_doubted && flown.error_m < 0.5, "{}", flown.error_m);
}

#[test]
fn without_markers_and_flow_it_holds_and_lands_before_it_has_drifted_far() {
    let both = "[[position_fault]]\nat_s = 10.0\nmarkers_missed = true\n\
                [[position_fault]]\nat_s = 10.0\nflow_lost = true\n";
    let flown = indoor(both, 2);
    assert!(matches!(flown.outcome, Some(Outcome::Failed(_))), "{:?}", flown.outcome);
    assert!(flown.was_doubted);
}

#[test]
fn a_forest_in_which_satellites_are_lost_is_flown_by_lidar() {
    let text = format!(
        "position = [\"autopilot\", \"lidar\"]\n{FOREST}\n[[position_fault]]\nat_s = 12.0\ngps_lost = true\n"
    );
    let flown = fly(Scenario::from_toml(&text, "forest.toml", Some(1), 1).unwrap());
    assert_eq!((flown.outcome, flown.crashed), (Some(Outcome::Complete), false));
    assert_eq!(flown.sources.first().map(String::as_str), Some("lidar"));
    assert!(flown.error_m < 0.5 && flown.step_m < 0.05, "{} {}", flown.error_m, flown.step_m);
}
