//! Whole swarms in lockstep.

#![allow(clippy::unwrap_used, clippy::panic)] // A test fails by panicking.

mod cross_node_behaviours;
mod determinism;
mod explain;
mod faults;
mod gazebo_worlds;
mod landing;
mod limits;
mod positions;
mod scenarios;
mod scripts;
mod tasks;
