//! Whether the filter knows how well it knows.

use nalgebra::{SVector, Vector3};
use skein_positioning::ekf::{Aid, Ekf, Measurement};

use super::truth::{STEP_S, Sensors, UNIT, pose, velocity};

/// The squared error of position, velocity and attitude by their covariance: 9 on the mean.
fn squared_error(ekf: &Ekf, at_s: f64) -> f64 {
    let (position, attitude) = pose(at_s);
    let state = ekf.state();
    let turn = (state.body_to_world.inverse() * attitude).scaled_axis();
    let parts = [position - state.position, velocity(at_s) - state.velocity, turn];
    let error = SVector::<f64, 9>::from_iterator(parts.iter().flat_map(Vector3::iter).copied());
    error.dot(&state.covariance().cholesky().unwrap().solve(&error))
}

/// What flights of 20 s with a gap of 3 s in the markers show, ticks of all seeds together.
#[derive(Default)]
struct Record {
    ticks: u32,
    beyond_3_sigma: u32,
    squared: f64,
    worst_in_gap_m: f64,
    mean_square_m2: f64,
}

fn fly(seed: u64, delay_steps: usize, record: &mut Record) {
    let mut sensors = Sensors::new(seed);
    let mut ekf = Ekf::new(UNIT, sensors.start());
    let mut late = Vec::new();
    let is_gap = |at_s: f64| (12.0..15.0).contains(&at_s);
    for step in 1..=2000_usize {
        let at_s = step as f64 * STEP_S;
        ekf.feel(sensors.inertial(at_s));
        if step.is_multiple_of(4) && !is_gap(at_s) {
            late.push((step + delay_steps, Measurement::Markers(sensors.markers(at_s - 0.004))));
        }
        if step.is_multiple_of(2) {
            late.push((step + 2, Measurement::Flow(sensors.flow(at_s - 0.007))));
            late.push((step, Measurement::Range(sensors.range(at_s))));
        }
        for (_, measured) in late.extract_if(.., |(due, _)| *due <= step) {
            ekf.measure(measured, true);
        }
        let off = pose(at_s).0 - ekf.state().position;
        if is_gap(at_s) {
            record.worst_in_gap_m = record.worst_in_gap_m.max(off.norm());
        } else if at_s > 3.0 {
            record.mean_square_m2 += off.norm_squared() / 1400.0;
        }
        record.ticks += 1;
        record.squared += squared_error(&ekf, at_s);
        let sigmas = ekf.state().position_sigma_m();
        record.beyond_3_sigma += u32::from((0..3).any(|axis| off[axis].abs() > 3.0 * sigmas[axis]));
    }
    for aid in [Aid::Markers, Aid::Flow, Aid::Range] {
        let fused = ekf.health().of(aid);
        assert!(fused.taken > 100 && fused.refused < fused.taken / 100, "{aid:?}: {fused:?}");
        assert_eq!(fused.unusable, 0, "{aid:?}");
    }
    assert!((ekf.state().flow_scale - sensors.flow_scale).abs() < 0.02, "the scale of flow is learnt");
}

#[test]
fn errors_are_as_large_as_the_covariance_says_with_late_markers_and_without_them_for_3_s() {
    for delay_steps in [0, 8] {
        let mut record = Record::default();
        let seeds = 12;
        (0..seeds).for_each(|seed| fly(seed, delay_steps, &mut record));
        let share = f64::from(record.beyond_3_sigma) / f64::from(record.ticks);
        assert!(share < 0.01, "delay {delay_steps}: {share} beyond 3 sigma on some axis");
        let mean = record.squared / f64::from(record.ticks);
        assert!((6.0..12.0).contains(&mean), "delay {delay_steps}: {mean} in place of 9");
        assert!(record.worst_in_gap_m < 0.1, "delay {delay_steps}: {} m in the gap", record.worst_in_gap_m);
        let rms_m = (record.mean_square_m2 / seeds as f64).sqrt();
        assert!(rms_m < 0.01, "delay {delay_steps}: {rms_m} m");
    }
}
