//! Positioning: where the vehicle is, how it lies and moves, and how sure that is.
//!
//! Whoever needs a position asks a [`Positioning`] and nobody else. A new source is a file beside that of the
//! [`Autopilot`] that implements it, and is chosen in [`Parts`](crate::Parts).

mod autopilot;
mod estimate;

pub use self::autopilot::Autopilot;
pub use self::estimate::{Attitude, Estimate, Motion};

use skein_mav::Telemetry;

/// A source of position.
pub trait Positioning: std::fmt::Debug + Send {
    /// The newest estimate, given the newest telemetry of the autopilot.
    fn estimate(&self, telemetry: &Telemetry) -> Estimate;
}
