//! `skein-sim` with this crate's behaviours.

use std::process::ExitCode;

fn main() -> ExitCode {
    skein_sim::main(skein_dwell::behaviours)
}
