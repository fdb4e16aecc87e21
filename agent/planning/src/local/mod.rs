//! The next velocity: along the path, away from what is near, and no faster than one can stop.
//!
//! [`apf`] is pushed away by what is near; [`vfh`] looks for openings, at a [`speed`] that follows the scene, and keeps
//! away from what is [`moving`].

pub mod apf;
pub mod braking;
pub mod escape;
pub mod moving;
pub mod speed;
pub mod vfh;
