//! The world alone, for agents in other processes: autopilots over MAVLink, lidars and the scene over Zenoh.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use skein_agent::Outcome;
use skein_bp::configuration;
use skein_dbp::{Message, NodeName, Occurrence};
use skein_wire::{Fleet, Key, Link as _, MissionState, Payload, Scan, Scene, State};
use skein_world::{STEP, Simulation};
use skein_zenoh::{NetworkSettings, ZenohConfig, ZenohLink, ZenohSession};

use crate::autopilots::make::Make;
use crate::autopilots::{Autopilots, Companions};
use crate::fly::account::Account;
use crate::fly::{FLEET, GROUND, simulation_config, vehicle_name};
use crate::mavlink_ports::MavlinkPorts;
use crate::scenario::{Scenario, VehiclePlan};
use crate::scene_view;
use crate::summary::{EventCounts, Traffic};

/// The world's node name unless configured otherwise.
pub const WORLD: &str = "sim/world";
/// The world's endpoint unless configured otherwise.
const LISTEN: &str = "tcp/127.0.0.1:7446";
/// The scene is told this often, for ground stations that start late.
const SCENE_PERIOD: Duration = Duration::from_secs(1);
/// A world that is further behind the clock, because it was stopped or cannot keep up, does not hurry to catch up: its
/// vehicles would fly without their agents.
const MOST_BEHIND: Duration = Duration::from_millis(40);

/// The configuration file of a world; `sim-bridge/world.toml` explains it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorldConfig {
    pub fleet: String,
    pub node: String,
    pub network: NetworkSettings,
}

impl Default for WorldConfig {
    fn default() -> Self {
        let network = NetworkSettings { listen: vec![LISTEN.to_owned()], ..NetworkSettings::default() };
        Self { fleet: FLEET.to_owned(), node: WORLD.to_owned(), network }
    }
}

impl WorldConfig {
    /// Reads a configuration file.
    ///
    /// # Errors
    /// The file and the field at fault.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let mut config: Self = configuration::read(&text).with_context(|| path.display().to_string())?;
        config.network = config.network.relative_to(path.parent().unwrap_or(Path::new("")));
        Ok(config)
    }
}

/// A world that keeps pace with the clock on the wall.
pub struct WorldHost {
    simulation: Simulation,
    ports: MavlinkPorts,
    link: ZenohLink,
    locators: Vec<String>,
    scan_keys: Vec<Key>,
    scene_key: Key,
    scene_due: Duration,
    /// Each vehicle's last word.
    heard: BTreeMap<NodeName, State>,
    events: EventCounts,
    traffic: Traffic,
    /// The moment of the world's time 0.
    began: Instant,
    speed: f64,
    lost: Duration,
}

impl WorldHost {
    /// A world that nobody has joined yet.
    ///
    /// # Errors
    /// A port that is taken; an endpoint that cannot be used; an autopilot that does not start.
    pub fn open(
        scenario: &Scenario,
        config: WorldConfig,
        speed: f64,
        port_offset: u16,
        (autopilots, folder): (&Autopilots, &Path),
    ) -> anyhow::Result<Self> {
        let fleet = Fleet::new(&config.fleet)?;
        let node = NodeName::new(&config.node)?;
        let is_px4 = |plan: &VehiclePlan| plan.make() == Make::Px4;
        anyhow::ensure!(
            port_offset == 0 || !scenario.vehicles.iter().any(is_px4),
            "--port-offset {port_offset}: PX4 has ports of its own, which cannot be moved; leave it out"
        );
        let ports = MavlinkPorts::open(scenario.vehicles.iter().map(|plan| !is_px4(plan)), port_offset)?;
        let mut simulation = Simulation::new(simulation_config(scenario));
        autopilots.seat(&mut simulation, scenario, folder, Companions::Elsewhere)?;
        let known = (0..scenario.vehicles.len()).map(vehicle_name).chain([GROUND.clone()]);
        let session = ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network).of(&node, known))?;
        let occurrences = Key::pattern::<Occurrence>(&fleet);
        let scan_key = |index| Key::to_one::<Scan>(&fleet, node.clone(), vehicle_name(index));
        Ok(Self {
            simulation,
            ports,
            link: session.listen(vec![Key::pattern::<State>(&fleet), occurrences])?,
            locators: session.locators().to_vec(),
            scan_keys: (0..scenario.vehicles.len()).map(scan_key).collect(),
            scene_key: Key::to_all::<Scene>(&fleet, node),
            scene_due: Duration::ZERO,
            heard: BTreeMap::new(),
            events: EventCounts::default(),
            traffic: Traffic::default(),
            began: Instant::now(),
            speed,
            lost: Duration::ZERO,
        })
    }

    /// Waits for the next step's time, and takes it.
    pub fn step(&mut self) {
        self.keep_pace();
        self.ports.receive(|index, bytes| self.simulation.send(index, bytes));
        self.simulation.step();
        for index in 0..self.scan_keys.len() {
            let bytes = self.simulation.receive(index);
            self.ports.send(index, &bytes);
        }
        for (index, scan) in self.simulation.take_scans() {
            if let Some(key) = self.scan_keys.get(index) {
                let scan = timed(scan, self.simulation.now());
                self.link.put(key, Payload::Scan(scan).encode());
            }
        }
        if self.simulation.now() >= self.scene_due {
            let scene = self.simulation.scene();
            let period = scene.moving().next().map_or(SCENE_PERIOD, |_| scene_view::MOVING_PERIOD);
            self.scene_due = self.simulation.now() + period;
            self.link.put(&self.scene_key, Payload::Scene(scene_view::view(scene)).encode());
        }
        self.listen();
    }

    fn keep_pace(&mut self) {
        let due = self.began + (self.simulation.now() + STEP).div_f64(self.speed);
        match Instant::now().checked_duration_since(due) {
            None => std::thread::sleep(due.saturating_duration_since(Instant::now())),
            Some(behind) if behind > MOST_BEHIND => {
                self.began += behind;
                self.lost += behind;
            }
            Some(_) => {}
        }
    }

    fn listen(&mut self) {
        while let Some((key, payload)) = self.link.poll() {
            self.traffic.messages += 1;
            self.traffic.bytes += payload.len() as u64;
            match Payload::decode(&payload) {
                Ok(Payload::State(state)) if *key.sender() == state.node => {
                    self.heard.insert(state.node.clone(), state);
                }
                Ok(Payload::Message(Message::Occurrence(occurrence))) => {
                    self.events.occurred += 1;
                    let from_afar = occurrence.requested_by.iter().any(|bthread| bthread.contains('#'));
                    self.events.remote += u64::from(from_afar);
                }
                _ => {}
            }
        }
    }

    /// The end of each vehicle's mission, as far as it has come, by its agent's word.
    fn outcomes(&self) -> impl Iterator<Item = Option<Outcome>> + '_ {
        (0..self.scan_keys.len()).map(|index| {
            let state = self.heard.get(&vehicle_name(index))?;
            match state.mission {
                MissionState::UnderWay => None,
                MissionState::Complete => Some(Outcome::Complete),
                MissionState::Failed => Some(Outcome::Failed(state.task.clone())),
            }
        })
    }

    /// Every mission has ended, and nobody is in the air.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let crashed = |index| self.simulation.vehicle(index).is_some_and(|vehicle| vehicle.crashed);
        self.is_grounded()
            && self.outcomes().enumerate().all(|(index, outcome)| outcome.is_some() || crashed(index))
    }

    #[must_use]
    pub fn is_grounded(&self) -> bool {
        (0..self.scan_keys.len())
            .all(|index| self.simulation.vehicle(index).is_none_or(|vehicle| !vehicle.airborne))
    }

    /// The account of the run so far.
    #[must_use]
    pub fn account(&self) -> Account<'_> {
        let waiting_for =
            |index| self.heard(index).map_or_else(String::new, |state| state.waiting_for.clone());
        Account {
            simulation: &self.simulation,
            outcomes: self.outcomes().collect(),
            waiting_for: (0..self.scan_keys.len()).map(waiting_for).collect(),
            set_points: Vec::new(),
            plan_times_ms: &[],
            events: self.events,
            network: self.traffic,
            trace_hash: None,
        }
    }

    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// A vehicle's last word.
    #[must_use]
    pub fn heard(&self, index: usize) -> Option<&State> {
        self.heard.get(&vehicle_name(index))
    }

    /// Endpoints at which other nodes can connect to this one.
    #[must_use]
    pub fn locators(&self) -> &[String] {
        &self.locators
    }

    /// The vehicles' MAVLink ports.
    #[must_use]
    pub fn ports(&self) -> &MavlinkPorts {
        &self.ports
    }

    /// For how long the world stood still because it was stopped or the computer could not keep up.
    #[must_use]
    pub fn lost(&self) -> Duration {
        self.lost
    }
}

/// A scan with its time on this computer's clock.
fn timed(scan: Scan, now: Duration) -> Scan {
    let unix = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
    Scan { stamp: unix.saturating_sub(now.saturating_sub(scan.stamp)), ..scan }
}
