//! Measurements of a vehicle's instruments, as an autopilot passes them on. Bodies are forward-left-up.

use std::time::Duration;

use mavlink::dialects::common::{
    DISTANCE_SENSOR_DATA, HIGHRES_IMU_DATA, HighresImuUpdatedFlags, MavDistanceSensor, MavMessage,
    MavSensorOrientation, OPTICAL_FLOW_RAD_DATA,
};
use nalgebra::{Vector2, Vector3};

use crate::axes;

/// A sample of an inertial unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Angular rate, rad/s.
    pub rate: Vector3<f64>,
    /// Acceleration less gravity, m/s²: 9.81 upward at rest.
    pub force: Vector3<f64>,
}

/// Optical flow of the ground, without the vehicle's own turning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow {
    /// The vehicle's velocity forward and to the left by its distance from what is seen, rad/s.
    pub rate: Vector2<f64>,
    /// The time over which it was measured; it ends at the stamp.
    pub over: Duration,
    /// 0 (nothing seen) to 1.
    pub quality: f64,
    /// Distance to what is seen, m, if the sensor knows it.
    pub distance_m: Option<f64>,
}

/// A distance straight down along the body's axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    pub distance_m: f64,
    /// The range of the sensor, m.
    pub least_m: f64,
    pub most_m: f64,
    /// Standard deviation, m, if it is known.
    pub sigma_m: Option<f64>,
    /// Half of the opening of what it sees, rad.
    pub half_cone_rad: f64,
}

/// A reading of one instrument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measured {
    /// On the mean since the one before.
    Inertial(Inertial),
    Flow(Flow),
    Distance(Distance),
}

impl Measured {
    /// The reading in a message, with its stamp on the sender's clock; `None` if it holds none that can be used.
    pub(crate) fn read(message: &MavMessage) -> Option<(Duration, Self)> {
        match message {
            MavMessage::HIGHRES_IMU(message) => inertial(message),
            MavMessage::OPTICAL_FLOW_RAD(message) => flow(message),
            MavMessage::DISTANCE_SENSOR(message) => distance(message),
            _ => None,
        }
    }
}

impl Inertial {
    pub(crate) fn encode(&self, time: Duration) -> HIGHRES_IMU_DATA {
        let (force, rate) = (axes::flu_to_frd(&self.force), axes::flu_to_frd(&self.rate));
        HIGHRES_IMU_DATA {
            time_usec: time.as_micros() as u64,
            xacc: force.x as f32,
            yacc: force.y as f32,
            zacc: force.z as f32,
            xgyro: rate.x as f32,
            ygyro: rate.y as f32,
            zgyro: rate.z as f32,
            fields_updated: HighresImuUpdatedFlags::from_bits_truncate(0x3f),
            ..Default::default()
        }
    }
}

impl Flow {
    /// `turned` is the mean angular rate of the vehicle meanwhile, body FLU, rad/s.
    pub(crate) fn encode(&self, time: Duration, turned: &Vector3<f64>) -> OPTICAL_FLOW_RAD_DATA {
        let over_s = self.over.as_secs_f64();
        let turned = axes::flu_to_frd(turned) * over_s;
        // The ground seems to turn with the body, and about its right-hand axis backward when it flies forward.
        let seen = Vector2::new(turned.x - self.rate.y * over_s, turned.y - self.rate.x * over_s);
        OPTICAL_FLOW_RAD_DATA {
            time_usec: time.as_micros() as u64,
            integration_time_us: self.over.as_micros() as u32,
            integrated_x: seen.x as f32,
            integrated_y: seen.y as f32,
            integrated_xgyro: turned.x as f32,
            integrated_ygyro: turned.y as f32,
            integrated_zgyro: turned.z as f32,
            distance: self.distance_m.unwrap_or(-1.0) as f32,
            quality: (self.quality.clamp(0.0, 1.0) * 255.0).round() as u8,
            ..Default::default()
        }
    }
}

impl Distance {
    pub(crate) fn encode(&self, time: Duration) -> DISTANCE_SENSOR_DATA {
        let centimetres = |metres: f64| (metres * 100.0).round() as u16;
        let variance_cm2 = |sigma_m: f64| (sigma_m * sigma_m * 1e4).ceil().clamp(1.0, 254.0) as u8;
        DISTANCE_SENSOR_DATA {
            time_boot_ms: time.as_millis() as u32,
            min_distance: centimetres(self.least_m),
            max_distance: centimetres(self.most_m),
            current_distance: centimetres(self.distance_m),
            mavtype: MavDistanceSensor::MAV_DISTANCE_SENSOR_ULTRASOUND,
            orientation: MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270,
            covariance: self.sigma_m.map_or(u8::MAX, variance_cm2),
            horizontal_fov: (2.0 * self.half_cone_rad) as f32,
            vertical_fov: (2.0 * self.half_cone_rad) as f32,
            ..Default::default()
        }
    }
}

fn inertial(message: &HIGHRES_IMU_DATA) -> Option<(Duration, Measured)> {
    let force = axes::frd_to_flu(&axes::vector(message.xacc, message.yacc, message.zacc));
    let rate = axes::frd_to_flu(&axes::vector(message.xgyro, message.ygyro, message.zgyro));
    let is_finite = force.iter().chain(rate.iter()).all(|number| number.is_finite());
    let reading = Measured::Inertial(Inertial { rate, force });
    is_finite.then(|| (Duration::from_micros(message.time_usec), reading))
}

fn flow(message: &OPTICAL_FLOW_RAD_DATA) -> Option<(Duration, Measured)> {
    let over = Duration::from_micros(message.integration_time_us.into());
    let seen = [message.integrated_x, message.integrated_y].map(f64::from);
    let turned = [message.integrated_xgyro, message.integrated_ygyro].map(f64::from);
    let over_s = over.as_secs_f64();
    let rate = Vector2::new(turned[1] - seen[1], turned[0] - seen[0]) / over_s;
    let distance_m = Some(f64::from(message.distance)).filter(|distance_m| *distance_m > 0.0);
    let quality = f64::from(message.quality) / 255.0;
    let is_finite = over_s > 0.0 && rate.iter().all(|number| number.is_finite());
    let reading = Measured::Flow(Flow { rate, over, quality, distance_m });
    is_finite.then(|| (Duration::from_micros(message.time_usec), reading))
}

fn distance(message: &DISTANCE_SENSOR_DATA) -> Option<(Duration, Measured)> {
    let metres = |centimetres: u16| f64::from(centimetres) / 100.0;
    let known = |variance: u8| (1..u8::MAX).contains(&variance).then(|| f64::from(variance).sqrt() / 100.0);
    let cone_rad = f64::from(message.horizontal_fov.max(message.vertical_fov));
    let reading = Distance {
        distance_m: metres(message.current_distance),
        least_m: metres(message.min_distance),
        most_m: metres(message.max_distance),
        sigma_m: known(message.covariance),
        half_cone_rad: if cone_rad.is_finite() { cone_rad.clamp(0.0, 3.0) / 2.0 } else { 0.0 },
    };
    let is_down = message.orientation == MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270;
    // Quality 1 says that the reading is none.
    let is_sound = is_down
        && message.signal_quality != 1
        && (reading.least_m..reading.most_m).contains(&reading.distance_m);
    let time = Duration::from_millis(message.time_boot_ms.into());
    is_sound.then_some((time, Measured::Distance(reading)))
}
