//! `skein-agent` with this crate's behaviours.

use std::process::ExitCode;

fn main() -> ExitCode {
    skein_agent::main(skein_dwell::behaviours)
}
