//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::unwrap_used, clippy::panic)] // A test fails by panicking.

mod behaviours;
mod bthreads;
mod evasion;
mod limits;
mod long_legs;
mod scripts;
mod verify;
mod verify_command;
