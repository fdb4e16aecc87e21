//! The pipeline: *how* the vehicle does what its b-threads have decided.
//!
//! scan and pose -> [`perception`] -> map -> [`route_search`] -> [`guidance`] (velocity by the [`local`]
//! planner, repulsion, safety filter) -> [`set_point`] rule -> set-point.

pub mod evasion;
pub mod guidance;
pub mod local;
pub mod perception;
pub mod route_search;
pub mod set_point;
pub mod touchdown;
