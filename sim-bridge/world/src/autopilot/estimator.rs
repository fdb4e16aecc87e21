//! Estimates position, motion and attitude from the instruments.
//!
//! Attitude is a complementary filter: the gyroscope is integrated, the compass corrects the heading, and the
//! tilt is corrected by the velocity fixes. A wrong tilt turns gravity into a false acceleration, so that the
//! predicted velocity runs away from the measured one in a direction that tells the error; unlike an
//! accelerometer's "down" this holds in accelerated flight. Position and velocity are one Kalman filter per
//! axis that predicts with the accelerometer.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_mav::{External, axes};

use crate::position_error::Drift;
use crate::quadrotor::STEP;
use crate::sensors::{Imu, SensorReadings};
use crate::vehicle::{GRAVITY_M_S2, GpsModel, VehicleModel};

/// Power spectral density of the error of the predicted acceleration, (m/s^2)^2/Hz: tilt error and
/// accelerometer bias.
const ACCELERATION_NOISE: f64 = 0.002;
/// Share of a heading difference corrected by each compass sample.
const HEADING_GAIN: f64 = 0.02;
/// Share of a heading difference that is put down to the gyroscope's bias, 1/s.
const HEADING_BIAS_GAIN: f64 = 0.004;
/// Share of a tilt correction that is put down to the gyroscope's bias, 1/s.
const TILT_BIAS_GAIN: f64 = 0.02;
/// Largest velocity gain that the tilt correction is derived from: before the filter has settled it is near
/// one.
const MAX_TILT_VELOCITY_GAIN: f64 = 0.3;
/// Share of a height difference that is put down to the barometer's offset at each sample.
const BARO_OFFSET_GAIN: f64 = 0.002;
/// The estimate is not used before it has run this long.
const SETTLING_TIME: Duration = Duration::from_secs(2);
/// Nor before its standard deviation of position is below this, m.
const READY_SIGMA_M: f64 = 0.5;
/// A position this many standard deviations beside the estimate is taken over, and a height by pressure with it.
const RESET_SIGMAS: f64 = 10.0;
/// An estimate of somebody else's is not believed to be better than this, m and m/s: it has taken in the same
/// instruments, and its errors last.
const EXTERNAL_M: f64 = 0.02;
const EXTERNAL_M_S: f64 = 0.05;
/// Nor after this long without a fix.
const FIX_TIMEOUT: Duration = Duration::from_secs(1);

/// The vehicle's motion as the autopilot believes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    /// World ENU, m.
    pub(super) position: Vector3<f64>,
    /// World ENU, m/s.
    pub(super) velocity: Vector3<f64>,
    /// Body FLU to world ENU.
    pub(super) attitude: UnitQuaternion<f64>,
    /// Body FLU, rad/s, without the gyroscope's bias.
    pub(super) angular_rate: Vector3<f64>,
}

impl Estimate {
    /// Heading, counter-clockwise from east, rad.
    pub(super) fn yaw(&self) -> f64 {
        axes::yaw(&self.attitude)
    }
}

/// Standard deviations of the instruments.
#[derive(Debug, Clone, Copy)]
struct Trust {
    gps_position_m: Vector3<f64>,
    gps_velocity_m_s: f64,
    baro_m: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Estimator {
    trust: Trust,
    estimate: Estimate,
    gyro_bias: Vector3<f64>,
    filters: [AxisFilter; 3],
    baro_offset_m: Option<f64>,
    drift: Drift,
    heading_known: bool,
    started: Option<Duration>,
    last_fix: Option<Duration>,
    /// Of these, the last by satellites, and the last estimate of somebody else's.
    last_gps: Option<Duration>,
    last_external: Option<Duration>,
}

/// A position and velocity from outside, with standard deviations.
struct Fix {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    position_sigma_m: Vector3<f64>,
    velocity_sigma_m_s: f64,
}

impl Estimator {
    /// `drift` is what the instruments are known to do, and is told.
    pub(super) fn new(model: &VehicleModel, drift: Drift) -> Self {
        let gps = model.gps.unwrap_or(GpsModel {
            sigma_horizontal_m: 0.0,
            sigma_vertical_m: 0.0,
            sigma_velocity_m_s: 0.0,
            rate_hz: 0.0,
        });
        let (horizontal, vertical) = (gps.sigma_horizontal_m, gps.sigma_vertical_m);
        // An instrument without noise in the model is still not believed to the last digit.
        let floor = |sigma: f64| sigma.max(0.005);
        Self {
            trust: Trust {
                gps_position_m: Vector3::new(horizontal, horizontal, vertical).map(floor),
                gps_velocity_m_s: floor(gps.sigma_velocity_m_s),
                // Twice what it is: its offset is learnt from the same filter.
                baro_m: 2.0 * floor(model.baro.sigma_m),
            },
            estimate: Estimate {
                position: Vector3::zeros(),
                velocity: Vector3::zeros(),
                attitude: UnitQuaternion::identity(),
                angular_rate: Vector3::zeros(),
            },
            gyro_bias: Vector3::zeros(),
            filters: [AxisFilter::default(); 3],
            baro_offset_m: None,
            drift,
            heading_known: false,
            started: None,
            last_fix: None,
            last_gps: None,
            last_external: None,
        }
    }

    pub(super) fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Whether there has been a fix, so that the position means something.
    pub(super) fn has_position(&self) -> bool {
        self.last_fix.is_some()
    }

    /// Standard deviations of the position, horizontal and vertical, as they are told, m.
    pub(super) fn position_sigma_m(&self) -> [f64; 2] {
        let [east, north, up] = self.filters.map(|filter| filter.position_sigma());
        let Drift { sigma_m, sigma_vertical_m, told_m, .. } = self.drift;
        told_m.unwrap_or([east.max(north).hypot(sigma_m), up.hypot(sigma_vertical_m)])
    }

    /// Whether there is a fix by satellites.
    pub(super) fn has_gps(&self, now: Duration) -> bool {
        is_recent(self.last_gps, now)
    }

    /// Whether there is a fix by anything.
    fn has_fix(&self, now: Duration) -> bool {
        is_recent(self.last_fix, now)
    }

    /// Begins anew with the next fix; attitude and motion go on.
    pub(super) fn forget_position(&mut self) {
        (self.last_fix, self.last_gps, self.last_external) = (None, None, None);
        self.baro_offset_m = None;
    }

    /// Whether the estimate is good enough to fly by; if not, why.
    pub(super) fn readiness(&self, now: Duration) -> Result<(), &'static str> {
        let age = |since: Option<Duration>| since.map(|since| now.saturating_sub(since));
        let sigma = self.filters.iter().map(|filter| filter.position_sigma()).fold(0.0, f64::max);
        if !self.heading_known {
            Err("no compass")
        } else if !self.has_fix(now) {
            Err("no position: neither satellites nor an external estimate")
        } else if age(self.started).is_none_or(|age| age < SETTLING_TIME) || sigma > READY_SIGMA_M {
            Err("estimator is still settling")
        } else {
            Ok(())
        }
    }

    /// Takes in the readings of one step.
    pub(super) fn update(&mut self, now: Duration, readings: &SensorReadings) {
        if self.started.is_none() {
            self.started = Some(now);
            self.estimate.attitude = level_with(&readings.imu.specific_force);
        }
        self.predict(&readings.imu);
        let heading = readings.magnetic_heading.filter(|_| !is_recent(self.last_external, now));
        if let Some(heading) = heading {
            self.correct_heading(heading);
        }
        if let Some(gps) = &readings.gps {
            self.last_gps = Some(now);
            let trust = &self.trust;
            let fix = Fix {
                position: gps.position,
                velocity: gps.velocity,
                position_sigma_m: trust.gps_position_m,
                velocity_sigma_m_s: trust.gps_velocity_m_s,
            };
            self.correct_by(now, &fix);
        }
        if let Some(height_m) = readings.baro_height_m {
            self.correct_height(height_m);
        }
        self.estimate.position = Vector3::from(self.filters.map(|filter| filter.position));
        self.estimate.velocity = Vector3::from(self.filters.map(|filter| filter.velocity));
    }

    fn predict(&mut self, imu: &Imu) {
        let dt = STEP.as_secs_f64();
        let rate = imu.angular_rate - self.gyro_bias;
        let mean_rate = (rate + self.estimate.angular_rate) * 0.5;
        self.estimate.angular_rate = rate;
        let turned = self.estimate.attitude * UnitQuaternion::from_scaled_axis(mean_rate * dt);
        self.estimate.attitude = UnitQuaternion::new_normalize(turned.into_inner());
        if self.has_position() {
            let gravity = Vector3::new(0.0, 0.0, GRAVITY_M_S2);
            let acceleration = self.estimate.attitude * imu.specific_force - gravity;
            for (filter, acceleration) in self.filters.iter_mut().zip(acceleration.iter()) {
                filter.predict(*acceleration, dt);
            }
        }
    }

    fn correct_heading(&mut self, heading: f64) {
        let error = axes::wrap_angle(heading - self.estimate.yaw());
        let gain = if self.heading_known { HEADING_GAIN } else { 1.0 };
        self.rotate(&Vector3::new(0.0, 0.0, gain * error));
        if self.heading_known {
            let up_in_body = self.estimate.attitude.inverse() * Vector3::z();
            self.gyro_bias -= up_in_body * (HEADING_BIAS_GAIN * error);
        }
        self.heading_known = true;
    }

    /// Takes in an estimate of somebody else's, where there are no satellites.
    pub(super) fn take_external(&mut self, now: Duration, external: &External) {
        if self.has_gps(now) {
            self.last_external = None;
            return;
        }
        let sigma = |index: usize| external.motion_covariance[(index, index)].max(0.0).sqrt();
        let fix = Fix {
            position: external.position,
            velocity: external.velocity,
            position_sigma_m: Vector3::new(sigma(0), sigma(1), sigma(2)).map(|it| it.max(EXTERNAL_M)),
            velocity_sigma_m_s: sigma(3).max(sigma(4)).max(sigma(5)).max(EXTERNAL_M_S),
        };
        self.correct_by(now, &fix);
        self.correct_heading(axes::yaw(&external.attitude));
        self.last_external = Some(now);
    }

    fn correct_by(&mut self, now: Duration, fix: &Fix) {
        let Some(last_fix) = self.last_fix.replace(now) else {
            let fixes = fix.position.iter().zip(fix.velocity.iter());
            for (filter, (position, velocity)) in self.filters.iter_mut().zip(fixes) {
                *filter = AxisFilter::at(*position, *velocity);
            }
            return;
        };
        let mut innovation = Vector3::zeros();
        let mut velocity_gain = 0.0;
        let variance = fix.velocity_sigma_m_s * fix.velocity_sigma_m_s;
        for (axis, filter) in self.filters.iter_mut().enumerate() {
            let sigma = fix.position_sigma_m[axis];
            filter.take_position(fix.position[axis], sigma * sigma);
            innovation[axis] = fix.velocity[axis] - filter.velocity;
            velocity_gain = filter.correct_velocity(fix.velocity[axis], variance);
        }
        let interval = now.saturating_sub(last_fix).max(STEP).as_secs_f64();
        self.correct_tilt(&innovation, velocity_gain, interval);
    }

    /// An attitude estimate that is turned too far by a small world vector `d` makes gravity look like the
    /// acceleration `d x (g z)`, so that the innovation `v` of the velocity grows along its opposite; `z x v`
    /// is then along `-d`, and is turned back by. The gain makes tilt and velocity a second-order system with
    /// damping 0.7.
    fn correct_tilt(&mut self, innovation: &Vector3<f64>, velocity_gain: f64, interval: f64) {
        let velocity_gain = velocity_gain.min(MAX_TILT_VELOCITY_GAIN);
        let gain = velocity_gain * velocity_gain / (2.0 * GRAVITY_M_S2 * interval);
        let correction = Vector3::z().cross(innovation) * gain;
        self.rotate(&correction);
        let in_body = self.estimate.attitude.inverse() * correction;
        self.gyro_bias -= in_body * (TILT_BIAS_GAIN / interval);
    }

    fn correct_height(&mut self, height_m: f64) {
        let [_, _, vertical] = &mut self.filters;
        if self.last_fix.is_none() {
            return;
        }
        let offset = self.baro_offset_m.get_or_insert(height_m - vertical.position);
        if vertical.is_beyond(height_m - *offset, self.trust.baro_m * self.trust.baro_m) {
            // The fixes tell whether the height or the pressure has changed.
            *offset = height_m - vertical.position;
        }
        *offset += BARO_OFFSET_GAIN * (height_m - vertical.position - *offset);
        vertical.correct_position(height_m - *offset, self.trust.baro_m * self.trust.baro_m);
    }

    /// Turns the attitude estimate by a small world vector.
    fn rotate(&mut self, by: &Vector3<f64>) {
        self.estimate.attitude = UnitQuaternion::from_scaled_axis(*by) * self.estimate.attitude;
    }
}

fn is_recent(at: Option<Duration>, now: Duration) -> bool {
    at.is_some_and(|at| now.saturating_sub(at) <= FIX_TIMEOUT)
}

/// The attitude with heading east whose "up" is the direction of a specific force at rest.
fn level_with(specific_force: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(specific_force, &Vector3::z()).unwrap_or_default()
}

/// Kalman filter of one axis: state (position, velocity), input acceleration.
#[derive(Debug, Clone, Copy, Default)]
struct AxisFilter {
    position: f64,
    velocity: f64,
    /// Covariance: position, position with velocity, velocity.
    pp: f64,
    pv: f64,
    vv: f64,
}

impl AxisFilter {
    fn at(position: f64, velocity: f64) -> Self {
        Self { position, velocity, pp: 1.0, pv: 0.0, vv: 1.0 }
    }

    fn position_sigma(&self) -> f64 {
        self.pp.sqrt()
    }

    fn predict(&mut self, acceleration: f64, dt: f64) {
        self.position += (self.velocity + 0.5 * acceleration * dt) * dt;
        self.velocity += acceleration * dt;
        self.pp += (2.0 * self.pv + self.vv * dt) * dt;
        self.pv += self.vv * dt;
        self.vv += ACCELERATION_NOISE * dt;
    }

    fn correct_position(&mut self, measured: f64, variance: f64) {
        let total = self.pp + variance;
        let (position_gain, velocity_gain) = (self.pp / total, self.pv / total);
        let innovation = measured - self.position;
        self.position += position_gain * innovation;
        self.velocity += velocity_gain * innovation;
        self.vv -= velocity_gain * self.pv;
        self.pv -= position_gain * self.pv;
        self.pp -= position_gain * self.pp;
    }

    /// Whether a position is further off than noise can explain.
    fn is_beyond(&self, measured: f64, variance: f64) -> bool {
        (measured - self.position).abs() > RESET_SIGMAS * (self.pp + variance).sqrt()
    }

    /// Corrects the position, or takes it over where it is beyond.
    fn take_position(&mut self, measured: f64, variance: f64) {
        if self.is_beyond(measured, variance) {
            (self.position, self.pp, self.pv) = (measured, variance, 0.0);
        } else {
            self.correct_position(measured, variance);
        }
    }

    /// Returns the gain of the velocity.
    fn correct_velocity(&mut self, measured: f64, variance: f64) -> f64 {
        let total = self.vv + variance;
        let (position_gain, velocity_gain) = (self.pv / total, self.vv / total);
        let innovation = measured - self.velocity;
        self.position += position_gain * innovation;
        self.velocity += velocity_gain * innovation;
        self.pp -= position_gain * self.pv;
        self.pv -= velocity_gain * self.pv;
        self.vv -= velocity_gain * self.vv;
        velocity_gain
    }
}
