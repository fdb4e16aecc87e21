//! Where a vehicle is by a planar lidar: scan matching against key frames, closure of loops, a pose graph.
//!
//! [`Slam`] is what a vehicle uses. Budgets count work, never time, so one input gives one output.

mod level;
mod local_map;
mod matching;
mod search;
#[cfg(test)]
mod synthetic;

pub use self::level::{LevelScan, Prediction, Return, Sweep};
pub use self::local_map::LocalMap;
pub use self::matching::{Match, refine};
pub use self::search::{Found, Search};
