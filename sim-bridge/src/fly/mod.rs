//! `fly`: a whole mission on this host, from the scenario to the summary.

pub(crate) mod account;
#[cfg(feature = "zenoh")]
mod apart;
mod plan_times;
#[cfg(feature = "zenoh")]
mod real;
mod recording;
pub(crate) mod report;
mod setup;
mod swarm;
mod trace_hash;
mod trial;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use skein_agent::AgentConfig;
use skein_bp::behaviour::Behaviours;
use skein_ground::{Order, Who};
use skein_wire::{Fleet, Network, NetworkConfig};

pub(crate) use self::swarm::scan_for_agent;
pub use self::{
    recording::Recording,
    setup::{FLEET, GROUND, agent_configs, ground_config, simulation_config, vehicle_name},
    swarm::{Happenings, Links, Swarm},
    trial::{Flown, Trial},
};
use crate::{
    cli::{self, Clock},
    scenario::Scenario,
    summary::{Summary, Traffic},
    table::LiveTable,
};

/// After its time limit a mission is ordered to land, and has this long to do so.
const TIME_TO_LAND: Duration = Duration::from_secs(60);
/// A run that was interrupted this often ends at once, with its files finished.
const PATIENCE: u32 = 2;

/// Flies the mission that the command line asks for, writes its files, and says what came of it.
///
/// # Errors
/// What is wrong with the scenario or the output folder; a failed mission is no error but a [`Summary`] that says so.
pub fn run(args: &cli::Fly, known: &Behaviours) -> anyhow::Result<Summary> {
    let scenario = args.world.open(known)?;
    let out = args.out.clone().unwrap_or_else(|| default_folder(&scenario));
    std::fs::create_dir_all(&out).with_context(|| {
        format!("output folder {}: cannot be made; name another with --out", out.display())
    })?;
    let recording = |out: &Path| Recording::create(&out.join("mission.mcap"), &scenario);
    let mut table = LiveTable::stderr();
    for note in &scenario.notes {
        table.note(note)?;
    }
    anyhow::ensure!(
        !(args.processes && args.clock == Clock::Lockstep),
        "--processes: each process follows the clock on the wall; leave out --clock lockstep"
    );
    anyhow::ensure!(
        !args.processes || args.controller == cli::Controller::Bp,
        "--processes: an agent of its own runs its b-threads; leave out --controller"
    );
    let summary = match args.clock {
        Clock::Lockstep => {
            let table = (!args.headless).then_some(table);
            in_lockstep(&scenario, args.controller, Some(recording(&out)?), table)?
        }
        #[cfg(feature = "zenoh")]
        Clock::Real if args.processes => apart::fly(&scenario, args, &out, table)?,
        #[cfg(feature = "zenoh")]
        Clock::Real => real::fly(&scenario, args, recording(&out)?, table)?,
        #[cfg(not(feature = "zenoh"))]
        Clock::Real => {
            anyhow::bail!("--clock real: built without the cargo feature `zenoh`; use --clock lockstep")
        }
    };
    let path = out.join("summary.json");
    summary.write(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
    Ok(summary)
}

/// Flies a scenario as fast as the processor allows, shows nothing and writes no file.
///
/// # Errors
/// What is wrong with the scenario.
pub(crate) fn in_memory(scenario: &Scenario) -> anyhow::Result<Summary> {
    in_lockstep(scenario, cli::Controller::Bp, None, None)
}

fn in_lockstep(
    scenario: &Scenario,
    controller: cli::Controller,
    recording: Option<Recording>,
    table: Option<LiveTable<std::io::Stderr>>,
) -> anyhow::Result<Summary> {
    let network = memory_network(scenario);
    let links = memory_links(&network, scenario);
    let agents = agent_configs(scenario, controller);
    Flight::new(scenario, controller, agents, links, recording, table)?.fly(&mut Lockstep(network))
}

/// `out/<scenario>-<seed>`, under the current folder.
fn default_folder(scenario: &Scenario) -> PathBuf {
    Path::new("out").join(format!("{}-{}", scenario.name, scenario.seed))
}

fn memory_network(scenario: &Scenario) -> Network {
    let mean = Duration::from_secs_f64(scenario.network.latency_ms / 1000.0);
    let config = NetworkConfig {
        latency: (mean / 2, mean * 3 / 2),
        loss: scenario.network.loss,
        ..NetworkConfig::default()
    };
    Network::new(config, scenario.seed)
}

fn memory_links(network: &Network, scenario: &Scenario) -> Links {
    let vehicles = (0..scenario.vehicles.len())
        .map(|index| Box::new(network.join(&vehicle_name(index))) as Box<dyn skein_wire::Link>)
        .collect();
    Links { vehicles, ground: Box::new(network.join(&GROUND)) }
}

/// Whoever hosts a flight: keeps its pace, and shows it to others.
trait Host {
    /// Before each step of the world.
    fn before_step(&mut self, swarm: &mut Swarm);

    /// After each step, with what happened in it.
    fn after_step(&mut self, swarm: &Swarm, happenings: &Happenings);

    /// Once the mission is over and told of.
    fn after_all(&mut self, _: &mut Swarm) {}

    /// What has passed between the nodes.
    fn traffic(&self) -> Traffic;
}

/// As fast as the processor allows, over the in-memory network; nobody else looks on.
struct Lockstep(Network);

impl Host for Lockstep {
    fn before_step(&mut self, swarm: &mut Swarm) {
        self.0.advance(swarm.now() + skein_world::STEP);
    }

    fn after_step(&mut self, _: &Swarm, _: &Happenings) {}

    fn traffic(&self) -> Traffic {
        let stats = self.0.stats();
        Traffic { messages: stats.messages, bytes: stats.bytes }
    }
}

/// How often the user has asked to stop, with Ctrl-C.
static INTERRUPTIONS: LazyLock<Arc<AtomicU32>> = LazyLock::new(|| {
    let count = Arc::new(AtomicU32::new(0));
    let counter = Arc::clone(&count);
    // Without a handler Ctrl-C ends the process, as it does by itself.
    let _ = ctrlc::set_handler(move || {
        counter.fetch_add(1, Ordering::Relaxed);
    });
    count
});

/// A mission under way.
struct Flight<'a> {
    scenario: &'a Scenario,
    swarm: Swarm,
    recording: Option<Recording>,
    table: Option<LiveTable<std::io::Stderr>>,
    began: Instant,
    /// Why the swarm was ordered to land before its mission was over.
    called_off: Option<CalledOff>,
    network_messages: u64,
}

/// The mission ended before it was over.
struct CalledOff {
    why: String,
    at: Duration,
}

impl<'a> Flight<'a> {
    fn new(
        scenario: &'a Scenario,
        controller: cli::Controller,
        agents: Vec<AgentConfig>,
        links: Links,
        recording: Option<Recording>,
        table: Option<LiveTable<std::io::Stderr>>,
    ) -> anyhow::Result<Self> {
        LazyLock::force(&INTERRUPTIONS);
        let simulation = skein_world::Simulation::new(simulation_config(scenario));
        let ground = ground_config(scenario, Fleet::new(setup::FLEET)?, controller);
        let swarm = Swarm::new(simulation, agents, ground, links)?;
        Ok(Self {
            scenario,
            swarm,
            recording,
            table,
            began: Instant::now(),
            called_off: None,
            network_messages: 0,
        })
    }

    /// Steps until the mission is over.
    fn fly(mut self, host: &mut dyn Host) -> anyhow::Result<Summary> {
        while !self.is_over() {
            host.before_step(&mut self.swarm);
            let happenings = self.swarm.step();
            host.after_step(&self.swarm, &happenings);
            if let Some(recording) = &mut self.recording {
                recording.take_in(&self.swarm, &happenings)?;
            }
            if happenings.ticked {
                self.look_after_limits();
                self.network_messages = host.traffic().messages;
                self.draw()?;
            }
        }
        self.recording.map(Recording::finish).transpose()?;
        let why = self.called_off.map(|called_off| called_off.why);
        let account = self.swarm.account(host.traffic());
        let summary = report::summary(self.scenario, &account, self.began.elapsed(), why);
        host.after_all(&mut self.swarm);
        Ok(summary)
    }

    fn is_over(&self) -> bool {
        let now = self.swarm.now();
        let landed = self.swarm.is_grounded();
        match &self.called_off {
            None => landed && self.swarm.is_over(),
            Some(called_off) => landed || now > called_off.at + TIME_TO_LAND || interruptions() >= PATIENCE,
        }
    }

    fn look_after_limits(&mut self) {
        let now = self.swarm.now();
        let why = if interruptions() > 0 {
            "interrupted"
        } else if now.as_secs_f64() > self.scenario.time_limit_s {
            "the time limit was reached"
        } else {
            return;
        };
        if self.called_off.is_none() {
            self.called_off = Some(CalledOff { why: why.to_owned(), at: now });
            // All are vehicles that there are.
            let _ = self.swarm.order(&Order::Land(Who::All));
        }
    }

    fn draw(&mut self) -> std::io::Result<()> {
        let wall = self.began.elapsed();
        match &mut self.table {
            Some(table) if table.is_due(wall) => {
                let progress = report::progress(&self.swarm, wall, self.network_messages);
                table.draw(wall, &progress, &report::rows(&self.swarm))
            }
            _ => Ok(()),
        }
    }
}

/// How often the user has asked to stop.
pub(crate) fn interruptions() -> u32 {
    LazyLock::force(&INTERRUPTIONS);
    INTERRUPTIONS.load(Ordering::Relaxed)
}
