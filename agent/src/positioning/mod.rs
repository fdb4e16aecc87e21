//! Positioning: where the vehicle is, how it lies and moves, and how sure that is.
//!
//! Whoever needs a position asks a [`Positioning`] and nobody else. Another source is a file here, a line in
//! [`source`], and a name in [`PositionSource`].

mod autopilot;
mod estimate;
mod plausibility;
mod source;

pub use self::autopilot::Autopilot;
pub use self::estimate::{Attitude, Estimate, Motion, excess_m};
pub use self::plausibility::Doubt;
pub use self::source::Positioning;

use crate::config::PositionSource;

/// The source of this name.
#[must_use]
pub fn source(source: PositionSource) -> Box<dyn Positioning> {
    match source {
        PositionSource::Autopilot => Box::new(Autopilot::default()),
    }
}
