//! `campaign`: many runs with faults, each judged by what is promised.

#[cfg(feature = "zenoh")]
mod cable;
mod network;
#[cfg(feature = "zenoh")]
mod process_runs;
#[cfg(feature = "zenoh")]
pub mod processes;
mod separation;

use crate::cli;

/// Runs a campaign, and prints what came of it. Returns whether nothing was violated.
///
/// # Errors
/// What keeps it from being run at all.
pub fn run(what: &cli::Campaign, as_json: bool) -> anyhow::Result<bool> {
    match what {
        cli::Campaign::Network(args) => network::run(args, as_json),
        cli::Campaign::Separation(args) => separation::run(args, as_json),
        #[cfg(feature = "zenoh")]
        cli::Campaign::Processes { seeds, faults, jobs, out, port_offset, network } => {
            process_runs::run(*seeds, faults, *jobs, out.as_deref(), *port_offset, *network, as_json)
        }
    }
}
