//! Positioning: where the vehicle is, how it lies and moves, and how sure that is.
//!
//! Whoever needs a position asks a [`Positioning`] and nobody else. A new source is a file beside that of the
//! [`Autopilot`] that implements it, and is chosen in [`Parts`](crate::parts::Parts).

mod autopilot;
mod estimate;
mod source;

pub use self::autopilot::Autopilot;
pub use self::estimate::{Attitude, Estimate, Motion};
pub use self::source::Positioning;
