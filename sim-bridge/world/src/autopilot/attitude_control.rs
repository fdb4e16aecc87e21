//! The inner loops: a wished attitude becomes rates, and rates become torques.

use nalgebra::{UnitQuaternion, Vector3};

use super::estimator::Estimate;
use super::position_control::AttitudeTarget;
use crate::quadrotor::STEP;
use crate::vehicle::VehicleModel;

/// Bandwidth of the rate loop times the rotors' time constant: with their lag this makes a damping of about
/// 0.75.
const RATE_GAIN_TIMES_LAG: f64 = 0.45;
/// Fastest rate loop whatever the rotors, 1/s.
const MAX_RATE_GAIN: f64 = 25.0;
/// The rate loop about the vertical: reaction torque is weak, 1/s.
const YAW_RATE_GAIN: f64 = 6.0;
/// The attitude loop about the vertical, 1/s.
const YAW_GAIN: f64 = 2.5;
/// Integral of the rate error, relative to its proportional gain, 1/s.
const INTEGRAL_RATE: f64 = 1.0;
/// Largest angular acceleration the integral may hold, rad/s^2.
const MAX_INTEGRAL: f64 = 5.0;
/// Fastest roll and pitch demanded, rad/s.
const MAX_TILT_RATE: f64 = 4.0;
/// Fastest turn demanded, rad/s.
const MAX_TURN_RATE: f64 = 2.0;

/// The inner loops and their memory.
#[derive(Debug, Clone)]
pub(super) struct AttitudeControl {
    inertia: Vector3<f64>,
    attitude_gain: Vector3<f64>,
    rate_gain: Vector3<f64>,
    integral: Vector3<f64>,
}

impl AttitudeControl {
    pub(super) fn new(model: &VehicleModel) -> Self {
        let rate_gain = (RATE_GAIN_TIMES_LAG / model.rotor_time_constant_s).min(MAX_RATE_GAIN);
        let attitude_gain = rate_gain / 3.0;
        Self {
            inertia: Vector3::from(model.inertia),
            attitude_gain: Vector3::new(attitude_gain, attitude_gain, YAW_GAIN.min(attitude_gain)),
            rate_gain: Vector3::new(rate_gain, rate_gain, YAW_RATE_GAIN.min(rate_gain)),
            integral: Vector3::zeros(),
        }
    }

    /// Bandwidth of the tilt loop, 1/s.
    pub(super) fn bandwidth(&self) -> f64 {
        self.attitude_gain.x
    }

    /// Forgets everything, as when standing on the ground.
    pub(super) fn reset(&mut self) {
        self.integral = Vector3::zeros();
    }

    /// One step: torque about the body axes, N m.
    pub(super) fn step(&mut self, estimate: &Estimate, target: &AttitudeTarget) -> Vector3<f64> {
        let rate_error = self.wished_rate(estimate, target) - estimate.angular_rate;
        let wanted = rate_error.component_mul(&self.rate_gain);
        let growth = wanted * (INTEGRAL_RATE * STEP.as_secs_f64());
        self.integral = (self.integral + growth).map(|it| it.clamp(-MAX_INTEGRAL, MAX_INTEGRAL));
        let rate = &estimate.angular_rate;
        let gyroscopic = rate.cross(&self.inertia.component_mul(rate));
        self.inertia.component_mul(&(wanted + self.integral)) + gyroscopic
    }

    fn wished_rate(&self, estimate: &Estimate, target: &AttitudeTarget) -> Vector3<f64> {
        let error = rotation_vector(&(estimate.attitude.inverse() * target.attitude));
        let turn = estimate.attitude.inverse() * Vector3::new(0.0, 0.0, target.yaw_rate);
        let wish = error.component_mul(&self.attitude_gain) + turn;
        let tilt = wish.xy().cap_magnitude(MAX_TILT_RATE);
        Vector3::new(tilt.x, tilt.y, wish.z.clamp(-MAX_TURN_RATE, MAX_TURN_RATE))
    }
}

/// The short way round: twice the vector part, which is the rotation vector for small rotations.
fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    rotation.imag() * 2.0_f64.copysign(rotation.w)
}
