//! Paths through the whole map.

mod anytime;
pub mod astar;
pub mod dstar;
mod dstar_lite;
mod map_field;
mod open_list;
mod potential;
mod refuge;
mod simplify;

pub use anytime::{Effort, Route, Search, Unsolved, cost_of};
pub use dstar_lite::DStarLite;
pub use potential::{Potential, PotentialConfig, PotentialObstacle, is_in_field};
pub use refuge::{RefugeRequest, refuge};
pub use simplify::{elide_collinear, simplify, simplify_around};
