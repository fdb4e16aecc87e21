//! A vehicle that is not where it believes to be.

use std::time::Duration;

use nalgebra::Vector3;
use skein_world::{Drift, PositionErrors, PositionFault, PositionFaultKind, WindConfig};

use crate::flight::{Flight, at, velocity, x500};

/// Hovers three metres up, in offboard; the fault begins at 20 s.
fn hovering(drift: Drift, kind: Option<PositionFaultKind>, lasts_s: Option<u64>) -> Flight {
    let fault =
        |kind| PositionFault { at: Duration::from_secs(20), lasts: lasts_s.map(Duration::from_secs), kind };
    let errors = PositionErrors { drift, faults: kind.map(fault).into_iter().collect() };
    let mut flight = Flight::misled(x500(), 3, WindConfig::default(), errors);
    flight.until("ready to arm", 10.0, |flight| flight.telemetry().ready_to_arm);
    flight.take_off(3.0);
    flight.set_point = Some(velocity(0.0, 0.0, 0.0));
    flight.run(0.5);
    flight.command(skein_mav::Command::Offboard);
    flight.until_mode(skein_mav::FlightMode::Offboard);
    flight.run(19.9 - flight.now().as_secs_f64());
    flight
}

fn believed(flight: &Flight) -> Vector3<f64> {
    flight.telemetry().position.unwrap().value
}

fn error(flight: &Flight) -> Vector3<f64> {
    believed(flight) - flight.truth().motion.position
}

#[test]
fn a_drift_is_believed_and_its_accuracy_told() {
    let drift = Drift { sigma_m: 1.0, sigma_vertical_m: 0.5, correlation_s: 60.0, told_m: None };
    let mut flight = hovering(drift, None, None);
    let mut errors = Vec::new();
    for _ in 0..60 {
        flight.run(5.0);
        errors.push(error(&flight));
    }
    let sigma = |axis: usize| (errors.iter().map(|e| e[axis] * e[axis]).sum::<f64>() / 60.0).sqrt();
    assert!((0.3..2.0).contains(&sigma(0)) && (0.3..2.0).contains(&sigma(1)), "{} {}", sigma(0), sigma(1));
    assert!((0.1..1.2).contains(&sigma(2)), "{}", sigma(2));
    let [horizontal_m, vertical_m] = flight.telemetry().position_sigma_m.unwrap().value;
    assert!((1.0..1.1).contains(&horizontal_m) && (0.5..0.6).contains(&vertical_m));
    // Whoever does not ask for accuracy is told what is configured.
    let told = hovering(Drift { told_m: Some([0.1, 0.2]), ..drift }, None, None);
    assert!((told.telemetry().position_sigma_m.unwrap().value[0] - 0.1).abs() < 1e-6);
}

#[test]
fn a_jump_moves_the_belief_and_not_the_vehicle() {
    let by = at(8.0, 0.0, 1.0);
    let mut flight = hovering(Drift::default(), Some(PositionFaultKind::Jump(by)), Some(5));
    let (before, place) = (believed(&flight), flight.truth().motion.position);
    flight.run(0.5);
    assert!((believed(&flight) - before - by).norm() < 0.3, "{}", believed(&flight) - before);
    assert!(flight.telemetry().velocity.unwrap().value.norm() < 0.3);
    flight.run(3.0);
    assert!((flight.truth().motion.position - place).norm() < 1.0, "zero velocity holds it");
    flight.run(3.0);
    assert!(error(&flight).norm() < 0.3, "{}", error(&flight));
}

#[test]
fn without_satellites_it_says_so_and_is_less_and_less_sure() {
    let mut flight = hovering(Drift::default(), Some(PositionFaultKind::GpsLost), Some(20));
    let sigma_m = |flight: &Flight| flight.telemetry().position_sigma_m.unwrap().value[0];
    assert!(sigma_m(&flight) < 0.05 && flight.telemetry().has_gps_fix == Some(true));
    flight.run(15.0);
    assert!(sigma_m(&flight) > 0.3, "{}", sigma_m(&flight));
    assert_eq!(flight.telemetry().has_gps_fix, Some(false));
    flight.run(8.0);
    assert!(sigma_m(&flight) < 0.05 && flight.telemetry().has_gps_fix == Some(true));
}

#[test]
fn what_is_told_freezes_is_late_or_begins_anew() {
    let mut frozen = hovering(Drift::default(), Some(PositionFaultKind::Freezes), Some(2));
    frozen.set_point = Some(velocity(1.0, 0.0, 0.0));
    frozen.run(1.5);
    let position = frozen.telemetry().position.unwrap();
    assert!(position.age(frozen.now()) > Duration::from_millis(1200));
    frozen.run(1.0);
    assert!(frozen.telemetry().position.unwrap().age(frozen.now()) < Duration::from_millis(50));

    let half = Duration::from_millis(500);
    let mut late = hovering(Drift::default(), Some(PositionFaultKind::Late(half)), None);
    late.run(1.5);
    let age = late.telemetry().position_age.unwrap();
    assert!((450..550).contains(&age.as_millis()), "{age:?}");

    let mut reset = hovering(Drift::default(), Some(PositionFaultKind::Resets), None);
    reset.run(2.0);
    assert_eq!(reset.telemetry().restarts, 1);
    assert!(reset.truth().airborne && error(&reset).norm() < 0.3);
}

#[test]
fn a_moved_origin_changes_no_position_in_the_world() {
    let by = at(13.0, 4.0, 1.0);
    let mut flight = hovering(Drift::default(), Some(PositionFaultKind::OriginMoves(by)), None);
    let origin = flight.telemetry().local_origin;
    flight.run(2.0);
    assert_ne!(flight.telemetry().local_origin, origin);
    assert!(error(&flight).norm() < 0.3, "{}", error(&flight));
}
