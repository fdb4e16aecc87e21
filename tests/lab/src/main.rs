//! `skein-lab`: see `skein-lab --help`.

use std::process::ExitCode;

use serde_json::json;
use skein_lab::cli;
use skein_sim::cli::Exit;

fn main() -> ExitCode {
    skein_zenoh::share_threads();
    skein_zenoh::log("warn", true);
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
