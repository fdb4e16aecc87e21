//! Where a vehicle is, without satellites: sensors' measurements to a pose with its covariance.
//!
//! Pure: no clock, no file, no socket. World ENU, body FLU, metres, radians, seconds since a start that the caller
//! chooses.

mod fix;
pub mod markers;

pub use self::fix::{PlanarFix, PoseFix};
