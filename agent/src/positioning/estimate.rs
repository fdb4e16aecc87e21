//! The estimate of a vehicle's state: pose, velocity and their covariance, stamped.

use std::time::Duration;

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3};
use skein_mav::Stamped;

use super::plausibility::Doubt;

/// Standard deviation of a position that every margin allows for, m.
pub const NOMINAL_SIGMA_M: f64 = 0.05;
/// Standard deviations by which what hangs on an absolute position is widened.
const SIGMAS: f64 = 2.0;

/// The addition to a margin for a position of this standard deviation: its possible error, beyond what every margin
/// allows for, m.
pub fn excess_m(sigma_m: f64) -> f64 {
    SIGMAS * (sigma_m - NOMINAL_SIGMA_M).max(0.0)
}

/// Position and velocity. World ENU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub position: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Covariance of position (rows 0 to 2) and velocity (rows 3 to 5), m and m/s, squared.
    pub covariance: Matrix6<f64>,
}

impl Motion {
    /// A motion whose errors are independent: standard deviations of the position east and north and of its height, m,
    /// and of the velocity on all axes, m/s.
    pub fn new(
        position: Vector3<f64>,
        velocity: Vector3<f64>,
        [horizontal_m, vertical_m, velocity_m_s]: [f64; 3],
    ) -> Self {
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).fill_diagonal(horizontal_m * horizontal_m);
        covariance[(2, 2)] = vertical_m * vertical_m;
        covariance.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(velocity_m_s * velocity_m_s);
        Self { position, velocity, covariance }
    }

    /// Standard deviation of the position on an axis: 0 is east, 1 north, 2 up.
    pub fn axis_sigma_m(&self, axis: usize) -> f64 {
        self.covariance[(axis, axis)].sqrt()
    }

    /// Standard deviation of the position along its least certain direction at most, m: exact if the axes are
    /// independent.
    pub fn position_sigma_m(&self) -> f64 {
        // No eigenvalue of a matrix exceeds its greatest sum of a row's magnitudes (Gershgorin).
        let position = self.covariance.fixed_view::<3, 3>(0, 0);
        position.row_iter().map(|row| row.abs().sum()).fold(0.0, f64::max).sqrt()
    }
}

/// Orientation and its rate of change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Body FLU to world ENU.
    pub body_to_world: UnitQuaternion<f64>,
    /// Angular rate, body FLU, rad/s.
    pub rate: Vector3<f64>,
    /// Covariance of the orientation about the body's axes, rad squared.
    pub covariance: Matrix3<f64>,
}

/// A vehicle's state as far as its source of position knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    pub motion: Option<Stamped<Motion>>,
    pub attitude: Option<Stamped<Attitude>>,
    /// By how much the frame of positions has jumped since the beginning, m ENU: what was placed by earlier estimates
    /// is to be shifted by as much.
    pub frame: Vector3<f64>,
    /// The reason not to fly by it now, if there is one.
    pub doubt: Option<Doubt>,
    /// The cause that still widens its covariance, if there is one.
    pub shock: Option<Doubt>,
}

impl Estimate {
    /// When motion and attitude were measured.
    pub fn stamps(&self) -> [Option<Duration>; 2] {
        [self.motion.map(|motion| motion.stamp), self.attitude.map(|attitude| attitude.stamp)]
    }

    /// Whether motion and attitude are both younger than `limit`.
    pub fn is_fresh(&self, now: Duration, limit: Duration) -> bool {
        self.stamps().iter().all(|stamp| stamp.is_some_and(|stamp| now.saturating_sub(stamp) < limit))
    }

    /// Position and orientation at a time near both stamps, from rates.
    pub fn pose_at(&self, at: Duration) -> Option<(Vector3<f64>, UnitQuaternion<f64>)> {
        let (motion, attitude) = (self.motion?, self.attitude?);
        let lead_s = |stamp: Duration| (at.as_secs_f64() - stamp.as_secs_f64()).clamp(-0.2, 0.2);
        let position = motion.value.position + motion.value.velocity * lead_s(motion.stamp);
        // A degree of tilt is a hand's breadth at the far wall of a room.
        let turned = UnitQuaternion::from_scaled_axis(attitude.value.rate * lead_s(attitude.stamp));
        Some((position, attitude.value.body_to_world * turned))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_deviation_of_independent_axes_is_exact_and_that_of_others_not_too_small() {
        let mut motion = Motion::new(Vector3::zeros(), Vector3::zeros(), [0.05, 0.05, 0.1]);
        assert_eq!(motion.position_sigma_m(), 0.05);
        let tall = Motion::new(Vector3::zeros(), Vector3::zeros(), [0.3, 0.7, 0.1]);
        assert_eq!((tall.axis_sigma_m(1), tall.axis_sigma_m(2)), (0.3, 0.7));
        // Long from south-west to north-east: variances of 1.9 and 0.1.
        motion.covariance[(0, 0)] = 1.0;
        motion.covariance[(1, 1)] = 1.0;
        (motion.covariance[(0, 1)], motion.covariance[(1, 0)]) = (0.9, 0.9);
        assert!((motion.position_sigma_m() - 1.9_f64.sqrt()).abs() < 1e-12);
    }
}
