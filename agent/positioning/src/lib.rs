//! Where a vehicle is, without satellites: sensors' measurements to a pose with its covariance.
//!
//! Pure: no clock, no file, no socket. World ENU, body FLU, metres, radians, seconds since a start that the caller
//! chooses.

// No number is neither above nor below a bound, and must not pass for one within it.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod ekf;
mod fix;
pub mod lidar;
pub mod markers;

pub use self::fix::{PlanarFix, PoseFix};
