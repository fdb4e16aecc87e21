//! The next velocity: along the path, away from what is near, and no faster than one can stop.

pub mod apf;
pub mod braking;
pub mod escape;
