//! One vehicle's program: b-threads that decide *what* may be done, a pipeline that decides *how*, and the core
//! around them.
//!
//! [`AgentCore`] does no I/O and reads no clock. A driver feeds it MAVLink bytes and lidar scans, ticks it every 20
//! ms with a [`Link`](skein_wire::Link) to the other nodes, and carries its MAVLink bytes to the autopilot. So the
//! same agent flies on a vehicle, over Zenoh on one host, and in lockstep.

mod agent_error;
pub mod apart;
pub mod arrival;
#[cfg(feature = "zenoh")]
pub mod autopilot_link;
mod autopilot_words;
pub mod bthreads;
#[cfg(feature = "zenoh")]
mod cli;
mod config;
#[cfg(feature = "zenoh")]
pub mod config_file;
mod control;
mod core;
mod drawn;
mod energy;
mod errand;
pub mod field;
mod flight;
mod instruction;
mod living_airspace;
mod me;
mod mind;
mod mission;
mod neighbours;
mod parts;
pub mod pipeline;
pub mod positioning;
pub mod precedence;
mod preflight;
pub mod rank;
mod refuge;
mod report;
mod reroute;
mod safety;
pub mod scripts;
pub mod stretch;
pub mod verify;
mod watches;
pub mod way_on;

#[cfg(feature = "zenoh")]
pub use self::cli::main;
pub use self::{
    agent_error::AgentError,
    config::{
        AgentConfig, DEFAULT_SIGMA_LIMIT_M, Envelope, Fence, GlobalPlanner, LocalPlanner, Nose, Planners,
        PositionSource, Repellers, position_sources,
    },
    control::SetPointRecord,
    core::{AgentCore, Status},
    errand::{Errand, LONGEST_STAY_S, PayloadCommand, SLOWEST_M_S},
    flight::FlightPhase,
    instruction::Waypoint,
    me::Me,
    mind::{BThreads, Mind},
    mission::Outcome,
    neighbours::Neighbour,
    parts::Parts,
    report::Report,
};
