//! Paths through the whole map.

pub mod astar;
mod potential;
mod simplify;

pub use potential::{Potential, PotentialObstacle, is_in_field};
pub use simplify::{elide_collinear, simplify, simplify_around};
