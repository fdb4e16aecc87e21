//! The agent without behaviours of one's own: see `skein-agent --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    skein_agent::main(|_| {})
}
