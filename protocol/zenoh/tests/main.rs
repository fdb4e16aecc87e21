//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::unwrap_used)] // A test fails by panicking.

mod joining;
mod trust;
mod two_sessions;
