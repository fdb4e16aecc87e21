//! The autopilot's own estimate as the source of position.

use std::time::Duration;

use nalgebra::Matrix3;
use skein_mav::{Stamped, Telemetry};

use super::estimate::{Attitude, Estimate, Motion, NOMINAL_SIGMA_M};
use super::plausibility::Plausibility;
use super::source::Positioning;

/// Standard deviation that is assumed of its velocity, m/s.
const VELOCITY_SIGMA_M_S: f64 = 0.1;
/// Standard deviation assumed of its attitude, rad: a degree.
const ATTITUDE_SIGMA_RAD: f64 = 0.0175;
/// An estimate that is not older than this when it arrives counts as new: so well clocks are compared.
const NEGLIGIBLE_AGE: Duration = Duration::from_millis(50);

/// Takes the autopilot at its word, as long as that is plausible.
#[derive(Clone, Debug, Default)]
pub struct Autopilot {
    plausibility: Plausibility,
}

impl Positioning for Autopilot {
    fn estimate(&mut self, now: Duration, telemetry: &Telemetry) -> Estimate {
        // No estimator is believed to be better than one that tells nothing.
        let told_m = telemetry.position_sigma_m.map_or([0.0; 2], |told| told.value);
        let [horizontal_m, vertical_m] = told_m.map(|sigma_m| sigma_m.max(NOMINAL_SIGMA_M));
        self.plausibility.look(now, telemetry, horizontal_m.max(vertical_m));
        let jumped_m = self.plausibility.sigma_m(now);
        let sigmas = [horizontal_m.hypot(jumped_m), vertical_m.hypot(jumped_m), VELOCITY_SIGMA_M_S];
        let age = telemetry.position_age.filter(|age| *age > NEGLIGIBLE_AGE).unwrap_or_default();
        let motion = telemetry.position.zip(telemetry.velocity).map(|(position, velocity)| Stamped {
            stamp: position.stamp.saturating_sub(age),
            value: Motion::new(position.value, velocity.value, sigmas),
        });
        let attitude = telemetry.attitude.zip(telemetry.angular_rate).map(|(attitude, rate)| Stamped {
            stamp: attitude.stamp,
            value: Attitude {
                body_to_world: attitude.value,
                rate: rate.value,
                covariance: Matrix3::from_diagonal_element(ATTITUDE_SIGMA_RAD * ATTITUDE_SIGMA_RAD),
            },
        });
        Estimate {
            motion,
            attitude,
            frame: self.plausibility.frame(),
            doubt: self.plausibility.doubt(now, telemetry),
            shock: self.plausibility.shock(),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    fn telemetry(now: Duration) -> Telemetry {
        Telemetry {
            position: Some(Stamped { stamp: now, value: Vector3::zeros() }),
            velocity: Some(Stamped { stamp: now, value: Vector3::zeros() }),
            attitude: Some(Stamped { stamp: now, value: UnitQuaternion::identity() }),
            angular_rate: Some(Stamped { stamp: now, value: Vector3::zeros() }),
            ..Telemetry::default()
        }
    }

    #[test]
    fn the_estimator_tells_the_standard_deviations_of_each_axis_and_never_less_than_nominal() {
        let now = Duration::from_secs(9);
        let sigmas = |told: Option<[f64; 2]>| {
            let position_sigma_m = told.map(|value| Stamped { stamp: now, value });
            let telemetry = Telemetry { position_sigma_m, ..telemetry(now) };
            let motion = Autopilot::default().estimate(now, &telemetry).motion.unwrap().value;
            (motion.axis_sigma_m(0), motion.axis_sigma_m(1), motion.axis_sigma_m(2))
        };
        assert_eq!(sigmas(None), (0.05, 0.05, 0.05));
        assert_eq!(sigmas(Some([0.01, 0.02])), (0.05, 0.05, 0.05));
        let (east, north, up) = sigmas(Some([0.8, 1.5]));
        assert!((east - 0.8).abs() < 1e-9 && (north - 0.8).abs() < 1e-9 && (up - 1.5).abs() < 1e-9);
    }

    #[test]
    fn a_late_estimate_is_as_old_as_the_clocks_say() {
        let now = Duration::from_secs(9);
        let stamp = |age_ms| {
            let position_age = Some(Duration::from_millis(age_ms));
            let telemetry = Telemetry { position_age, ..telemetry(now) };
            Autopilot::default().estimate(now, &telemetry).motion.unwrap().stamp
        };
        assert_eq!(stamp(30), now);
        assert_eq!(stamp(450), Duration::from_millis(8550));
    }
}
