//! An error-state Kalman filter: an inertial unit is integrated, and every other sensor corrects it.
//!
//! The state is position, velocity and attitude, the biases of accelerometer and gyroscope, the scale of optical flow
//! and the offset of the barometer; the error of the attitude is a small rotation about the body's axes (Solà 2017,
//! "Quaternion kinematics for the error-state Kalman filter", local perturbation). What is measured late is taken in
//! where it belongs, and all that came since is replayed.

mod health;
mod history;
mod measurement;
mod state;

use std::time::Duration;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

pub use self::health::{Aid, Fused, Health};
use self::history::{History, Taken};
pub use self::measurement::{Flow, Heading, Measurement, Pressure, Range, Rest, Satellites};
pub use self::state::State;

/// The mean that an inertial unit has felt since the sample before. Body FLU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// The end of that time.
    pub stamp: Duration,
    /// Angular rate, rad/s.
    pub rate: Vector3<f64>,
    /// Acceleration less gravity, m/s²: 9.81 upward at rest.
    pub force: Vector3<f64>,
}

/// The noise of an inertial unit, as densities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of angular rate, rad/s/√Hz.
    pub rate: f64,
    /// Of specific force, m/s²/√Hz.
    pub force: f64,
    /// Of the walk of the gyroscope's bias, rad/s²/√Hz.
    pub rate_walk: f64,
    /// Of the walk of the accelerometer's bias, m/s³/√Hz.
    pub force_walk: f64,
}

impl Noise {
    /// A small unit among vibrating rotors.
    pub const SMALL: Self = Self { rate: 1e-3, force: 1e-2, rate_walk: 2e-5, force_walk: 5e-4 };
}

/// Where a filter begins, with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    pub stamp: Duration,
    /// World ENU, m.
    pub position: Vector3<f64>,
    pub position_sigma_m: f64,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
    pub velocity_sigma_m_s: f64,
    /// Body FLU to world ENU.
    pub body_to_world: UnitQuaternion<f64>,
    /// Of roll and pitch, and of the heading, rad.
    pub tilt_sigma_rad: f64,
    pub heading_sigma_rad: f64,
}

/// The filter.
///
/// ```
/// use std::time::Duration;
/// use nalgebra::{UnitQuaternion, Vector3};
/// use skein_positioning::ekf::{Ekf, Inertial, Noise, Start};
///
/// let start = Start {
///     stamp: Duration::ZERO,
///     position: Vector3::zeros(),
///     position_sigma_m: 0.1,
///     velocity: Vector3::zeros(),
///     velocity_sigma_m_s: 0.1,
///     body_to_world: UnitQuaternion::identity(),
///     tilt_sigma_rad: 0.01,
///     heading_sigma_rad: 0.01,
/// };
/// let mut ekf = Ekf::new(Noise::SMALL, start);
/// let force = Vector3::new(1.0, 0.0, 9.80665);
/// for ms in (10..=1000).step_by(10) {
///     ekf.feel(Inertial { stamp: Duration::from_millis(ms), rate: Vector3::zeros(), force });
/// }
/// assert!((ekf.state().position.x - 0.5).abs() < 1e-9);
/// assert!(ekf.state().position_sigma_m()[0] > 0.1);
/// ```
#[derive(Clone, Debug)]
pub struct Ekf {
    history: History,
    health: Health,
    /// Measurements later than the newest inertial sample.
    early: Vec<(Measurement, bool)>,
}

/// No more than so many measurements wait for the inertial unit.
const MOST_EARLY: usize = 32;

impl Ekf {
    pub fn new(noise: Noise, start: Start) -> Self {
        Self {
            history: History::new(noise, State::new(&start)),
            health: Health::default(),
            early: Vec::new(),
        }
    }

    /// The state after the newest inertial sample.
    pub fn state(&self) -> &State {
        self.history.newest()
    }

    pub fn health(&self) -> &Health {
        &self.health
    }

    /// Takes in an inertial sample; one that is not newer than the last, or no number, counts for nothing.
    pub fn feel(&mut self, inertial: Inertial) {
        let is_finite = inertial.rate.iter().chain(inertial.force.iter()).all(|number| number.is_finite());
        if !is_finite || inertial.stamp <= self.state().stamp {
            return;
        }
        self.history.feel(inertial);
        let now = self.state().stamp;
        let waiting = std::mem::take(&mut self.early).into_iter();
        let (due, early): (Vec<_>, _) = waiting.partition(|(measured, _)| measured.stamp() <= now);
        self.early = early;
        for (measured, is_fused) in due {
            self.take(measured, is_fused);
        }
    }

    /// Takes in a measurement, late or not. Where `is_fused` is false it is only held against the state, for
    /// [`Ekf::health`].
    pub fn measure(&mut self, measured: Measurement, is_fused: bool) {
        if measured.stamp() <= self.state().stamp {
            self.take(measured, is_fused);
        } else if self.early.len() < MOST_EARLY {
            self.early.push((measured, is_fused));
        }
    }

    fn take(&mut self, measured: Measurement, is_fused: bool) {
        let (aid, stamp) = (measured.aid(), measured.stamp());
        match self.history.insert(measured, is_fused) {
            Taken::TooLate | Taken::Senseless => self.health.note_unusable(aid),
            Taken::Weighed(weighed) => self.health.note(aid, stamp, weighed, is_fused),
        }
    }

    /// Puts the vehicle elsewhere: by so much, with so much doubt, m². Velocity, attitude and biases stay. There
    /// is nothing to replay then: what was measured before is too late.
    pub fn shift(&mut self, by: &Vector3<f64>, covariance: &Matrix3<f64>) {
        self.history.begin_anew(self.state().shifted(by, covariance));
    }
}
