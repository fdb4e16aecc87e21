//! The pipeline: *how* the vehicle does what its b-threads have decided.
//!
//! scan and pose -> [`perception`] -> map -> [`planning`] (a path by the [`global`] planner) -> [`steering`]
//! (velocity by the [`local`] planner, repulsion, [`safety_filter`]) -> [`set_point`] rule -> set-point. [`guidance`]
//! holds these together, and [`progress`] watches the vehicle on its [`course`].

pub mod acceleration;
pub mod allowed;
mod berth;
pub mod course;
mod envelope;
pub mod evasion;
pub mod global;
pub mod ground_seen;
pub mod guidance;
pub mod hard_brakes;
pub mod heading;
pub mod headroom;
pub mod layers;
pub mod local;
pub mod patience;
pub mod perception;
pub mod planning;
pub mod progress;
pub mod route_search;
pub mod safety_filter;
pub mod set_point;
pub mod steering;
pub mod surroundings;
pub mod touchdown;
mod way_back;
pub mod way_of_others;
