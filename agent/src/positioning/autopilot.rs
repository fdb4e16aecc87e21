//! The autopilot's own estimate as the source of position.

use nalgebra::Matrix3;
use skein_mav::{Stamped, Telemetry};

use super::estimate::{Attitude, Estimate, Motion};
use super::source::Positioning;

/// Standard deviations that are assumed of what the autopilot tells: position, m, and velocity, m/s.
const MOTION_SIGMA: [f64; 2] = [0.05, 0.1];
/// Standard deviation assumed of its attitude, rad: a degree.
const ATTITUDE_SIGMA_RAD: f64 = 0.0175;

/// Takes the autopilot at its word.
#[derive(Clone, Copy, Debug, Default)]
pub struct Autopilot;

impl Positioning for Autopilot {
    fn estimate(&self, telemetry: &Telemetry) -> Estimate {
        let motion = telemetry.position.zip(telemetry.velocity).map(|(position, velocity)| Stamped {
            stamp: position.stamp,
            value: Motion::new(position.value, velocity.value, MOTION_SIGMA),
        });
        let attitude = telemetry.attitude.zip(telemetry.angular_rate).map(|(attitude, rate)| Stamped {
            stamp: attitude.stamp,
            value: Attitude {
                body_to_world: attitude.value,
                rate: rate.value,
                covariance: Matrix3::from_diagonal_element(ATTITUDE_SIGMA_RAD * ATTITUDE_SIGMA_RAD),
            },
        });
        Estimate { motion, attitude }
    }
}
