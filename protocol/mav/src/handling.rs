//! Handling: the delay, deceleration and jerk with which a vehicle follows its companion's velocities.

/// The handling of a vehicle in offboard flight, by its autopilot's make and parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handling {
    /// Deceleration that can be relied on, m/s².
    pub brake_m_s2: f64,
    /// Time from a set-point to the velocity it asks for, s.
    pub latency_s: f64,
    /// The most by which the acceleration changes, m/s³; none if it changes at once.
    pub jerk_m_s3: Option<f64>,
}
