//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::expect_used, clippy::unwrap_used)] // A test fails by panicking.

mod command_line;
mod generators;
mod missions;
mod moving_obstacle;
mod other_peoples_tools;
mod plans;
mod scenario_files;
mod turn;
mod zones;
