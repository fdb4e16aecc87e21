//! The seam between who knows where the vehicle is and who needs to know.

use std::time::Duration;

use skein_mav::Telemetry;

use super::estimate::Estimate;

/// A source of position.
pub trait Positioning: std::fmt::Debug + Send {
    /// The newest estimate, given the newest telemetry of the autopilot.
    fn estimate(&mut self, now: Duration, telemetry: &Telemetry) -> Estimate;
}
