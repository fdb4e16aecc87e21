//! The program of one vehicle: see `skein-agent --help`.

mod control_thread;
mod exchange;
mod lidar_scans;
mod log;
mod markers;
mod mission_thread;
mod preflight;
mod run;
mod shadow_log;
mod signing_clock;
mod verify;
mod watchdog;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use skein_bp::behaviour::Behaviours;

use crate::config_file::Config;

/// Flies one vehicle: runs its b-threads, navigates, and talks to its autopilot.
#[derive(Parser)]
#[command(
    name = "skein-agent",
    version,
    max_term_width = 80,
    after_help = "Exit codes: 0 done, 1 `verify` found a violation, `preflight` a check\nthat does not pass, or `markers look` no marker, 2 wrong usage or input."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Fly the vehicle until Ctrl-C, which lands it first. A second Ctrl-C ends at once, even in the air.
    Run {
        /// Configuration of the agent; agent/agent.toml explains every field.
        #[arg(long, value_name = "FILE")]
        config: PathBuf,
        /// Fly along with a pilot: plan, and write set-points to a file beside the state, but send the
        /// autopilot none, nor any command.
        #[arg(long)]
        shadow: bool,
        /// Least number of this life, for a vehicle that has lost the folder where its lives are counted: others say it.
        #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1 << 48))]
        incarnation: u64,
    },
    /// Tell every check before take-off, with its value and what to do. Arms nothing; for a vehicle on the ground.
    Preflight(preflight::Preflight),
    /// Print sheets of markers to fly by, or find the markers in a photograph.
    #[command(subcommand)]
    Markers(markers::Markers),
    /// Model-check a vehicle's b-threads against an abstract world, or programs on a small network.
    Verify(verify::Verify),
}

/// Runs the program, with the behaviours that `add` adds to it.
pub fn main(add: impl FnOnce(&mut Behaviours)) -> ExitCode {
    let mut known = Behaviours::default();
    add(&mut known);
    skein_zenoh::share_threads();
    skein_zenoh::log("info", false);
    let done = match Cli::parse().command {
        Command::Run { config, shadow, incarnation } => Config::read(&config, &known)
            .and_then(|mut config| {
                config.agent.incarnation = incarnation;
                run::run(config, shadow)
            })
            .map(|()| ExitCode::SUCCESS),
        Command::Preflight(preflight) => {
            preflight.run(&known).map(|ready| if ready { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        Command::Markers(markers) => markers.run(),
        Command::Verify(verify) => verify.run(&known),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            eprintln!("skein-agent: {error:#}");
            ExitCode::from(2)
        }
    }
}
