//! A flight of which everything is known, and the sensors that see it.

use std::time::Duration;

use nalgebra::{Matrix6, UnitQuaternion, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use skein_positioning::PoseFix;
use skein_positioning::ekf::{Flow, Inertial, Noise, Range, Start};

pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, 9.806_65);
pub const STEP_S: f64 = 0.01;
pub const UNIT: Noise = Noise { rate: 4e-4, force: 5e-3, rate_walk: 2e-5, force_walk: 2e-4 };

/// A circle of 1.5 m that nods, at 0.6 m/s.
pub fn pose(at_s: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let angle = 0.4 * at_s;
    let position = Vector3::new(1.5 * angle.cos(), 1.5 * angle.sin(), 1.2 + 0.2 * (0.7 * at_s).sin());
    let attitude = UnitQuaternion::from_euler_angles(0.1 * (1.3 * at_s).sin(), 0.08 * at_s.cos(), 0.3 * at_s);
    (position, attitude)
}

pub fn velocity(at_s: f64) -> Vector3<f64> {
    let h = 1e-5;
    (pose(at_s + h).0 - pose(at_s - h).0) / (2.0 * h)
}

pub fn seconds(at_s: f64) -> Duration {
    Duration::from_secs_f64(at_s)
}

pub struct Sensors {
    rng: ChaCha8Rng,
    rate_bias: Vector3<f64>,
    force_bias: Vector3<f64>,
    pub flow_scale: f64,
}

impl Sensors {
    pub fn new(seed: u64) -> Self {
        let mut sensors = Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            rate_bias: Vector3::zeros(),
            force_bias: Vector3::zeros(),
            flow_scale: 0.0,
        };
        sensors.rate_bias = sensors.vector(0.005);
        sensors.force_bias = sensors.vector(0.05);
        sensors.flow_scale = 0.05 * sensors.normal();
        sensors
    }

    /// Twelve uniform numbers make a normal one, near enough.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| f64::from(self.rng.next_u32()) / f64::from(u32::MAX)).sum::<f64>() - 6.0
    }

    pub fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.normal())
    }

    /// The mean over the step that ends at `at_s`.
    pub fn inertial(&mut self, at_s: f64) -> Inertial {
        let middle_s = at_s - STEP_S / 2.0;
        let turn = pose(at_s - STEP_S).1.inverse() * pose(at_s).1;
        let acceleration = (velocity(at_s) - velocity(at_s - STEP_S)) / STEP_S;
        let force = pose(middle_s).1.inverse() * (acceleration + GRAVITY);
        let density = STEP_S.sqrt();
        Inertial {
            stamp: seconds(at_s),
            rate: turn.scaled_axis() / STEP_S + self.rate_bias + self.vector(UNIT.rate / density),
            force: force + self.force_bias + self.vector(UNIT.force / density),
        }
    }

    pub fn markers(&mut self, at_s: f64) -> PoseFix {
        let (position, body_to_world) = pose(at_s);
        let (far, near, turn) = (0.01, 0.004, 0.01);
        let variances = [far, far, near, turn, turn, turn].map(|sigma: f64| sigma * sigma);
        let error = Vector3::new(far * self.normal(), far * self.normal(), near * self.normal());
        PoseFix {
            stamp: seconds(at_s),
            position: position + error,
            body_to_world: body_to_world * UnitQuaternion::from_scaled_axis(self.vector(turn)),
            covariance: Matrix6::from_diagonal(&variances.into()),
        }
    }

    pub fn flow(&mut self, at_s: f64) -> Flow {
        let (position, attitude) = pose(at_s);
        let distance_m = position.z / (attitude * Vector3::z()).z;
        let seen = (attitude.inverse() * velocity(at_s)).xy() * (1.0 + self.flow_scale) / distance_m;
        let sigma_rad_s = 0.05;
        Flow {
            stamp: seconds(at_s),
            rate: seen + Vector2::new(self.normal(), self.normal()) * sigma_rad_s,
            sigma_rad_s,
            distance_m,
            distance_sigma_m: 0.01,
        }
    }

    pub fn range(&mut self, at_s: f64) -> Range {
        let (position, attitude) = pose(at_s);
        let (half_cone_rad, sigma_m) = (0.05, 0.01);
        let tilt = ((attitude * Vector3::z()).z.acos() - half_cone_rad).max(0.0);
        let distance_m = position.z / tilt.cos() + sigma_m * self.normal();
        Range { stamp: seconds(at_s), distance_m, sigma_m, half_cone_rad, ground_m: 0.0 }
    }

    /// A start that is as uncertain as it says.
    pub fn start(&mut self) -> Start {
        let (position, attitude) = pose(0.0);
        Start {
            stamp: Duration::ZERO,
            position: position + self.vector(0.1),
            position_sigma_m: 0.1,
            velocity: velocity(0.0) + self.vector(0.1),
            velocity_sigma_m_s: 0.1,
            body_to_world: attitude * UnitQuaternion::from_scaled_axis(self.vector(0.02)),
            tilt_sigma_rad: 0.02,
            heading_sigma_rad: 0.02,
        }
    }
}
