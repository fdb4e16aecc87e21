//! ArduPilot's JSON interface: a packet of servo pulses comes, and a line that says where the vehicle then is answers.

use std::time::Duration;

use serde::Serialize;

use super::Motion;
use crate::axes;

/// The beginning of every packet of sixteen servos.
const MAGIC: u16 = 18_458;
/// Pulses of a motor that stands and of one at full thrust, µs.
const PULSES_US: [f64; 2] = [1000.0, 2000.0];

/// One packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Servos {
    /// A number that grows by one with each packet that is not a repetition.
    pub frame: u32,
    /// Shares of full throttle: front-right, rear-left, front-left, rear-right.
    pub throttle: [f64; 4],
}

impl Servos {
    /// Reads a datagram; `None` if it is no packet of sixteen servos.
    pub fn read(datagram: &[u8]) -> Option<Self> {
        let word = |at: usize| datagram.get(at..at + 2)?.try_into().ok().map(u16::from_le_bytes);
        if datagram.len() != 40 || word(0)? != MAGIC {
            return None;
        }
        let frame = u32::from_le_bytes(datagram.get(4..8)?.try_into().ok()?);
        let [low_us, high_us] = PULSES_US;
        let share = |motor: usize| {
            let pulse_us = f64::from(word(8 + 2 * motor)?);
            Some(((pulse_us - low_us) / (high_us - low_us)).clamp(0.0, 1.0))
        };
        Some(Self { frame, throttle: [share(0)?, share(1)?, share(2)?, share(3)?] })
    }
}

#[derive(Serialize)]
struct Answer {
    timestamp: f64,
    imu: Imu,
    position: [f64; 3],
    velocity: [f64; 3],
    quaternion: [f64; 4],
    battery: Battery,
    /// Nothing but answers paces it.
    no_time_sync: u8,
}

#[derive(Serialize)]
struct Imu {
    gyro: [f64; 3],
    accel_body: [f64; 3],
}

#[derive(Serialize)]
struct Battery {
    voltage: f64,
    current: f64,
}

/// The line that answers a packet: the vehicle's motion `at` this time since the run began, in north-east-down about
/// the world's origin, and its battery's voltage.
pub fn answer(at: Duration, motion: &Motion, voltage_v: f64) -> String {
    let ned = |vector: &nalgebra::Vector3<f64>| axes::enu_to_ned(vector).into();
    let frd = |vector: &nalgebra::Vector3<f64>| axes::flu_to_frd(vector).into();
    let attitude = axes::attitude_to_ned(&motion.attitude);
    let answer = Answer {
        timestamp: at.as_secs_f64(),
        imu: Imu { gyro: frd(&motion.angular_rate), accel_body: frd(&motion.specific_force) },
        position: ned(&motion.position),
        velocity: ned(&motion.velocity),
        quaternion: [attitude.w, attitude.i, attitude.j, attitude.k],
        battery: Battery { voltage: voltage_v, current: 0.0 },
        no_time_sync: 1,
    };
    // Numbers and nothing else: it always can be written.
    let text = serde_json::to_string(&answer).unwrap_or_default();
    format!("{text}\n")
}
