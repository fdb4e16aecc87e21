//! Positioning on known answers.

mod ekf;
