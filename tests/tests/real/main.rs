//! Processes and clocks: what runs in real time, apart from what keeps the processor busy.

#![allow(clippy::unwrap_used, clippy::panic)] // A test fails by panicking.

mod autopilots;
mod certificates;
mod console;
mod logs;
mod processes;
mod real_clock;
mod turn;
