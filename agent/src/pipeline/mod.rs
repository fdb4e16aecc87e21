//! The pipeline: *how* the vehicle does what its b-threads have decided.
//!
//! scan and pose -> [`perception`] -> map -> [`guidance`] (path, velocity, repulsion, safety filter) ->
//! [`set_point`] rule -> set-point.

pub mod evasion;
pub mod guidance;
pub mod perception;
pub mod set_point;
