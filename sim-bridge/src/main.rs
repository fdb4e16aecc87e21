//! The simulator without behaviours of one's own: see `skein-sim --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    skein_sim::main(|_| {})
}
