//! Maps and planners: pure functions of their inputs.
//!
//! A vehicle sees with a planar lidar, knows nothing beforehand, and flies among trees and other vehicles.
//! This crate turns what it has seen into the velocity it should fly, one arrow at a time: rays -> [`map`] ->
//! path ([`global`]) -> velocity along it ([`local`]) -> velocity that keeps its distance ([`separation`]).
//! [`passage`] finds the places that only one vehicle should be in.
//! An [`airspace`] holds terrain, threats and no-fly zones that are known beforehand.
//!
//! Nothing here reads a clock, and random numbers come from a seed that is given: the same inputs give the same
//! outputs, bit for bit. Budgets count expansions or evaluations. The world frame is ENU; metres, seconds, radians.
//!
//! ```
//! use nalgebra::Vector3;
//! use skein_planning::Region;
//! use skein_planning::global::{Potential, astar, simplify};
//! use skein_planning::map::{ClearanceMap, RayEnd, VoxelMapConfig};
//!
//! let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5)?;
//! let eye = Vector3::new(0.1, 0.1, 3.1);
//! map.integrate(eye, &[RayEnd { point: Vector3::new(4.1, 0.1, 3.1), hit: true }]);
//!
//! let (goal, config) = (Vector3::new(8.1, 0.1, 3.1), astar::AstarConfig::default());
//! let (potential, within) = (Potential::default(), Region::EVERYWHERE);
//! let request = astar::Request { start: eye, goal, potential: &potential, discs: &[], within };
//! let plan = astar::plan(&mut map, &request, &config, &mut astar::Astar::default())?;
//! let path = simplify(&map, &plan.path, config.clearance_m);
//! assert!(path.length_m() > 8.0 && path.points().len() <= 5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod airspace;
pub mod global;
pub mod grid;
pub mod local;
pub mod map;
pub mod passage;
mod path;
mod region;
pub mod separation;

pub use path::{Corner, Path, Projection};
pub use region::Region;
