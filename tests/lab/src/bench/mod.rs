//! `bench`: what can be measured on this computer. No test depends on the figures.

mod bp;
mod fleet;
#[cfg(feature = "zenoh")]
mod hold;
#[cfg(feature = "zenoh")]
mod link;
#[cfg(feature = "zenoh")]
pub mod link_peer;
mod nav;
mod plan;
#[cfg(feature = "peers")]
mod plan_peer;
pub(crate) mod quantile;

use std::time::Duration;

use crate::cli::Bench;

/// Measures what the command line asks for, and prints it.
///
/// # Errors
/// What keeps it from being measured.
pub fn run(what: &Bench, as_json: bool) -> anyhow::Result<()> {
    match what {
        Bench::Bp { repetitions, seconds, philosophers } => {
            bp::run(*repetitions, Duration::from_secs_f64(*seconds), *philosophers, as_json)
        }
        Bench::Plan(args) => plan::run(args, as_json),
        Bench::Nav { ticks, seed } => nav::run(*ticks, *seed, as_json),
        Bench::Fleet { nodes, seconds } => fleet::run(nodes, Duration::from_secs_f64(*seconds), as_json),
        Bench::FleetOf { nodes, seconds } => fleet::run_one(*nodes, Duration::from_secs_f64(*seconds)),
        #[cfg(feature = "zenoh")]
        Bench::Hold { vehicles, holds, port_offset } => hold::run(*vehicles, *holds, *port_offset, as_json),
        #[cfg(feature = "zenoh")]
        Bench::Link { round_trips, homes, confirmations, stopped_s } => {
            let extent = link::Extent {
                round_trips: *round_trips,
                homes: *homes,
                confirmations: *confirmations,
                stopped: Duration::from_secs_f64(*stopped_s),
            };
            link::run(extent, as_json)
        }
        #[cfg(feature = "zenoh")]
        Bench::LinkPeer { role, connect, number, homes } => link_peer::run(*role, *number, *homes, connect),
    }
}
