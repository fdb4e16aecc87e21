//! The crate's tests, in one program.

#![allow(clippy::unwrap_used, clippy::panic)] // A test fails by panicking.

mod first_behaviour;
