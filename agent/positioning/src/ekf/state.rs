//! The state of a filter and the covariance of its error, predicted and corrected.

use std::time::Duration;

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::health::Weighed;
use super::{Inertial, Noise, Start};

/// Standard gravity, m/s².
pub(super) const GRAVITY_M_S2: f64 = 9.806_65;

/// Where the parts of the error stand.
pub(super) const POSITION: usize = 0;
pub(super) const VELOCITY: usize = 3;
pub(super) const ATTITUDE: usize = 6;
pub(super) const FORCE_BIAS: usize = 9;
pub(super) const RATE_BIAS: usize = 12;
pub(super) const FLOW_SCALE: usize = 15;
pub(super) const PRESSURE_OFFSET: usize = 16;
pub(super) const SIZE: usize = 17;

pub(super) type Covariance = SMatrix<f64, SIZE, SIZE>;

/// The errors of a unit that has just been switched on, as standard deviations.
const FORCE_BIAS_M_S2: f64 = 0.1;
const RATE_BIAS_RAD_S: f64 = 0.01;
const FLOW_SCALE_SHARE: f64 = 0.1;
const PRESSURE_OFFSET_M: f64 = 2.0;
/// The walk of flow's scale, 1/√s, and of the air's pressure, m/√s.
const FLOW_SCALE_WALK: f64 = 1e-3;
const PRESSURE_WALK: f64 = 0.02;
/// Over a longer time than this the inertial unit was not listened to: what it may have felt then, m/s² and rad/s.
const LONGEST_STEP_S: f64 = 0.1;
const UNFELT_M_S2: f64 = 3.0;
const UNFELT_RAD_S: f64 = 0.5;

/// A vehicle's motion, and what is wrong with its instruments.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub stamp: Duration,
    /// World ENU, m.
    pub position: Vector3<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
    /// Body FLU to world ENU.
    pub body_to_world: UnitQuaternion<f64>,
    /// Bias of the accelerometer, body FLU, m/s².
    pub force_bias: Vector3<f64>,
    /// Bias of the gyroscope, body FLU, rad/s.
    pub rate_bias: Vector3<f64>,
    /// The share by which optical flow tells too much.
    pub flow_scale: f64,
    /// Bias of the barometer, m.
    pub pressure_offset_m: f64,
    /// Angular rate by the newest sample, body FLU, rad/s.
    pub rate: Vector3<f64>,
    pub(super) covariance: Covariance,
}

impl State {
    pub(super) fn new(start: &Start) -> Self {
        let tilt = start.tilt_sigma_rad;
        let attitude = Vector3::new(tilt, tilt, start.heading_sigma_rad);
        let mut sigmas = SVector::<f64, SIZE>::zeros();
        sigmas.fixed_rows_mut::<3>(POSITION).fill(start.position_sigma_m);
        sigmas.fixed_rows_mut::<3>(VELOCITY).fill(start.velocity_sigma_m_s);
        sigmas.fixed_rows_mut::<3>(ATTITUDE).copy_from(&attitude);
        sigmas.fixed_rows_mut::<3>(FORCE_BIAS).fill(FORCE_BIAS_M_S2);
        sigmas.fixed_rows_mut::<3>(RATE_BIAS).fill(RATE_BIAS_RAD_S);
        sigmas[FLOW_SCALE] = FLOW_SCALE_SHARE;
        sigmas[PRESSURE_OFFSET] = PRESSURE_OFFSET_M;
        Self {
            stamp: start.stamp,
            position: start.position,
            velocity: start.velocity,
            body_to_world: start.body_to_world,
            force_bias: Vector3::zeros(),
            rate_bias: Vector3::zeros(),
            flow_scale: 0.0,
            pressure_offset_m: 0.0,
            rate: Vector3::zeros(),
            covariance: Covariance::from_diagonal(&sigmas.map(|sigma| sigma * sigma)),
        }
    }

    /// Covariance of position (rows 0 to 2, m), velocity (3 to 5, m/s), world ENU, and attitude about the body's axes
    /// (6 to 8, rad).
    pub fn covariance(&self) -> SMatrix<f64, 9, 9> {
        self.covariance.fixed_view::<9, 9>(0, 0).into()
    }

    /// Standard deviations of the position east, north and up, m.
    pub fn position_sigma_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.covariance[(axis, axis)].max(0.0).sqrt())
    }

    /// The same state elsewhere: its position has nothing to do any more with what else it knows.
    pub(super) fn shifted(&self, by: &Vector3<f64>, covariance: &Matrix3<f64>) -> Self {
        let mut shifted = self.clone();
        shifted.position += by;
        shifted.covariance.fixed_rows_mut::<3>(POSITION).fill(0.0);
        shifted.covariance.fixed_columns_mut::<3>(POSITION).fill(0.0);
        shifted.covariance.fixed_view_mut::<3, 3>(POSITION, POSITION).copy_from(covariance);
        shifted
    }

    /// Predicts to the end of a motion.
    pub(super) fn go_on(&mut self, motion: &Inertial, noise: &Noise) {
        let dt = motion.stamp.saturating_sub(self.stamp).as_secs_f64();
        self.stamp = motion.stamp.max(self.stamp);
        if dt <= 0.0 {
            return;
        }
        self.rate = motion.rate - self.rate_bias;
        let force = motion.force - self.force_bias;
        let turn = UnitQuaternion::from_scaled_axis(self.rate * dt);
        let middle = self.body_to_world * UnitQuaternion::from_scaled_axis(self.rate * (0.5 * dt));
        let rotation = middle.to_rotation_matrix().into_inner();
        let acceleration = rotation * force - Vector3::z() * GRAVITY_M_S2;
        self.position += (self.velocity + acceleration * (0.5 * dt)) * dt;
        self.velocity += acceleration * dt;
        self.body_to_world = UnitQuaternion::new_normalize((self.body_to_world * turn).into_inner());
        // The error's change: of the velocity by attitude and bias, and of the attitude by turning.
        let by_attitude = -rotation * force.cross_matrix() * dt;
        let by_bias = -rotation * dt;
        self.carry_covariance(dt, &by_attitude, &by_bias, &turn);
        self.add_noise(dt, noise);
    }

    /// `P = F P Fᵀ`, where `F` is the unit matrix but for a few blocks: rows first, then columns, each from values of
    /// before.
    fn carry_covariance(
        &mut self,
        dt: f64,
        by_attitude: &Matrix3<f64>,
        by_bias: &Matrix3<f64>,
        turn: &UnitQuaternion<f64>,
    ) {
        let back = turn.inverse().to_rotation_matrix().into_inner();
        for _ in 0..2 {
            let p = &mut self.covariance;
            let rows = |p: &Covariance, first| -> SMatrix<f64, 3, SIZE> { p.fixed_rows::<3>(first).into() };
            let (velocity, attitude) = (rows(p, VELOCITY), rows(p, ATTITUDE));
            let (force_bias, rate_bias) = (rows(p, FORCE_BIAS), rows(p, RATE_BIAS));
            let faster = by_attitude * attitude + by_bias * force_bias;
            let mut position = p.fixed_rows_mut::<3>(POSITION);
            position += velocity * dt + faster * (0.5 * dt);
            let mut velocity = p.fixed_rows_mut::<3>(VELOCITY);
            velocity += faster;
            p.fixed_rows_mut::<3>(ATTITUDE).copy_from(&(back * attitude - rate_bias * dt));
            p.transpose_mut();
        }
    }

    fn add_noise(&mut self, dt: f64, noise: &Noise) {
        let (mut force, mut rate) = (noise.force * noise.force, noise.rate * noise.rate);
        if dt > LONGEST_STEP_S {
            force += UNFELT_M_S2 * UNFELT_M_S2 * dt;
            rate += UNFELT_RAD_S * UNFELT_RAD_S * dt;
        }
        let p = &mut self.covariance;
        for axis in 0..3 {
            let (position, velocity) = (POSITION + axis, VELOCITY + axis);
            p[(position, position)] += force * dt * dt * dt / 3.0;
            p[(position, velocity)] += force * dt * dt / 2.0;
            p[(velocity, position)] += force * dt * dt / 2.0;
            p[(velocity, velocity)] += force * dt;
            p[(ATTITUDE + axis, ATTITUDE + axis)] += rate * dt;
            p[(FORCE_BIAS + axis, FORCE_BIAS + axis)] += noise.force_walk * noise.force_walk * dt;
            p[(RATE_BIAS + axis, RATE_BIAS + axis)] += noise.rate_walk * noise.rate_walk * dt;
        }
        p[(FLOW_SCALE, FLOW_SCALE)] += FLOW_SCALE_WALK * FLOW_SCALE_WALK * dt;
        p[(PRESSURE_OFFSET, PRESSURE_OFFSET)] += PRESSURE_WALK * PRESSURE_WALK * dt;
    }

    /// Weighs an innovation, and corrects the state by it if noise explains it; `limit` is what its squared length by
    /// its covariance may be. `None` if that covariance is none.
    pub(super) fn correct<const ROWS: usize>(
        &mut self,
        innovation: &SVector<f64, ROWS>,
        jacobian: &SMatrix<f64, ROWS, SIZE>,
        noise: &SMatrix<f64, ROWS, ROWS>,
        limit: f64,
        is_fused: bool,
    ) -> Option<Weighed> {
        let p = &self.covariance;
        let cross = p * jacobian.transpose();
        let expected = (jacobian * cross + noise).cholesky()?;
        let squared = innovation.dot(&expected.solve(innovation));
        let weighed = Weighed { ratio: squared / ROWS as f64, passed: squared <= limit };
        if !squared.is_finite() {
            return None;
        }
        if weighed.passed && is_fused {
            let gain = expected.solve(&cross.transpose()).transpose();
            // Joseph's form keeps the covariance symmetric and positive whatever is rounded.
            let keeps = Covariance::identity() - gain * jacobian;
            self.covariance = keeps * p * keeps.transpose() + gain * noise * gain.transpose();
            self.inject(&(gain * innovation));
        }
        Some(weighed)
    }

    fn inject(&mut self, error: &SVector<f64, SIZE>) {
        let part = |first| -> Vector3<f64> { error.fixed_rows::<3>(first).into() };
        self.position += part(POSITION);
        self.velocity += part(VELOCITY);
        let turn = part(ATTITUDE);
        self.body_to_world = UnitQuaternion::new_normalize(
            (self.body_to_world * UnitQuaternion::from_scaled_axis(turn)).into_inner(),
        );
        self.force_bias += part(FORCE_BIAS);
        self.rate_bias += part(RATE_BIAS);
        self.flow_scale += error[FLOW_SCALE];
        self.pressure_offset_m += error[PRESSURE_OFFSET];
        // The error of the attitude counts from the corrected one from now on.
        let reset = Matrix3::identity() - turn.cross_matrix() * 0.5;
        for _ in 0..2 {
            let turned = reset * self.covariance.fixed_rows::<3>(ATTITUDE);
            self.covariance.fixed_rows_mut::<3>(ATTITUDE).copy_from(&turned);
            self.covariance.transpose_mut();
        }
    }
}
