//! `skein-lab`: see `skein-lab --help`.

use std::process::ExitCode;

use serde_json::json;
use skein_lab::cli;
use skein_sim::cli::Exit;

fn main() -> ExitCode {
    skein_zenoh::share_threads();
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
        .with_env_filter(
            // Zenoh warns of things that are as they should be on one host; RUST_LOG says otherwise.
            tracing_subscriber::EnvFilter::try_from_default_env()
                .unwrap_or_else(|_| "warn,zenoh=error".into()),
        )
        .init();
    let arguments = cli::command().get_matches();
    let exit = cli::run(&arguments).unwrap_or_else(|error| {
        let message = format!("{error:#}");
        if cli::is_json(&arguments) {
            println!("{}", json!({ "error": message }));
        }
        eprintln!("skein-lab: {message}");
        Exit::WrongInput
    });
    exit.into()
}
