//! The simulator's ends of autopilots that run on a computer: what they are told of the world, and how they answer.
//!
//! - [`Px4Link`] speaks MAVLink's hardware-in-the-loop messages with PX4.
//! - [`ardupilot`] reads ArduPilot's servo packets and answers them with JSON.
//!
//! Like all of this crate it has no sockets and no clock.

pub mod ardupilot;
mod px4;

use nalgebra::{UnitQuaternion, Vector3};

pub use px4::{Px4Commands, Px4Link};

/// The readings of a vehicle's instruments at one time. World ENU, body FLU.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruments {
    /// Gyroscope, body, rad/s.
    pub angular_rate: Vector3<f64>,
    /// Accelerometer, body, m/s²: +9.81 along z at rest.
    pub specific_force: Vector3<f64>,
    /// Magnetometer, body, gauss, when new.
    pub magnetic_field: Option<Vector3<f64>>,
    /// Height above the datum by air pressure, m, when new.
    pub pressure_height_m: Option<f64>,
    /// Position and velocity by satellite, m and m/s, when new.
    pub satellite: Option<[Vector3<f64>; 2]>,
}

/// Where a vehicle truly is and how it moves. World ENU, body FLU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// m.
    pub position: Vector3<f64>,
    /// m/s.
    pub velocity: Vector3<f64>,
    pub attitude: UnitQuaternion<f64>,
    /// Body, rad/s.
    pub angular_rate: Vector3<f64>,
    /// Body, m/s².
    pub specific_force: Vector3<f64>,
}
