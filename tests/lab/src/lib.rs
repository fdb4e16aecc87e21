//! The laboratory: published experiments, campaigns with faults, and benchmarks, over the same agents that fly.
//!
//! Each is a [`Task`](task::Task) in a file of its own, which declares its arguments beside its code, and is named once
//! in the list of its kind: [`experiment::TASKS`], [`campaign::TASKS`], [`bench::TASKS`]. The product knows nothing
//! of it.

pub mod bench;
pub mod campaign;
pub mod cli;
mod cpu_time;
pub mod experiment;
mod figure;
mod numbers;
pub mod operator;
mod quantile;
pub mod report;
pub mod reported;
mod runs;
mod statistics;
pub mod task;
