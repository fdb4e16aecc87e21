//! `bench`: what can be measured on this computer. No test depends on the figures.

mod hold;

use crate::cli::Bench;

/// Measures what the command line asks for, and prints it.
///
/// # Errors
/// What keeps it from being measured.
pub fn run(what: &Bench, as_json: bool) -> anyhow::Result<()> {
    match what {
        Bench::Hold { vehicles, holds, port_offset } => hold::run(*vehicles, *holds, *port_offset, as_json),
    }
}
