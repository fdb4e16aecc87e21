//! What a vehicle's lidar sees, on its way from the sensor to the vehicle's agent.

use std::time::Duration;

/// One turn of a planar lidar in the vehicle's xy plane, with range finders up and down.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// When it was measured: time since 1970, on the clock of the sensor's computer. Sensor and agent share a computer,
    /// or one that keeps its clock with it.
    pub measured_at_unix: Duration,
    /// Angle of the first ray from the vehicle's nose, radians, counter-clockwise.
    pub angle_min: f64,
    /// From one ray to the next, radians.
    pub angle_step: f64,
    /// What the lidar can see, metres.
    pub max_range_m: f64,
    /// Metres, at most [`Scan::MAX_RAYS`]; infinite where nothing came back.
    pub ranges_m: Vec<f32>,
    /// To what is above, metres; none if nothing is in range.
    pub up_m: Option<f32>,
    /// To what is below, metres; none if nothing is in range.
    pub down_m: Option<f32>,
}

impl Scan {
    /// How many rays a scan may have.
    pub const MAX_RAYS: usize = 4096;
}
