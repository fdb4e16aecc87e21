//! The command line of `skein-sim`.
//!
//! Exit codes: 0 done, 1 the mission or check failed, 2 wrong usage or input.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use skein_bp::behaviour::Behaviours;

use crate::autopilots::Autopilots;
use crate::mission::Allowances;
use crate::scenario::{Overrides, Scenario, ScenarioError};

/// The end of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done,
    /// The mission or check failed, with a reason.
    Failed,
    /// Wrong usage or input, with file, line and what was expected.
    WrongInput,
}

impl Exit {
    #[must_use]
    pub fn of(succeeded: bool) -> Self {
        if succeeded { Self::Done } else { Self::Failed }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        match exit {
            Exit::Done => Self::from(0),
            Exit::Failed => Self::from(1),
            Exit::WrongInput => Self::from(2),
        }
    }
}

/// Flies a swarm of vehicles, each a behavioural program, in a simulated world.
#[derive(Debug, Clone, PartialEq, Parser)]
#[command(
    name = "skein-sim",
    version,
    max_term_width = 80,
    after_help = "Exit codes: 0 done, 1 mission or check failed, 2 wrong usage or input."
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
    /// Print one JSON object on standard output and nothing else there.
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Command {
    /// Fly a whole mission on this host: world, vehicles, agents and ground station.
    Fly(Fly),
    /// Host the world and its autopilots alone, for agents in other processes.
    Serve(Serve),
    /// Write the configuration files of a scenario's swarm, one for each process.
    Configure(Configure),
    /// Write the routes of a scenario's vehicles, with its zones and rally points, as plans of QGroundControl.
    Plan(Plan),
    /// Fly from a present state in lockstep, once with each of several seeds, and say what comes of it: a JSON object in,
    /// one out (docs/missions.md).
    Rehearse {
        /// The state of the fleet, its routes, zones and known map; standard input without it.
        file: Option<PathBuf>,
    },
    /// List the built-in scenarios.
    List,
    /// Check a scenario, world or mission file.
    Check {
        /// A scenario (.toml), world (.sdf, .world, .csv, .obj, .pcd, .ply) or mission (.plan, .waypoints, .kml,
        /// .geojson, .json), or a built-in scenario's name.
        file: PathBuf,
        #[command(flatten)]
        allowances: Allowances,
        /// Find nothing wrong with solids near the heights of flight that are thinner than 0.2 m in height,
        /// which a planar lidar does not see.
        #[arg(long)]
        thin_solids: bool,
        /// Find nothing wrong with a world of which parts are missing or cannot be read.
        #[arg(long)]
        without_missing: bool,
    },
}

/// Options of `fly`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Fly {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Time of the run: real, with events over Zenoh, or lockstep, in memory and as fast as the processor allows.
    #[arg(long, value_enum, default_value_t = Clock::Real)]
    pub clock: Clock,
    /// Factor over real time; `--clock real` only.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = positive)]
    pub speed: f64,
    /// Controller on board: behavioural programs, one sequential loop that hears no orders, or none, with which the
    /// vehicles stay where they are.
    #[arg(long, value_enum, default_value_t = Controller::Bp)]
    pub controller: Controller,
    #[command(flatten)]
    pub autopilots: Autopilots,
    /// Folder for summary.json and mission.mcap; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Show no live table.
    #[arg(long)]
    pub headless: bool,
    /// Take off when an operator orders it at the console, not as soon as all is ready; `--clock real` only.
    #[arg(long)]
    pub launch_on_order: bool,
    /// Run world, ground station and each agent in a process of its own; `--clock real` only.
    #[arg(long)]
    pub processes: bool,
    /// Topology of the processes' network.
    #[arg(long, value_enum, default_value_t = Network::Peer, requires = "processes")]
    pub network: Network,
    /// Make certificates for the processes, which then talk over TLS, each as itself alone.
    #[arg(long, requires = "processes")]
    pub secure: bool,
    /// Agent to run in place of `skein-agent`: one with your behaviours.
    #[arg(long, value_name = "PATH", requires = "processes")]
    pub agent: Option<PathBuf>,
    /// Ground station to run in place of `skein-ground`: one with your behaviours.
    #[arg(long, value_name = "PATH", requires = "processes")]
    pub ground: Option<PathBuf>,
    /// Address of the console on this computer, `--clock real` only; port 0 takes any that is free [default:
    /// 127.0.0.1:8700, with the offset of ports].
    #[arg(long, value_name = "ADDRESS")]
    pub console: Option<SocketAddr>,
    /// Offset of all network ports, to run beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port_offset: u16,
}

/// Options of `configure`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Configure {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Folder for the files; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub autopilots: Autopilots,
    #[command(flatten)]
    pub setup: Setup,
}

/// Options of `plan`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Plan {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Folder for the plans, one for each vehicle; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// The way in which the processes of a swarm are set up.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct Setup {
    /// Topology of the processes' network.
    #[arg(long, value_enum, default_value_t = Network::Peer)]
    pub network: Network,
    /// Let the swarm take off when an operator orders it, not as soon as it is ready.
    #[arg(long)]
    pub launch_on_order: bool,
    /// Make certificates, and let every node say and hear what is its own alone, over TLS.
    #[arg(long)]
    pub secure: bool,
    /// Offset of all network ports, to run beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port_offset: u16,
}

/// The way in which processes are joined over Zenoh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Network {
    /// Each with every other one.
    Peer,
    /// Through the ground station.
    Router,
    /// Through a `zenohd` that runs beside them.
    Zenohd,
}

/// Options of `serve`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Serve {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Factor over real time.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = positive)]
    pub speed: f64,
    #[command(flatten)]
    pub autopilots: Autopilots,
    /// Configuration of the world's network; sim-bridge/world.toml explains it.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Folder for summary.json; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Offset of all MAVLink ports, to run beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port_offset: u16,
}

/// The world and the swarm in it.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct WorldArgs {
    /// Built-in scenario (see `list`), or scenario file (.toml).
    pub scenario: String,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Seed of every random number.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
}

impl WorldArgs {
    /// Reads the scenario with its files, for a program with these behaviours.
    ///
    /// # Errors
    /// The first fault in them.
    pub fn open(&self, known: &Behaviours) -> Result<Scenario, ScenarioError> {
        Scenario::open_with(&self.scenario, &self.overrides, self.seed, known)
    }
}

/// The time that a run follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Clock {
    /// The clock on the wall, over Zenoh.
    Real,
    /// The simulation's own, in memory; one seed replays bit for bit.
    Lockstep,
}

/// The decider on board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Controller {
    /// Behavioural programs.
    Bp,
    /// One loop around the same planners: the navigator without behavioural programming.
    Sequential,
    /// The same vehicles with no b-threads loaded: nothing flies.
    None,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 => Ok(number),
        _ => Err("expected a number above 0".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use clap::error::ErrorKind;
    use skein_agent::bthreads::LinkLossPolicy;

    use super::*;

    fn parse(line: &str) -> Result<Cli, clap::Error> {
        Cli::try_parse_from(line.split(' '))
    }

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn fly_takes_every_option_of_the_design() {
        let line = "skein-sim fly open --vehicles 4 --seed 7 --clock lockstep --speed 2.5 --controller none \
                    --world w.sdf --mission a.plan --mission b.plan --out run --headless --json \
                    --without-ground return";
        let cli = parse(line).expect("all options are known");
        assert!(cli.json);
        let Command::Fly(fly) = cli.command else { panic!("fly is fly") };
        assert_eq!(
            (fly.clock, fly.controller, fly.speed, fly.headless),
            (Clock::Lockstep, Controller::None, 2.5, true)
        );
        let world = &fly.world;
        assert_eq!((world.scenario.as_str(), world.overrides.vehicles, world.seed), ("open", Some(4), 7));
        assert_eq!(world.overrides.missions, [PathBuf::from("a.plan"), PathBuf::from("b.plan")]);
        assert_eq!(fly.out, Some(PathBuf::from("run")));
        assert_eq!(world.overrides.without_ground, Some(LinkLossPolicy::Return));
    }

    #[test]
    fn a_plain_fly_is_in_real_time_with_programs() {
        let Command::Fly(fly) = parse("skein-sim fly forest").expect("a scenario is enough").command else {
            panic!("fly is fly")
        };
        assert_eq!((fly.clock, fly.controller, fly.speed), (Clock::Real, Controller::Bp, 1.0));
        assert_eq!(fly.world.overrides.vehicles, None);
    }

    #[test]
    fn wrong_usage_exits_with_2() {
        for line in [
            "skein-sim",
            "skein-sim fly",
            "skein-sim fly open --speed 0",
            "skein-sim fly open --speed nan",
            "skein-sim fly open --vehicles -1",
            "skein-sim fly open --clock sundial",
            "skein-sim fly open --without-ground panic",
            "skein-sim fly open --seed x",
            "skein-sim dance",
            "skein-sim experiment sphere",
        ] {
            let error = parse(line).expect_err("wrong usage");
            assert_eq!(error.exit_code(), 2, "{line}");
        }
        assert_eq!(parse("skein-sim fly --help").expect_err("help").kind(), ErrorKind::DisplayHelp);
    }
}
