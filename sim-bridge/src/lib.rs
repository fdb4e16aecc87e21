//! One-host runs: scenarios, the lockstep and real-time runners, summaries.
//!
//! [`fly`] hosts a whole swarm in one process, or starts one process for each of its nodes; `serve` hosts the world
//! alone, for agents and MAVLink clients in other processes. All take a [`scenario`].

pub mod autopilots;
mod check;
pub mod cli;
#[cfg(feature = "zenoh")]
pub mod configure;
pub mod element;
pub mod fly;
#[cfg(feature = "zenoh")]
mod mavlink_ports;
pub mod mission;
mod model_folders;
mod node_names;
#[cfg(feature = "zenoh")]
pub mod processes;
mod program;
pub mod scenario;
mod scene_view;
mod sequential;
#[cfg(feature = "zenoh")]
pub mod serve;
pub mod summary;
pub mod table;
#[cfg(feature = "zenoh")]
pub mod world_host;

pub use self::program::main;
