//! Positioning on known answers.

#![allow(clippy::expect_used, clippy::unwrap_used)] // A test fails by panicking.

mod calibration;
mod ekf;
mod sheets;
