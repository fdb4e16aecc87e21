//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::panic, clippy::unwrap_used)] // A test fails by panicking.

#[cfg(feature = "zenoh")]
mod commands;
mod explain;
#[cfg(feature = "zenoh")]
mod explain_command;
mod recorder;
mod replay;
mod station;
