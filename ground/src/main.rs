//! The ground station without behaviours of one's own: see `skein-ground --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    skein_ground::main(|_| {})
}
