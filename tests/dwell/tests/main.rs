//! The crate's tests, in one program.

#![allow(clippy::unwrap_used)] // A test fails by panicking.

mod first_behaviour;
