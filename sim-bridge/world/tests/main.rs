//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::expect_used, clippy::unwrap_used)] // A test fails by panicking.

mod autopilot;
mod closed_loop;
mod cost;
mod csv;
mod flight;
mod floor_camera;
mod geometry;
mod lidar;
mod position_error;
mod quadrotor;
mod sdf;
mod sdf_frames;
mod sdf_includes;
mod sdf_solids;
mod simulation;
mod vehicle;
