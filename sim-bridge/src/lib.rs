//! One-host runs: scenarios, the lockstep and real-time runners, summaries.
//!
//! [`fly`] hosts a whole swarm in one process; [`serve`] hosts the world alone, for agents and MAVLink clients in
//! other processes. Both take a [`scenario`].

pub mod check;
pub mod cli;
pub mod fly;
pub mod mission;
pub mod scenario;
pub mod serve;
pub mod summary;
pub mod table;
