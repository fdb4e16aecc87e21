//! The command line of `skein-sim`.
//!
//! Exit codes: 0 done, 1 the mission or check failed, 2 wrong usage or input.

use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::builder::{PossibleValue, PossibleValuesParser, RangedU64ValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use skein_bp::behaviour::Behaviours;

use crate::experiment::EXPERIMENTS;
use crate::scenario::{Overrides, Scenario, ScenarioError};

/// How a program ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done,
    /// The mission or check failed, with a reason.
    Failed,
    /// Wrong usage or input, with file, line and what was expected.
    WrongInput,
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
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Print one JSON object on standard output and nothing else there.
    #[arg(long, global = true)]
    pub json: bool,
}

/// What `skein-sim` does.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Command {
    /// Fly a whole mission on this host: world, vehicles, agents and ground station.
    Fly(Fly),
    /// Host the world and its autopilots alone, for agents in other processes.
    Serve(Serve),
    /// Write the configuration files of a scenario's swarm, one for each process.
    Configure(Configure),
    /// Run something many times with faults, and judge it: exit 1 if anything was violated.
    Campaign {
        /// What.
        #[command(subcommand)]
        what: Campaign,
    },
    /// Run a published experiment again, as tables and plots: exit 1 if something that it must reach was missed.
    Experiment(Experiment),
    /// Measure something, and print it.
    Bench {
        /// What.
        #[command(subcommand)]
        what: Bench,
    },
    /// List the built-in scenarios.
    List,
    /// Check a scenario, world or mission file.
    Check {
        /// A scenario (.toml), world (.sdf, .world, .csv) or mission (.plan, .json), or a built-in scenario's name.
        file: PathBuf,
    },
}

/// Options of `experiment`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Experiment {
    /// Which.
    #[arg(value_parser = PossibleValuesParser::new(
        EXPERIMENTS.iter().map(|known| PossibleValue::new(known.name).help(known.about))
    ))]
    pub name: String,
    /// How many runs; as many as were published if not given.
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub runs: Option<usize>,
    /// How many vehicles; as many as were published if not given.
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub vehicles: Option<usize>,
    /// Where published data lies, for those that need it.
    #[arg(long, value_name = "DIR")]
    pub dir: Option<PathBuf>,
    /// Folder for report.json and figures; `out/<name>` if not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Campaigns.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Campaign {
    /// Generated programs on 2 to 10 nodes in memory, in lockstep, under every fault a network and a process can have;
    /// every promise is checked at every step.
    Network(NetworkCampaign),
    /// Whole swarms in lockstep whose vehicles hear one another late and not always: nobody may touch anything.
    Separation(SeparationCampaign),
    /// A swarm as processes over Zenoh, in real time, with a fault at a random moment of each flight.
    #[cfg(feature = "zenoh")]
    Processes {
        /// How many runs of each fault.
        #[arg(long, value_name = "N", default_value_t = 10)]
        seeds: u64,
        /// Only these faults.
        #[arg(long = "fault", value_name = "FAULT", value_enum)]
        faults: Vec<crate::campaign::processes::Fault>,
        /// How many at once.
        #[arg(long, value_name = "N", default_value_t = 2)]
        jobs: u16,
        /// Folder for configurations, logs and recordings.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Use network ports so much further up, beside another swarm on this computer.
        #[arg(long, value_name = "N", default_value_t = 3000)]
        port_offset: u16,
        /// How the processes are joined.
        #[arg(long, value_enum, default_value_t = Network::Peer)]
        network: Network,
    },
}

/// Options of `campaign network`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct NetworkCampaign {
    /// How many seeds.
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub seeds: u64,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub from: u64,
    /// How many at once; as many as this computer has processors if not given.
    #[arg(long, value_name = "N")]
    pub jobs: Option<usize>,
    /// Let every node break this promise on purpose; needs the cargo feature `mutants`.
    #[arg(long = "break", value_name = "PROMISE", ignore_case = true,
        value_parser = ["G1", "G2", "G3", "G4", "G5", "G6", "G7", "G8", "G9"])]
    pub breaks: Option<String>,
}

/// Options of `campaign separation`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct SeparationCampaign {
    /// How many seeds of each scenario.
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub seeds: u64,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub from: u64,
    /// Built-in scenarios.
    #[arg(long = "scenario", value_name = "NAME", default_values_t = ["antipodal".to_owned(), "forest".to_owned()])]
    pub scenarios: Vec<String>,
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 16)]
    pub vehicles: usize,
    /// Mean time that a message takes; each takes from half to one and a half of it.
    #[arg(long, value_name = "MS", default_value_t = 300.0, value_parser = latency_ms)]
    pub latency_ms: f64,
    /// Share of messages that are lost.
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, value_parser = share)]
    pub loss: f64,
    /// How long bids hold elsewhere without being renewed: several times as long as a message takes there and back.
    #[arg(long, value_name = "MS", default_value_t = 4000.0, value_parser = lease_ms)]
    pub lease_ms: f64,
    /// How many at once; as many as this computer has processors if not given.
    #[arg(long, value_name = "N")]
    pub jobs: Option<usize>,
}

/// Options of `fly`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Fly {
    /// What is flown.
    #[command(flatten)]
    pub world: WorldArgs,
    /// Time of the run: real, with events over Zenoh, or lockstep, in memory and as fast as the processor allows.
    #[arg(long, value_enum, default_value_t = Clock::Real)]
    pub clock: Clock,
    /// Factor over real time; `--clock real` only.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = positive)]
    pub speed: f64,
    /// Controller on board: behavioural programs, one sequential loop that hears no orders, or none, with which the vehicles
    /// stay where they are.
    #[arg(long, value_enum, default_value_t = Controller::Bp)]
    pub controller: Controller,
    /// Folder for summary.json and mission.mcap; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Show no live table.
    #[arg(long)]
    pub headless: bool,
    /// Run world, ground station and each agent in a process of its own; `--clock real` only.
    #[arg(long)]
    pub processes: bool,
    /// Topology of the processes' network.
    #[arg(long, value_enum, default_value_t = Network::Peer, requires = "processes")]
    pub network: Network,
    /// Agent to run in place of `skein-agent`: one with your behaviours.
    #[arg(long, value_name = "PATH", requires = "processes")]
    pub agent: Option<PathBuf>,
    /// Ground station to run in place of `skein-ground`: one with your behaviours.
    #[arg(long, value_name = "PATH", requires = "processes")]
    pub ground: Option<PathBuf>,
    /// Address of the console on this computer, `--clock real` only; port 0 takes any that is free.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8700")]
    pub console: SocketAddr,
    /// Offset of all network ports, to run beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port_offset: u16,
}

/// Options of `configure`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Configure {
    /// What will be flown.
    #[command(flatten)]
    pub world: WorldArgs,
    /// Folder for the files; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Topology of the processes' network.
    #[arg(long, value_enum, default_value_t = Network::Peer)]
    pub network: Network,
    /// Let the swarm take off when an operator orders it, not as soon as it is ready.
    #[arg(long)]
    pub launch_on_order: bool,
    /// Offset of all network ports, to run beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port_offset: u16,
}

/// How processes are joined over Zenoh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Network {
    /// Each with every other one.
    Peer,
    /// Through the ground station.
    Router,
    /// Through a `zenohd` that runs beside them.
    Zenohd,
}

/// What can be measured.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Bench {
    /// Behavioural programs on one processor, beside the same on BPpy where Python has it.
    Bp {
        /// How many times each program is run; the median counts.
        #[arg(long, value_name = "N", default_value_t = 5)]
        repetitions: usize,
        /// CPU time of each run.
        #[arg(long, value_name = "S", default_value_t = 0.5, value_parser = positive)]
        seconds: f64,
        /// How many dine while the verifier looks at every state.
        #[arg(long, value_name = "N", default_value_t = 12)]
        philosophers: usize,
    },
    /// Searches on published maps, beside their published lengths.
    Plan(PlanBench),
    /// One tick of a vehicle's navigation: map from a scan of 720 rays, local plan, safety filter with 20 neighbours.
    Nav {
        /// How many ticks.
        #[arg(long, value_name = "N", default_value_t = 2000)]
        ticks: usize,
        /// What forest and neighbours come from.
        #[arg(long, value_name = "S", default_value_t = 1)]
        seed: u64,
    },
    /// Memory and messages per node as a fleet grows, over the network in memory.
    Fleet {
        /// Sizes of the fleet, the ground station included.
        #[arg(long, value_name = "N", value_delimiter = ',', default_values_t = [2, 10, 50, 100])]
        nodes: Vec<usize>,
        /// Simulated time of each run.
        #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = positive)]
        seconds: f64,
    },
    /// One size of fleet, in this process.
    #[command(hide = true)]
    FleetOf {
        /// Size of the fleet.
        nodes: usize,
        /// Simulated time.
        #[arg(long, value_name = "S", value_parser = positive)]
        seconds: f64,
    },
    /// Round trips between processes over Zenoh: plain, through the link's queues, and as events.
    #[cfg(feature = "zenoh")]
    Link {
        /// How many of each kind.
        #[arg(long, value_name = "N", default_value_t = 4000)]
        round_trips: usize,
        /// How many homes confirm a block, each in a process of its own.
        #[arg(long, value_name = "N", default_value_t = 10, value_parser = RangedU64ValueParser::<usize>::new().range(2..))]
        homes: usize,
        /// How many blocks are confirmed.
        #[arg(long, value_name = "N", default_value_t = 500)]
        confirmations: usize,
        /// For how long one process is stopped.
        #[arg(long, value_name = "S", default_value_t = 5.0, value_parser = positive)]
        stopped_s: f64,
    },
    /// A process that `link` talks to.
    #[cfg(feature = "zenoh")]
    #[command(hide = true)]
    LinkPeer {
        /// What it does.
        #[arg(value_enum)]
        role: crate::bench::link_peer::Role,
        /// Where the one who measures listens.
        connect: String,
        /// Its number among the homes, from 1.
        number: usize,
        /// How many homes there are.
        homes: usize,
    },
    /// From an operator's Hold to the last vehicle's acknowledgement, each in a process of its own.
    #[cfg(feature = "zenoh")]
    Hold {
        /// Size of the swarm.
        #[arg(long, value_name = "N", default_value_t = 8)]
        vehicles: usize,
        /// How many times.
        #[arg(long, value_name = "N", default_value_t = 200)]
        holds: usize,
        /// Use network ports so much further up, beside another swarm on this computer.
        #[arg(long, value_name = "N", default_value_t = 2000)]
        port_offset: u16,
    },
}

/// Options of `bench plan`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct PlanBench {
    /// A map of the Moving AI lab's (.map), or a voxel map (.3dmap).
    #[arg(long, value_name = "FILE", requires = "scen", required_unless_present = "peers")]
    pub map: Option<PathBuf>,
    /// Its problems, with their optimal lengths (.scen, .3dscen).
    #[arg(long, value_name = "FILE", requires = "map")]
    pub scen: Option<PathBuf>,
    /// Which search.
    #[arg(long, value_enum, default_value_t = Planner::Astar)]
    pub planner: Planner,
    /// Only the first so many problems.
    #[arg(long, value_name = "N")]
    pub limit: Option<usize>,
    /// How many times the least a way of `weighted` or `budgeted` may cost.
    #[arg(long, value_name = "X", default_value_t = 1.05, value_parser = at_least_one)]
    pub bound: f64,
    /// Most cells to expand for a problem; without end if not given, but for `budgeted`.
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub budget: Option<usize>,
    /// Beside the `pathfinding` crate instead, on random grids and on the map if one is given (cargo feature `peers`).
    #[arg(long)]
    pub peers: bool,
}

/// Searches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Planner {
    /// A*: the shortest way.
    Astar,
    /// Weighted A*: a way within the bound.
    Weighted,
    /// Anytime repairing A*: better ways until one is within the bound or the budget is spent.
    Budgeted,
    /// D* Lite: the shortest way, from scratch.
    DstarLite,
}

impl Planner {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Astar => "astar",
            Self::Weighted => "weighted",
            Self::Budgeted => "budgeted",
            Self::DstarLite => "dstar-lite",
        }
    }
}

/// Options of `serve`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Serve {
    /// What is hosted.
    #[command(flatten)]
    pub world: WorldArgs,
    /// Factor over real time.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = positive)]
    pub speed: f64,
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

/// What world and swarm are simulated.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct WorldArgs {
    /// Built-in scenario (see `list`), or scenario file (.toml).
    pub scenario: String,
    /// Size of the swarm [default: the scenario's].
    #[arg(long, value_name = "N")]
    pub vehicles: Option<usize>,
    /// Seed of every random number.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Gazebo world (SDF) or list of boxes (.csv) in place of the scenario's world.
    #[arg(long = "world", value_name = "FILE")]
    pub world_file: Option<PathBuf>,
    /// QGroundControl plan or LSC mission: one that all fly in trail, or one for each vehicle.
    #[arg(long = "mission", value_name = "FILE")]
    pub missions: Vec<PathBuf>,
}

impl WorldArgs {
    /// Reads the scenario with its files, for a program with these behaviours.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn open(&self, known: &Behaviours) -> Result<Scenario, ScenarioError> {
        let overrides = Overrides { behaviours: known.clone(), ..self.overrides() };
        Scenario::open(&self.scenario, &overrides, self.seed)
    }

    /// What the options set over the scenario.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            vehicles: self.vehicles,
            world: self.world_file.clone(),
            missions: self.missions.clone(),
            behaviours: Behaviours::default(),
        }
    }
}

/// What time a run follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Clock {
    /// The clock on the wall, over Zenoh.
    Real,
    /// The simulation's own, in memory; one seed replays bit for bit.
    Lockstep,
}

/// What decides on board.
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

fn latency_ms(text: &str) -> Result<f64, String> {
    within(text, 0.0..=60_000.0)
}

fn lease_ms(text: &str) -> Result<f64, String> {
    within(text, 100.0..=10_000.0)
}

fn within(text: &str, range: RangeInclusive<f64>) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(format!("expected a number from {} to {}", range.start(), range.end())),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if (0.0..1.0).contains(&number) => Ok(number),
        _ => Err("expected a number from 0 to below 1".to_owned()),
    }
}

fn at_least_one(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number >= 1.0 => Ok(number),
        _ => Err("expected a number, 1 or more".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use clap::error::ErrorKind;

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
                    --world w.sdf --mission a.plan --mission b.plan --out run --headless --json";
        let cli = parse(line).expect("all options are known");
        assert!(cli.json);
        let Command::Fly(fly) = cli.command else { panic!("fly is fly") };
        assert_eq!(
            (fly.clock, fly.controller, fly.speed, fly.headless),
            (Clock::Lockstep, Controller::None, 2.5, true)
        );
        let world = &fly.world;
        assert_eq!((world.scenario.as_str(), world.vehicles, world.seed), ("open", Some(4), 7));
        assert_eq!(world.overrides().missions, [PathBuf::from("a.plan"), PathBuf::from("b.plan")]);
        assert_eq!(fly.out, Some(PathBuf::from("run")));
    }

    #[test]
    fn a_plain_fly_is_in_real_time_with_programs() {
        let Command::Fly(fly) = parse("skein-sim fly forest").expect("a scenario is enough").command else {
            panic!("fly is fly")
        };
        assert_eq!((fly.clock, fly.controller, fly.speed), (Clock::Real, Controller::Bp, 1.0));
        assert_eq!(fly.world.overrides().vehicles, None);
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
            "skein-sim fly open --seed x",
            "skein-sim dance",
        ] {
            let error = parse(line).expect_err("wrong usage");
            assert_eq!(error.exit_code(), 2, "{line}");
        }
        assert_eq!(parse("skein-sim fly --help").expect_err("help").kind(), ErrorKind::DisplayHelp);
    }
}
