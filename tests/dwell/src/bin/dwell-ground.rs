//! `skein-ground` with this crate's behaviours.

use std::process::ExitCode;

fn main() -> ExitCode {
    skein_ground::main(skein_dwell::behaviours)
}
