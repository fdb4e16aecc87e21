//! Single answers that can be worked out by hand.

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector2, Vector3};
use skein_positioning::ekf::{
    Aid, Ekf, Flow, Heading, Inertial, Measurement, Noise, Pressure, Range, Rest, Satellites, Start,
};
use skein_positioning::{PlanarFix, PoseFix};

use super::truth::GRAVITY;

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn start() -> Start {
    Start {
        stamp: Duration::ZERO,
        position: Vector3::new(0.0, 0.0, 2.0),
        position_sigma_m: 0.2,
        velocity: Vector3::zeros(),
        velocity_sigma_m_s: 0.1,
        body_to_world: UnitQuaternion::identity(),
        tilt_sigma_rad: 0.01,
        heading_sigma_rad: 0.1,
    }
}

/// A filter of a vehicle that has hovered for so long.
fn hovering(until: Duration) -> Ekf {
    let mut ekf = Ekf::new(Noise::SMALL, start());
    hover(&mut ekf, until);
    ekf
}

fn hover(ekf: &mut Ekf, until: Duration) {
    while ekf.state().stamp < until {
        let stamp = ekf.state().stamp + ms(10);
        ekf.feel(Inertial { stamp, rate: Vector3::zeros(), force: GRAVITY });
    }
}

fn marker(stamp: Duration, position: Vector3<f64>) -> Measurement {
    let covariance = Matrix6::from_diagonal_element(1e-4);
    Measurement::Markers(PoseFix { stamp, position, body_to_world: UnitQuaternion::identity(), covariance })
}

#[test]
fn a_turn_on_the_spot_turns_the_heading_and_moves_nothing() {
    let mut ekf = Ekf::new(Noise::SMALL, start());
    for step in 1..=100 {
        let rate = Vector3::z() * FRAC_PI_2;
        ekf.feel(Inertial { stamp: ms(10 * step), rate, force: GRAVITY });
    }
    let (_, _, yaw) = ekf.state().body_to_world.euler_angles();
    assert!((yaw - FRAC_PI_2).abs() < 1e-9);
    assert!((ekf.state().position - start().position).norm() < 1e-9);
}

#[test]
fn a_late_fix_is_taken_in_as_if_it_had_come_in_time() {
    let (fix, place) = (ms(150), Vector3::new(0.3, -0.2, 2.1));
    let mut timely = hovering(ms(150));
    timely.measure(marker(fix, place), true);
    hover(&mut timely, ms(400));
    let mut late = hovering(ms(400));
    late.measure(marker(fix, place), true);
    // A fix of the future waits for its time, and one between two samples is taken between them.
    let mut early = hovering(ms(100));
    early.measure(marker(fix, place), true);
    assert_eq!(early.health().of(Aid::Markers).taken, 0);
    hover(&mut early, ms(400));
    for other in [&late, &early] {
        assert!((timely.state().position - other.state().position).norm() < 1e-12);
        assert!((timely.state().covariance() - other.state().covariance()).norm() < 1e-12);
    }
    let mut between = hovering(ms(400));
    between.measure(marker(ms(153), place), true);
    assert!((timely.state().position - between.state().position).norm() < 1e-3);
    late.measure(marker(ms(1), place), true);
    hover(&mut late, ms(1400));
    late.measure(marker(ms(800), place), true);
    let markers = late.health().of(Aid::Markers);
    assert_eq!((markers.taken, markers.unusable), (1, 2), "more than half a second is too late");
}

#[test]
fn what_noise_does_not_explain_is_refused_and_told() {
    let mut ekf = hovering(ms(500));
    for step in 1..=10 {
        ekf.measure(marker(ms(500), Vector3::new(0.0, 0.0, 2.0)), true);
        hover(&mut ekf, ms(500 + 10 * step));
    }
    let before = ekf.state().clone();
    ekf.measure(marker(ms(600), Vector3::new(3.0, 0.0, 2.0)), true);
    let markers = ekf.health().of(Aid::Markers);
    assert_eq!(*ekf.state(), before);
    assert_eq!((markers.refused, markers.off_since), (1, Some(ms(600))));
    assert!(markers.ratio > 100.0);
    // Nor does what is only held against the state change it.
    ekf.measure(marker(ms(600), Vector3::new(0.01, 0.0, 2.0)), false);
    assert_eq!((ekf.state(), ekf.health().of(Aid::Markers).off_since), (&before, None));
}

#[test]
fn what_is_no_number_or_has_no_covariance_changes_nothing() {
    let mut ekf = hovering(ms(500));
    let before = ekf.state().clone();
    let fix = |position, covariance| {
        let body_to_world = UnitQuaternion::identity();
        Measurement::Markers(PoseFix { stamp: ms(500), position, body_to_world, covariance })
    };
    let nan = Vector3::new(f64::NAN, 0.0, 2.0);
    ekf.measure(fix(nan, Matrix6::identity()), true);
    ekf.measure(fix(Vector3::zeros(), Matrix6::identity() * -1.0), true);
    ekf.measure(fix(Vector3::zeros(), Matrix6::from_element(f64::NAN)), true);
    ekf.feel(Inertial { stamp: ms(510), rate: Vector3::zeros(), force: Vector3::repeat(f64::INFINITY) });
    ekf.feel(Inertial { stamp: ms(500), rate: Vector3::zeros(), force: GRAVITY });
    assert_eq!(*ekf.state(), before);
    assert_eq!(ekf.health().of(Aid::Markers).unusable, 3);
}

#[test]
fn a_planar_fix_corrects_the_level_and_the_heading_and_leaves_the_height() {
    let mut ekf = hovering(ms(500));
    let position = Vector2::new(0.1, -0.1);
    for step in 1..=50 {
        let covariance = Matrix3::from_diagonal_element(1e-6);
        let fix = PlanarFix { stamp: ms(500 + 10 * step), position, heading_rad: 0.15, covariance };
        hover(&mut ekf, fix.stamp);
        ekf.measure(Measurement::Lidar(fix), true);
    }
    let state = ekf.state();
    assert!((state.position.xy() - position).norm() < 0.01, "{}", state.position);
    assert!((state.body_to_world.euler_angles().2 - 0.15).abs() < 0.005);
    assert!((state.position.z - 2.0).abs() < 0.02, "{}", state.position);
}

#[test]
fn flow_tells_velocity_and_a_range_height() {
    let mut ekf = hovering(ms(500));
    let flow = |stamp| Flow {
        stamp,
        rate: Vector2::new(0.05, 0.0),
        sigma_rad_s: 0.01,
        distance_m: 2.0,
        distance_sigma_m: 0.01,
    };
    let range = |stamp| Range { stamp, distance_m: 1.9, sigma_m: 0.01, half_cone_rad: 0.2, ground_m: 0.2 };
    for step in 1..=10 {
        let stamp = ms(500 + 10 * step);
        hover(&mut ekf, stamp);
        ekf.measure(Measurement::Flow(flow(stamp)), true);
        ekf.measure(Measurement::Range(range(stamp)), true);
    }
    assert!((ekf.state().velocity.x - 0.1).abs() < 0.02, "{}", ekf.state().velocity);
    assert!((ekf.state().position.z - 2.1).abs() < 0.01, "{}", ekf.state().position);
}

#[test]
fn satellites_bound_an_error_that_pressure_and_inertia_let_grow() {
    let place = Vector3::new(0.2, 0.1, 2.0);
    let fix = |stamp| Satellites {
        stamp,
        position: place,
        velocity: Vector3::zeros(),
        horizontal_m: 0.5,
        vertical_m: 0.8,
        velocity_m_s: 0.1,
    };
    let pressure = |stamp| Pressure { stamp, height_m: 32.0, sigma_m: 0.1 };
    let sigma = |has_satellites: bool| {
        let mut ekf = hovering(ms(100));
        for step in 1..=100 {
            let stamp = ms(100 + 100 * step);
            hover(&mut ekf, stamp);
            ekf.measure(Measurement::Pressure(pressure(stamp)), true);
            if has_satellites {
                ekf.measure(Measurement::Satellites(fix(stamp)), true);
            }
        }
        ekf.state().position_sigma_m()
    };
    let (with, without) = (sigma(true), sigma(false));
    assert!(with[0] < 0.2 && with[2] < 0.3, "{with:?}");
    assert!(without[0] > 1.0 && without[0] > 5.0 * with[0], "{without:?}");
}

#[test]
fn a_gap_in_what_is_felt_makes_the_filter_less_sure() {
    let mut felt = hovering(ms(2000));
    hover(&mut felt, ms(3000));
    let mut gap = hovering(ms(2000));
    gap.feel(Inertial { stamp: ms(3000), rate: Vector3::zeros(), force: GRAVITY });
    assert!(gap.state().position_sigma_m()[0] > 2.0 * felt.state().position_sigma_m()[0]);
}

#[test]
fn a_shift_moves_the_place_and_keeps_the_motion() {
    let mut ekf = hovering(ms(500));
    let before = ekf.state().clone();
    ekf.shift(&Vector3::x(), &Matrix3::from_diagonal_element(0.25));
    assert_eq!(ekf.state().position, before.position + Vector3::x());
    assert_eq!(ekf.state().velocity, before.velocity);
    assert_eq!(ekf.state().position_sigma_m(), [0.5; 3]);
    hover(&mut ekf, ms(600));
    ekf.measure(marker(ms(550), Vector3::new(1.0, 0.0, 2.0)), true);
    assert_eq!(ekf.health().of(Aid::Markers).taken, 1);
}

#[test]
fn standing_still_teaches_the_biases_and_keeps_the_place() {
    let mut ekf = Ekf::new(Noise::SMALL, start());
    let turns_too_much = Vector3::new(0.004, -0.003, 0.005);
    for step in 1..=2000 {
        let stamp = ms(10 * step);
        ekf.feel(Inertial { stamp, rate: turns_too_much, force: GRAVITY });
        ekf.measure(Measurement::Rest(Rest { stamp, sigma_m_s: 0.02, sigma_rad_s: 0.01 }), true);
    }
    assert!((ekf.state().rate_bias - turns_too_much).norm() < 5e-4, "{}", ekf.state().rate_bias);
    assert!((ekf.state().position - start().position).norm() < 0.05);
}

#[test]
fn a_compass_turns_the_heading_and_nothing_else() {
    let mut ekf = hovering(ms(500));
    let (roll, pitch, _) = ekf.state().body_to_world.euler_angles();
    for _ in 0..100 {
        let heading = Heading { stamp: ms(500), heading_rad: 0.1, sigma_rad: 0.05 };
        ekf.measure(Measurement::Heading(heading), true);
    }
    let turned = ekf.state().body_to_world.euler_angles();
    assert!((turned.2 - 0.1).abs() < 0.005, "{turned:?}");
    assert!((turned.0 - roll).abs() < 1e-3 && (turned.1 - pitch).abs() < 1e-3);
}
