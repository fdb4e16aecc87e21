//! `skein-ground`: see `skein-ground --help`.

mod config;
mod recording;
mod serve;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use serde_json::json;

/// Skein's ground station: launches the swarm, shows it in a browser, carries orders to it, records what happens.
#[derive(Parser)]
#[command(
    name = "skein-ground",
    version,
    after_help = "Exit codes: 0 done, 1 the mission failed, 2 wrong usage or input."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object on standard output at the end and nothing else there.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Be the ground station, with its console, until Ctrl-C.
    Serve {
        /// The station's configuration; ground/ground.toml explains every field.
        #[arg(long, value_name = "FILE")]
        config: PathBuf,
        /// End when every vehicle's mission is over: exit 0 if all went well, 1 if not.
        #[arg(long)]
        until_over: bool,
    },
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
        .with_target(false)
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env()
                .unwrap_or_else(|_| "info,zenoh=error".into()),
        )
        .init();
    let cli = Cli::parse();
    let Command::Serve { config, until_over } = &cli.command;
    match config::Config::read(config).and_then(|config| serve::run(config, *until_over)) {
        Ok(outcome) => {
            let failed = outcome.as_ref().map(|outcome| outcome.failed.clone()).unwrap_or_default();
            if cli.json {
                println!(
                    "{}",
                    json!({ "over": outcome.is_some(), "succeeded": outcome.is_some() && failed.is_empty(), "failed": failed })
                );
            }
            ExitCode::from(u8::from(!failed.is_empty()))
        }
        Err(error) => {
            let message = format!("{error:#}");
            if cli.json {
                println!("{}", json!({ "error": message }));
            }
            eprintln!("skein-ground: {message}");
            ExitCode::from(2)
        }
    }
}
