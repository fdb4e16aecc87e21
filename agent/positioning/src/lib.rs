//! Where a vehicle is, without satellites: sensors' measurements to a pose with its covariance.
//!
//! Pure: no clock, no file, no socket. World ENU, body FLU, metres, radians, seconds since a start that the caller
//! chooses.

pub mod ekf;
mod fix;
pub mod lidar;
pub mod markers;

pub use self::fix::{PlanarFix, PoseFix};
