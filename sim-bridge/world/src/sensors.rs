//! A vehicle's instruments, with seeded noise.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Battery, Flow};

use crate::flow::FlowSensor;
use crate::lidar::{Surroundings, cast_ray};
use crate::noise::Noise;
use crate::position_error::{FixErrors, Lost};
use crate::quadrotor::{Quadrotor, STEP};
use crate::vehicle::{GpsModel, VehicleModel};

/// One step's readings, the autopilot's whole view of the world.
///
/// A reading of a slower instrument is `Some` only in the step in which it is new.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorReadings {
    /// Inertial unit, new at every step.
    pub imu: Imu,
    pub gps: Option<Gps>,
    /// Height above the world's origin by air pressure, m; carries a constant unknown offset.
    pub baro_height_m: Option<f64>,
    /// By how much fixes and pressure height are off on purpose, ENU, m: for simulators that make their own.
    pub fix_error: Vector3<f64>,
    /// Yaw in ENU: counter-clockwise from east, rad, in (-pi, pi].
    pub magnetic_heading: Option<f64>,
    /// Distance along body -z from the centre to the first solid, m; `None` also beyond range.
    pub rangefinder_down_m: Option<f64>,
    /// Optical flow of the ground.
    pub flow: Option<Flow>,
    /// Whether the legs touch the ground.
    pub contact: bool,
    pub battery: Battery,
}

/// An inertial sample in the body frame (FLU).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imu {
    /// Angular rate, rad/s.
    pub angular_rate: Vector3<f64>,
    /// Acceleration less gravity, m/s^2: +9.81 along z at rest.
    pub specific_force: Vector3<f64>,
}

/// A satellite fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gps {
    /// World ENU, m.
    pub position: Vector3<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
}

/// An accelerometer reads no more than 16 g.
const ACCELEROMETER_LIMIT_M_S2: f64 = 157.0;

/// The instruments of one vehicle.
#[derive(Debug, Clone)]
pub(crate) struct Sensors {
    noise: Noise,
    gyro_bias: Vector3<f64>,
    accel_bias: Vector3<f64>,
    baro_offset_m: f64,
    errors: FixErrors,
    flow: Option<FlowSensor>,
    /// Shifts the slow instruments in time, so that vehicles do not sample all at once.
    phase: u64,
}

impl Sensors {
    /// `flow_noise` is that of the flow sensor alone.
    pub(crate) fn new(
        model: &VehicleModel,
        mut noise: Noise,
        flow_noise: Noise,
        errors: FixErrors,
        phase: u64,
    ) -> Self {
        Self {
            gyro_bias: noise.vector(model.imu.gyro_bias_rad_s),
            accel_bias: noise.vector(model.imu.accel_bias_m_s2),
            baro_offset_m: noise.normal(model.baro.offset_m),
            noise,
            errors,
            flow: model.flow.map(|model| FlowSensor::new(model, flow_noise)),
            phase,
        }
    }

    /// Readings at step number `tick`.
    pub(crate) fn read(
        &mut self,
        tick: u64,
        quadrotor: &Quadrotor,
        surroundings: &Surroundings<'_>,
    ) -> SensorReadings {
        self.errors.step(Duration::from_millis(tick * STEP.as_millis() as u64), &quadrotor.state().position);
        let model = quadrotor.model();
        let due = |rate_hz| is_due(tick + self.phase, rate_hz);
        let [baro, compass, rangefinder] =
            [due(model.baro.rate_hz), due(model.compass.rate_hz), due(model.rangefinder.rate_hz)];
        let is_lost = self.errors.lost().flow;
        let flow = self
            .flow
            .as_mut()
            .and_then(|flow| flow.step(due(flow.rate_hz()), is_lost, quadrotor, surroundings));
        let gps = model.gps.filter(|gps| due(gps.rate_hz) && !self.errors.lost().fixes);
        SensorReadings {
            imu: self.imu(quadrotor),
            gps: gps.map(|model| self.gps(&model, quadrotor)),
            baro_height_m: baro.then(|| self.baro_height_m(quadrotor)),
            fix_error: self.errors.offset(),
            magnetic_heading: compass.then(|| self.magnetic_heading(quadrotor)),
            rangefinder_down_m: rangefinder
                .then(|| self.rangefinder_down_m(quadrotor, surroundings))
                .flatten(),
            flow,
            contact: quadrotor.on_ground(),
            battery: quadrotor.battery(),
        }
    }

    fn imu(&mut self, quadrotor: &Quadrotor) -> Imu {
        let imu = &quadrotor.model().imu;
        let rate_noise = self.noise.vector(imu.gyro_sigma_rad_s);
        let force_noise = self.noise.vector(imu.accel_sigma_m_s2);
        let limit = ACCELEROMETER_LIMIT_M_S2;
        Imu {
            angular_rate: quadrotor.state().angular_rate + self.gyro_bias + rate_noise,
            specific_force: (quadrotor.specific_force() + self.accel_bias + force_noise)
                .map(|force| force.clamp(-limit, limit)),
        }
    }

    /// The senses that are lost now.
    pub(crate) fn lost(&self) -> Lost {
        self.errors.lost()
    }

    fn gps(&mut self, gps: &GpsModel, quadrotor: &Quadrotor) -> Gps {
        let error = Vector3::new(
            self.noise.normal(gps.sigma_horizontal_m),
            self.noise.normal(gps.sigma_horizontal_m),
            self.noise.normal(gps.sigma_vertical_m),
        );
        Gps {
            position: quadrotor.state().position + error + self.errors.offset(),
            velocity: quadrotor.state().velocity + self.noise.vector(gps.sigma_velocity_m_s),
        }
    }

    fn baro_height_m(&mut self, quadrotor: &Quadrotor) -> f64 {
        let noise = self.noise.normal(quadrotor.model().baro.sigma_m);
        quadrotor.state().position.z + self.errors.offset().z + self.baro_offset_m + noise
    }

    fn magnetic_heading(&mut self, quadrotor: &Quadrotor) -> f64 {
        let noise = self.noise.normal(quadrotor.model().compass.sigma_rad);
        let (_, _, yaw) = quadrotor.state().attitude.euler_angles();
        let (sin, cos) = (yaw + noise).sin_cos();
        sin.atan2(cos)
    }

    fn rangefinder_down_m(&mut self, quadrotor: &Quadrotor, surroundings: &Surroundings<'_>) -> Option<f64> {
        let rangefinder = &quadrotor.model().rangefinder;
        let state = quadrotor.state();
        let down = state.attitude * -Vector3::z();
        let noise = self.noise.normal(rangefinder.sigma_m);
        cast_ray(surroundings, &state.position.into(), &down, rangefinder.range_m)
            .map(|range| (range + noise).max(0.0))
    }
}

/// Whether an instrument of that rate speaks at step number `tick`.
pub(crate) fn is_due(tick: u64, rate_hz: f64) -> bool {
    let period = (1.0 / (rate_hz * STEP.as_secs_f64())).round() as u64;
    tick.is_multiple_of(period.max(1))
}
