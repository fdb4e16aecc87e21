//! One vehicle's program: b-threads that decide *what* may be done, a pipeline that decides *how*, and the core around them.
//!
//! [`AgentCore`] does no I/O and reads no clock. A driver feeds it MAVLink bytes and lidar scans, ticks it every 20 ms with a
//! [`Link`](skein_wire::Link) to the other nodes, and carries its MAVLink bytes to the autopilot. So the same agent flies
//! on a vehicle, over Zenoh on one host, and in lockstep. Only [`scripts::FileScriptStore`], which is for drivers, touches files.

mod airspace_table;
pub mod bthreads;
mod config;
mod core;
mod error;
mod failsafes;
mod flight;
mod me;
mod neighbours;
pub mod pipeline;
pub mod precedence;
mod safety;
pub mod scripts;
pub mod sequential;
pub mod verify;
mod watches;

pub use self::{
    airspace_table::{AirspaceError, AirspaceTable},
    config::{
        AgentConfig, Controller, Envelope, Fence, GlobalPlanner, Layer, LocalPlanner, PassageRule, Planners,
    },
    core::{AgentCore, Outcome, SetPointRecord, Status},
    error::AgentError,
    flight::FlightPhase,
    me::Me,
    pipeline::perception::Scan,
};
