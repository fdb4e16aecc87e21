//! A swarm as processes over Zenoh, and one fault at a random moment of its flight.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::ValueEnum;
use nix::sys::signal::Signal;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use skein_agent::Outcome;
use skein_dbp::{BidRecord, NodeName, Occurrence, Presence};
use skein_sim::autopilots::Autopilots;
use skein_sim::cli::{Network, Setup};
use skein_sim::configure;
use skein_sim::fly::{FLEET, GROUND, vehicle_name};
use skein_sim::processes::Processes;
use skein_sim::scenario::{Overrides, Scenario};
use skein_sim::world_host;
use skein_wire::{Fleet, Key, Link as _, Scan, Scene, State};
use skein_zenoh::{NetworkSettings, ZenohConfig, ZenohSession};

use super::cable::Cable;
use crate::operator::Operator;

/// The fault comes between these times after the start, s.
const MOMENT_S: (f64, f64) = (6.0, 30.0);
/// Time for which a process or the world is stopped, or a cable cut.
const PAUSE: Duration = Duration::from_secs(3);
/// A run that takes longer has failed.
const TIME_LIMIT: Duration = Duration::from_secs(150);
/// Distance from the window's middle plane up to which a vehicle is inside it, m.
const WINDOW_DEPTH_M: f64 = 0.8;
/// A vehicle that holds is slower than this, m/s.
const HOLDS_M_S: f64 = 0.5;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Fault {
    /// Nothing.
    None,
    /// The ground station's process is killed.
    GroundKilled,
    /// The same, and it is started again.
    GroundRestarted,
    /// A flying vehicle's agent is killed.
    AgentKilled,
    /// The same, and it is started again.
    AgentRestarted,
    /// A flying vehicle's agent is stopped for three seconds.
    AgentStopped,
    /// The world stands still for three seconds.
    WorldPaused,
    /// One vehicle's network is cut for three seconds, before a window that only one may pass at a time.
    NodeCut,
    /// A second process takes a flying vehicle's name.
    SameName,
    /// Garbage, and messages of 10 MB, on every kind of key.
    Garbage,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::None,
        Self::GroundKilled,
        Self::GroundRestarted,
        Self::AgentKilled,
        Self::AgentRestarted,
        Self::AgentStopped,
        Self::WorldPaused,
        Self::NodeCut,
        Self::SameName,
        Self::Garbage,
    ];

    /// The fault in a word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::GroundKilled => "ground-killed",
            Self::GroundRestarted => "ground-restarted",
            Self::AgentKilled => "agent-killed",
            Self::AgentRestarted => "agent-restarted",
            Self::AgentStopped => "agent-stopped",
            Self::WorldPaused => "world-paused",
            Self::NodeCut => "node-cut",
            Self::SameName => "same-name",
            Self::Garbage => "garbage",
        }
    }

    fn scenario(self) -> &'static str {
        if self == Self::NodeCut { "window" } else { "forest" }
    }

    /// Every vehicle is to complete its mission all the same.
    fn is_survived_by_all(self) -> bool {
        matches!(self, Self::None | Self::GroundRestarted | Self::WorldPaused | Self::NodeCut | Self::Garbage)
    }
}

/// One run.
#[derive(Debug, Clone)]
pub struct Trial {
    pub fault: Fault,
    /// From which the world, the moment and the victim come.
    pub seed: u64,
    /// Time of the fault, s.
    pub at_s: f64,
    pub violations: Vec<String>,
}

/// Flies once with one fault. Configurations, logs and the recording stay in `folder`.
///
/// # Errors
/// The swarm cannot be started at all.
pub fn run(
    fault: Fault,
    seed: u64,
    folder: &Path,
    port_offset: u16,
    network: Network,
) -> anyhow::Result<Trial> {
    // Left from a run before.
    let _ = std::fs::remove_dir_all(folder);
    let mut random = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(31).wrapping_add(fault as u64));
    let at_s = random.random_range(MOMENT_S.0..MOMENT_S.1);
    let scenario = Scenario::open(fault.scenario(), &Overrides::default(), seed)?;
    let vehicles = scenario.vehicles.len();
    let victim = random.random_range(0..vehicles);
    let network = if fault == Fault::NodeCut { Network::Router } else { network };
    let setup = Setup { network, port_offset, launch_on_order: false, secure: false };
    let cable =
        (fault == Fault::NodeCut).then(|| Cable::lay(configure::router_port(port_offset))).transpose()?;
    let mut swarm = Processes::prepare(&scenario, folder, setup, &Autopilots::default())?;
    if let Some(cable) = &cable {
        // The victim's way to the router leads through it.
        swarm.reroute(victim, configure::router_port(port_offset), cable.port())?;
    }
    swarm.start_all()?;
    let mut run = Run {
        swarm,
        vehicles,
        began: Instant::now(),
        violations: Vec::new(),
        watches_window: fault == Fault::NodeCut,
    };
    run.until(|run| run.now_s() >= at_s);
    // A cable has been laid for one vehicle; otherwise any that flies will do.
    let victim = run.await_flying(victim, if cable.is_some() { 1 } else { vehicles });
    let at = run.now_s();
    run.apply(fault, victim, cable.as_ref())?;
    run.finish(fault, victim);
    let violations = std::mem::take(&mut run.violations);
    run.swarm.end();
    Ok(Trial { fault, seed, at_s: at, violations })
}

struct Run {
    swarm: Processes,
    vehicles: usize,
    began: Instant,
    violations: Vec<String>,
    watches_window: bool,
}

impl Run {
    fn now_s(&self) -> f64 {
        self.swarm.world().simulation().now().as_secs_f64()
    }

    /// Waits until one of so many vehicles flies, from the first on, or the mission is over.
    fn await_flying(&mut self, first: usize, among: usize) -> usize {
        let mut found = first;
        self.until(|run| {
            let mut candidates = (0..among).map(|step| (first + step) % run.vehicles);
            let flying = candidates.find(|index| run.is_flying(*index));
            found = flying.unwrap_or(first);
            flying.is_some() || run.swarm.world().is_over()
        });
        found
    }

    fn is_flying(&self, index: usize) -> bool {
        self.swarm.world().heard(index).is_some_and(|state| state.mode == "offboard")
    }

    fn speed(&self, index: usize) -> f64 {
        self.swarm.world().simulation().vehicle(index).map_or(0.0, |vehicle| vehicle.motion.velocity.norm())
    }

    fn violated(&mut self, what: String) {
        if !self.violations.contains(&what) {
            self.violations.push(what);
        }
    }

    /// Steps until something is so, or the time is up.
    fn until(&mut self, mut is_so: impl FnMut(&Self) -> bool) {
        while !is_so(self) {
            if self.began.elapsed() > TIME_LIMIT {
                return;
            }
            self.swarm.step();
            self.look();
        }
    }

    fn for_a_while(&mut self, time: Duration) {
        let until = Instant::now() + time;
        self.until(|_| Instant::now() >= until);
    }

    /// Judges what must hold at every step.
    fn look(&mut self) {
        if !self.watches_window {
            return;
        }
        let world = self.swarm.world().simulation();
        let inside = |index: &usize| {
            world
                .vehicle(*index)
                .is_some_and(|vehicle| vehicle.airborne && vehicle.motion.position.x.abs() < WINDOW_DEPTH_M)
        };
        let count = (0..self.vehicles).filter(inside).count();
        if count > 1 {
            self.violated(format!("{count} vehicles were in the window at once"));
        }
    }

    fn apply(&mut self, fault: Fault, victim: usize, cable: Option<&Cable>) -> anyhow::Result<()> {
        let name = vehicle_name(victim);
        match fault {
            Fault::None => {}
            Fault::GroundKilled => self.kill_ground()?,
            Fault::GroundRestarted => {
                self.kill_ground()?;
                self.for_a_while(Duration::from_secs(2));
                self.swarm.start_node(&GROUND)?;
            }
            Fault::AgentKilled => self.swarm.kill(&name)?,
            Fault::AgentRestarted => self.restart(&name, victim)?,
            Fault::AgentStopped => self.stop(&name, victim)?,
            Fault::WorldPaused => std::thread::sleep(PAUSE),
            Fault::NodeCut => {
                if let Some(cable) = cable {
                    cable.set_cut(true);
                    self.for_a_while(PAUSE);
                    cable.set_cut(false);
                }
            }
            Fault::SameName => self.double(&name, victim)?,
            Fault::Garbage => self.litter()?,
        }
        Ok(())
    }

    /// The recording must be readable to the last second.
    fn kill_ground(&mut self) -> anyhow::Result<()> {
        let recorded_for = self.swarm.age_of(&GROUND).unwrap_or_default();
        self.swarm.kill(&GROUND)?;
        let path = self.swarm.folder().join("mission.mcap");
        let newest = newest_message(&path)?;
        if newest + Duration::from_millis(1600) < recorded_for {
            self.violated(format!("the recording ends at {newest:?}, its station at {recorded_for:?}"));
        }
        Ok(())
    }

    fn restart(&mut self, name: &NodeName, victim: usize) -> anyhow::Result<()> {
        self.swarm.kill(name)?;
        self.for_a_while(Duration::from_millis(300));
        self.swarm.start_node(name)?;
        self.for_a_while(Duration::from_secs(6));
        if self.is_flying(victim) {
            self.violated(format!("{name} flies by itself after its agent was started again"));
        }
        self.in_step(move |operator| {
            operator.order("land", &json!([vehicle_name(victim).as_str()])).map(drop)
        })
    }

    fn stop(&mut self, name: &NodeName, victim: usize) -> anyhow::Result<()> {
        self.swarm.signal(name, Signal::SIGSTOP)?;
        self.for_a_while(PAUSE);
        self.swarm.signal(name, Signal::SIGCONT)?;
        self.for_a_while(Duration::from_secs(1));
        for _ in 0..30 {
            self.for_a_while(Duration::from_millis(100));
            if self.is_flying(victim) {
                self.violated(format!("{name} flies on after its agent was stopped"));
            }
        }
        self.expect_in_log(name, "slept");
        Ok(())
    }

    fn double(&mut self, name: &NodeName, victim: usize) -> anyhow::Result<()> {
        let double = self.swarm.start_double(name)?;
        self.for_a_while(Duration::from_secs(6));
        let speed = self.speed(victim);
        if self.is_flying(victim) && speed > HOLDS_M_S {
            self.violated(format!("{name} moves at {speed:.1} m/s though it shares its name"));
        }
        self.expect_in_log(name, "duplicate_name");
        let said = std::fs::read_to_string(&double.log).unwrap_or_default();
        if !said.contains("duplicate_name") {
            self.violated("the second process says nothing of the name it shares".to_owned());
        }
        drop(double);
        // Others believe the younger of two lives: this one lands when it is asked on its own computer.
        self.swarm.signal(name, Signal::SIGTERM)
    }

    fn litter(&mut self) -> anyhow::Result<()> {
        let fleet = Fleet::new(FLEET)?;
        let endpoint = format!("tcp/127.0.0.1:{}", configure::router_port(self.swarm.port_offset()));
        let network = NetworkSettings::connected_to(vec![endpoint]);
        let session = ZenohSession::open(ZenohConfig::new(fleet.clone(), network))?;
        let mut link = session.listen(vec![Key::pattern::<Scene>(&fleet)])?;
        let all: Vec<NodeName> = (0..self.vehicles).map(vehicle_name).chain([GROUND.clone()]).collect();
        let stranger = NodeName::new("uav/99")?;
        for round in 0..100_u32 {
            for node in &all {
                for key in [
                    Key::to_one::<BidRecord>(&fleet, stranger.clone(), node.clone()),
                    Key::to_all::<State>(&fleet, node.clone()),
                    Key::to_all::<Occurrence>(&fleet, node.clone()),
                    Key::to_one::<Scan>(&fleet, NodeName::new(world_host::WORLD)?, node.clone()),
                ] {
                    link.put(&key, vec![round as u8; 1 + round as usize * 7]);
                }
            }
            if round % 20 == 0 {
                link.put(&Key::to_all::<Presence>(&fleet, stranger.clone()), vec![0xff; 10 << 20]);
            }
            self.for_a_while(Duration::from_millis(50));
        }
        self.expect_in_log(&GROUND, "messages passed over");
        let said = std::fs::read_to_string(self.swarm.log_of(&GROUND)).unwrap_or_default();
        let complaints = said.lines().filter(|line| line.contains("messages passed over")).count();
        if complaints > 20 {
            self.violated(format!("{complaints} complaints in a few seconds"));
        }
        Ok(())
    }

    fn expect_in_log(&mut self, node: &NodeName, word: &str) {
        let said = std::fs::read_to_string(self.swarm.log_of(node)).unwrap_or_default();
        if !said.contains(word) {
            self.violated(format!("{node} does not report `{word}`"));
        }
    }

    /// Lets an operator act while the world goes on.
    fn in_step(
        &mut self,
        act: impl FnOnce(&mut Operator) -> anyhow::Result<()> + Send + 'static,
    ) -> anyhow::Result<()> {
        let console = self.swarm.console();
        let operator = std::thread::spawn(move || act(&mut Operator::connect(console)?));
        while !operator.is_finished() && self.began.elapsed() < TIME_LIMIT {
            self.swarm.step();
            self.look();
        }
        operator.join().map_err(|_| anyhow::anyhow!("the operator's thread has panicked"))?
    }

    /// Flies to the end, and judges.
    fn finish(&mut self, fault: Fault, victim: usize) {
        let settled = |run: &Self| run.swarm.world().is_grounded();
        let mut calm_since = Instant::now();
        self.until(|run| {
            if !settled(run) {
                calm_since = Instant::now();
            }
            run.swarm.world().is_over() || calm_since.elapsed() > Duration::from_secs(25)
        });
        let account = self.swarm.world().account();
        let truth = account.simulation.truth();
        let mut found = Vec::new();
        if truth.collisions_obstacle + truth.collisions_vehicle > 0 {
            found.push(format!(
                "{} collisions with obstacles, {} between vehicles",
                truth.collisions_obstacle, truth.collisions_vehicle
            ));
        }
        for (index, outcome) in account.outcomes.iter().enumerate() {
            let name = vehicle_name(index);
            let vehicle = account.simulation.vehicle(index);
            if vehicle.is_some_and(|vehicle| vehicle.airborne) {
                found.push(format!("{name} is still in the air"));
            }
            let flew = vehicle.is_some_and(|vehicle| !vehicle.flight_time.is_zero());
            // Without a ground station, nobody launches those that still stand.
            let expected = match fault {
                Fault::GroundKilled => flew,
                _ => fault.is_survived_by_all() || index != victim,
            };
            if expected && *outcome != Some(Outcome::Complete) {
                found.push(format!("{name} has not arrived: {outcome:?}"));
            }
        }
        found.into_iter().for_each(|what| self.violated(what));
    }
}

/// The time of the newest message that a recording, complete or not, holds.
fn newest_message(path: &Path) -> anyhow::Result<Duration> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let options = mcap::read::Options::IgnoreEndMagic;
    let messages = mcap::MessageStream::new_with_options(&bytes, options.into())?;
    // What comes after the first fault is what was being written.
    let newest = messages.map_while(Result::ok).map(|message| message.log_time).max();
    Ok(Duration::from_nanos(newest.unwrap_or_default()))
}
