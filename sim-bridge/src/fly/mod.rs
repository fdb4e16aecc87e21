//! `fly`: a whole mission on this host, from the scenario to the summary.

pub(crate) mod account;
#[cfg(feature = "zenoh")]
mod apart;
pub(crate) mod call_off;
mod live;
mod plan_times;
#[cfg(feature = "zenoh")]
mod real;
mod recording;
mod setup;
mod swarm;
mod trace_hash;
mod trial;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use skein_agent::{AgentConfig, Parts};
use skein_bp::behaviour::Behaviours;
use skein_ground::explain::Recorded;
use skein_ground::recorder::keep_former;
use skein_ground::replay::Digest;
use skein_wire::event::What;
use skein_wire::{Fleet, Network, NetworkConfig, Order, Who};

use self::call_off::{CalledOff, MissionClock, interruptions};
pub use self::{
    recording::Recording,
    setup::{FLEET, agent_configs, agent_parts, ground_config, simulation_config},
    swarm::{Happenings, Links, Swarm},
    trial::{Flown, Trial},
};
pub use crate::node_names::{GROUND, node_name, vehicle_name};
use crate::{
    autopilots::{Autopilots, Companions, make::Make},
    cli::{self, Clock},
    scenario::Scenario,
    summary::{Summary, Traffic},
    table::LiveTable,
};

/// A run that was interrupted this often ends at once, with its files finished.
const PATIENCE: u32 = 2;

/// Flies the mission that the command line asks for, writes its files, and says what came of it.
///
/// # Errors
/// A fault in the scenario or the output folder; a failed mission is no error but a [`Summary`] that says so.
pub fn run(args: &cli::Fly, known: &Behaviours) -> anyhow::Result<Summary> {
    let mut scenario = args.world.open(known)?;
    args.autopilots.assign(&mut scenario);
    scenario.launch_on_order |= args.launch_on_order;
    let out = args.out.clone().unwrap_or_else(|| default_folder(&scenario));
    std::fs::create_dir_all(&out).with_context(|| {
        format!("output folder {}: cannot be made; name another with --out", out.display())
    })?;
    let recording = |out: &Path| {
        let path = out.join("mission.mcap");
        keep_former(&path)?;
        Recording::create(&path, &scenario)
    };
    let mut table = LiveTable::stderr();
    for note in &scenario.notes {
        table.note(note)?;
    }
    anyhow::ensure!(
        !(args.processes && args.clock == Clock::Lockstep),
        "--processes: each process follows the clock on the wall; leave out --clock lockstep"
    );
    anyhow::ensure!(
        args.clock == Clock::Real || args.speed == 1.0,
        "--speed {}: --clock lockstep is as fast as the processor allows; leave out one of them",
        args.speed
    );
    anyhow::ensure!(
        args.clock == Clock::Real || !args.launch_on_order,
        "--launch-on-order: with --clock lockstep nobody is there to order it; leave out one of them"
    );
    anyhow::ensure!(
        !args.processes || args.controller == cli::Controller::Bp,
        "--processes: an agent of its own runs its b-threads; leave out --controller"
    );
    anyhow::ensure!(
        args.controller == cli::Controller::Bp
            || scenario.vehicles.iter().all(|plan| plan.errands.is_empty()),
        "--controller: without b-threads no vehicle stays at a waypoint or keeps to the speed of a leg, as the mission \
         asks; leave it out"
    );
    let summary = match args.clock {
        Clock::Lockstep => {
            let table = (!args.headless).then_some(table);
            in_lockstep(&scenario, args, recording(&out)?, table, &out)?
        }
        #[cfg(feature = "zenoh")]
        Clock::Real if args.processes => apart::fly(&scenario, args, &out, table)?,
        #[cfg(feature = "zenoh")]
        Clock::Real => real::fly(&scenario, args, recording(&out)?, table, &out)?,
        #[cfg(not(feature = "zenoh"))]
        Clock::Real => {
            anyhow::bail!("--clock real: built without the cargo feature `zenoh`; use --clock lockstep")
        }
    };
    let path = out.join("summary.json");
    summary.write(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
    for line in debrief(&summary, &out.join("mission.mcap")) {
        LiveTable::stderr().note(&line)?;
    }
    Ok(summary)
}

/// How near vehicles were, where that is recorded, and what to do with it.
fn debrief(summary: &Summary, path: &Path) -> Vec<String> {
    let recording = path.display();
    let digest = Recorded::open(path).ok().and_then(|recorded| Digest::of(&recorded));
    let nearest = digest.map(|digest| digest.nearest_in_words()).unwrap_or_default();

    let landed_early = summary.per_vehicle.iter().find(|vehicle| vehicle.reason.is_some());
    let explain = match landed_early {
        Some(vehicle) => format!("skein-ground explain {recording} --vehicle {}", vehicle.id),
        None => format!("skein-ground explain {recording} --at {:.0}", summary.sim_time_s / 2.0),
    };
    let files = [
        format!("recording: {recording}, which Foxglove opens as it is"),
        format!("replay in the console: skein-ground replay {recording}"),
        format!("why a vehicle did what it did: {explain}"),
    ];
    nearest.into_iter().chain(files).collect()
}

fn in_lockstep(
    scenario: &Scenario,
    args: &cli::Fly,
    recording: Recording,
    table: Option<LiveTable<std::io::Stderr>>,
    out: &Path,
) -> anyhow::Result<Summary> {
    let network = memory_network(scenario);
    let links = memory_links(&network, scenario);
    let agents = Agents::of(scenario, args.controller);
    let mut flight = Flight::new(scenario, agents, links, Some(recording), table)?;
    flight.seat(&args.autopilots, out)?;
    flight.fly(&mut Lockstep(network))
}

/// `out/<scenario>-<seed>`, under the current folder.
pub(crate) fn default_folder(scenario: &Scenario) -> PathBuf {
    Path::new("out").join(format!("{}-{}", scenario.name, scenario.seed))
}

fn memory_network(scenario: &Scenario) -> Network {
    let mean = Duration::from_secs_f64(scenario.network.latency_ms / 1000.0);
    let config = NetworkConfig {
        latency: (mean / 2, mean * 3 / 2),
        loss: scenario.network.loss,
        range_m: scenario.network.radio_range_m,
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

    /// The messages between the nodes so far.
    fn traffic(&self) -> Traffic;
}

/// As fast as the processor allows, over the in-memory network; nobody else looks on.
struct Lockstep(Network);

impl Host for Lockstep {
    fn before_step(&mut self, swarm: &mut Swarm) {
        self.0.advance(swarm.now() + skein_world::STEP);
        for (index, agent) in swarm.agents().enumerate() {
            if let Some(vehicle) = swarm.simulation().vehicle(index) {
                self.0.place(agent.name(), vehicle.motion.position.into());
            }
        }
    }

    fn after_step(&mut self, _: &Swarm, _: &Happenings) {}

    fn traffic(&self) -> Traffic {
        let stats = self.0.stats();
        Traffic { messages: stats.messages, bytes: stats.bytes }
    }
}

/// The agents of a flight.
struct Agents {
    configs: Vec<AgentConfig>,
    parts: Box<dyn Fn(&AgentConfig) -> Parts>,
    /// The mind on board; the ground station has b-threads where they do.
    controller: cli::Controller,
}

impl Agents {
    fn of(scenario: &Scenario, controller: cli::Controller) -> Self {
        let parts = Box::new(move |config: &AgentConfig| agent_parts(config, controller));
        Self { configs: agent_configs(scenario), parts, controller }
    }
}

/// A mission under way.
struct Flight<'a> {
    scenario: &'a Scenario,
    swarm: Swarm,
    recording: Option<Recording>,
    table: Option<LiveTable<std::io::Stderr>>,
    began: Instant,
    clock: MissionClock,
    /// Why the swarm was ordered to land before its mission was over.
    called_off: Option<CalledOff>,
}

impl<'a> Flight<'a> {
    fn new(
        scenario: &'a Scenario,
        agents: Agents,
        links: Links,
        recording: Option<Recording>,
        table: Option<LiveTable<std::io::Stderr>>,
    ) -> anyhow::Result<Self> {
        // From now on Ctrl-C calls off.
        interruptions();
        let simulation = skein_world::Simulation::new(simulation_config(scenario));
        let Agents { configs, parts, controller } = agents;
        let ground = ground_config(scenario, Fleet::new(setup::FLEET)?, controller);
        let swarm = Swarm::with_parts(simulation, configs, &*parts, ground, links)?;
        let clock = MissionClock::new(scenario.launch_on_order);
        Ok(Self { scenario, swarm, recording, table, began: Instant::now(), clock, called_off: None })
    }

    /// Lets the autopilots fly that the scenario's vehicles have.
    fn seat(&mut self, autopilots: &Autopilots, out: &Path) -> anyhow::Result<()> {
        if self.scenario.vehicles.iter().any(|plan| plan.make() != Make::BuiltIn) {
            self.swarm
                .seat(|simulation| autopilots.seat(simulation, self.scenario, out, Companions::Here))?;
            self.began = Instant::now();
        }
        Ok(())
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
                self.draw(host.traffic())?;
            }
        }
        self.recording.map(Recording::finish).transpose()?;
        let why = self.called_off.map(|called_off| called_off.why);
        let account = self.swarm.account(host.traffic());
        let summary = account::summary(self.scenario, &account, self.began.elapsed(), why);
        host.after_all(&mut self.swarm);
        Ok(summary)
    }

    fn is_over(&self) -> bool {
        let now = self.swarm.now();
        let landed = self.swarm.is_grounded();
        match &self.called_off {
            None => landed && self.swarm.is_over(),
            Some(called_off) => landed || called_off.is_out_of_time(now) || interruptions() >= PATIENCE,
        }
    }

    fn look_after_limits(&mut self) {
        let now = self.swarm.now();
        let flown = self.clock.time(now, self.swarm.is_grounded());
        if self.called_off.is_none()
            && let Some(why) = call_off::reason(flown, self.scenario.time_limit_s)
        {
            self.called_off = Some(CalledOff { why: why.to_owned(), at: now });
            // All are vehicles that there are.
            let _ = self.swarm.order(&Order::new(What::Land, Who::All));
        }
    }

    fn draw(&mut self, network: Traffic) -> std::io::Result<()> {
        let wall = self.began.elapsed();
        match &mut self.table {
            Some(table) if table.is_due(wall) => {
                let progress = live::progress(&self.swarm.account(network), wall);
                table.draw(wall, &progress, &live::rows(&self.swarm))
            }
            _ => Ok(()),
        }
    }
}
