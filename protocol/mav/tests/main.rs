//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::panic, clippy::unwrap_used)] // A test fails by panicking.

mod ardupilot;
mod dialects;
mod estimates;
mod frames;
mod geodesy;
mod habits;
mod lossy_link;
mod positions;
mod protocols;
mod signing;
mod simulator;
mod stations;
