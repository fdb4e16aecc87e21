//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::expect_used, clippy::unwrap_used)] // A test fails by panicking.

mod benchmarks;
mod command_line;
mod hostile;
mod published;
mod routes;
