//! Where a vehicle is by a planar lidar: scan matching against key frames, closure of loops, a pose graph.
//!
//! [`Slam`] is what a vehicle uses. Budgets count work, never time, so one input gives one output.

mod agreement;
mod closure;
mod key_frames;
mod level;
mod local_map;
mod matching;
mod place;
mod pose_graph;
mod relocation;
mod search;
mod slam;
#[cfg(test)]
mod synthetic;

pub use self::agreement::{Agreement, Sighting};
pub use self::key_frames::KeyFrame;
pub use self::level::{LevelScan, Prediction, Return, Sweep};
pub use self::place::Place;
pub use self::slam::{Health, Slam, SlamConfig, State};
