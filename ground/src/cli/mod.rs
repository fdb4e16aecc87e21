//! The program of a ground station: see `skein-ground --help`.

mod caller;
mod certificates;
mod explain;
mod order;
mod plan;
mod recording;
mod rehearse;
mod replay;
mod serve;
mod status;
mod zone;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use serde_json::json;
use skein_bp::behaviour::Behaviours;

use crate::config_file::Config;

/// The ground station: launches the swarm, shows it in a browser, sends it orders, and records the mission.
#[derive(Parser)]
#[command(
    name = "skein-ground",
    version,
    max_term_width = 80,
    after_help = "Exit codes: 0 done, 1 the mission failed, an order was not taken in by all or nothing can be explained, 2 wrong usage or input."
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
    /// Run the ground station with its console until Ctrl-C.
    Serve {
        /// Configuration of the station; ground/ground.toml explains every field.
        #[arg(long, value_name = "FILE")]
        config: PathBuf,
        /// End when every vehicle's mission is over: exit 0 if all succeeded, 1 if not.
        #[arg(long)]
        until_over: bool,
        /// Least number of this life, for a station that has lost the folder where its lives are counted: others say it.
        #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1 << 48))]
        incarnation: u64,
    },
    /// Make a fleet's authority and the certificates of its nodes, or renew them.
    Certificates(certificates::Certificates),
    #[command(flatten)]
    Order(order::OrderCommand),
    /// Plan for the fleet: who reaches which target by what way, so that all arrive together. Without `--send` nobody is
    /// ordered anything.
    Plan(plan::PlanCommand),
    /// Fly the fleet on from where it is now in simulation, several times, and say what comes of it; nobody is ordered
    /// anything.
    Rehearse(rehearse::RehearseCommand),
    /// Say where each vehicle of a station that runs is, what it does and for whom it waits.
    Status(caller::Call),
    /// Draw no-fly zones, fences, threats, limits of height and rally points for all vehicles, list and remove them.
    #[command(subcommand)]
    Zone(zone::ZoneCommand),
    /// Play a recorded mission in the console, with a time line; with --json print what it came to.
    Replay {
        /// The recording, such as mission.mcap; one that was cut short is played as far as it goes.
        file: PathBuf,
        /// Where to serve the console; port 0 is any free one.
        #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8700")]
        console: SocketAddr,
    },
    /// Explain why vehicles of a recorded mission moved or stood still: who requested what, who blocked it, and what
    /// would have to change.
    Explain {
        /// The recording, such as mission.mcap.
        file: PathBuf,
        /// Moment of the mission, in seconds; negative counts back from the end [default: the end].
        #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
        at: Option<f64>,
        /// Number or name of one vehicle, such as 3 or uav/3 [default: all, with details of those that stand still].
        #[arg(long, value_name = "VEHICLE")]
        vehicle: Option<String>,
    },
}

/// Runs the program, with the behaviours that `add` adds to it.
pub fn main(add: impl FnOnce(&mut Behaviours)) -> ExitCode {
    let mut known = Behaviours::default();
    add(&mut known);
    skein_zenoh::share_threads();
    skein_zenoh::log("info", false);
    let cli = Cli::parse();
    let outcome = match &cli.command {
        Command::Serve { config, until_over, incarnation } => {
            serve(config, &known, *until_over, *incarnation, cli.json)
        }
        Command::Certificates(args) => certificates::run(args, cli.json),
        Command::Status(call) => status::run(call, cli.json),
        Command::Replay { file, console } => replay::run(file, *console, cli.json),
        Command::Zone(command) => zone::run(command, cli.json),
        Command::Order(order) => order::run(order, cli.json),
        Command::Plan(command) => plan::run(command, cli.json),
        Command::Rehearse(command) => rehearse::run(command, cli.json),
        Command::Explain { file, at, vehicle } => explain::run(file, *at, vehicle.as_deref(), cli.json),
    };
    match outcome {
        Ok(code) => code,
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

fn serve(
    config: &Path,
    known: &Behaviours,
    until_over: bool,
    incarnation: u64,
    json: bool,
) -> anyhow::Result<ExitCode> {
    let mut config = Config::read(config, known)?;
    config.station.incarnation = incarnation;
    let outcome = serve::run(config, until_over)?;
    let failed = outcome.as_ref().map(|outcome| outcome.failed.clone()).unwrap_or_default();
    if json {
        println!(
            "{}",
            json!({ "over": outcome.is_some(), "succeeded": outcome.is_some() && failed.is_empty(), "failed": failed })
        );
    }
    Ok(ExitCode::from(u8::from(!failed.is_empty())))
}
