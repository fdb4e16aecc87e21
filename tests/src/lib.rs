//! What the whole-system tests share: flights by command line, and swarms that a test steps by hand.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use skein_bp::behaviour::Behaviours;
use skein_dbp::NodeName;
use skein_sim::autopilots::Autopilots;
use skein_sim::cli::{self, Clock, Controller, Fly, WorldArgs};
use skein_sim::fly::{self, Happenings, Links, Swarm};
use skein_sim::scenario::{Overrides, Scenario};
use skein_sim::summary::Summary;
use skein_wire::{Fleet, Link, Network, NetworkConfig};
use skein_world::Simulation;

/// `fly <scenario> --seed <seed> --clock lockstep --headless`, to be changed before it is flown.
#[must_use]
pub fn flight(scenario: &str, seed: u64) -> Fly {
    Fly {
        world: WorldArgs { scenario: scenario.to_owned(), overrides: Overrides::default(), seed },
        clock: Clock::Lockstep,
        speed: 1.0,
        controller: Controller::Bp,
        autopilots: Autopilots::default(),
        out: None,
        headless: true,
        launch_on_order: false,
        processes: false,
        network: cli::Network::Peer,
        secure: false,
        agent: None,
        ground: None,
        console: Some(([127, 0, 0, 1], 0).into()),
        port_offset: 0,
    }
}

/// Flies it, with its files in a folder that is gone afterwards.
///
/// # Panics
/// When it cannot be flown at all.
#[allow(clippy::expect_used)]
#[must_use]
pub fn fly(mut flight: Fly) -> Summary {
    let folder = tempfile::tempdir().expect("a folder for the run's files");
    flight.out = Some(folder.path().to_owned());
    fly::run(&flight, &Behaviours::default()).expect("a flight that can be flown")
}

/// A swarm in lockstep that a test steps, and the network between its nodes.
pub struct Lockstep {
    pub swarm: Swarm,
    /// Its network, to be cut and mended.
    pub network: Network,
    /// Vehicles, then the ground station.
    pub nodes: Vec<NodeName>,
    pub scenario: Scenario,
}

impl Lockstep {
    /// The swarm of a built-in scenario, on the ground.
    ///
    /// # Panics
    /// When the scenario is not sound.
    #[allow(clippy::expect_used)]
    #[must_use]
    pub fn new(scenario: &str, vehicles: Option<usize>, seed: u64) -> Self {
        Self::of(Scenario::built_in(scenario, vehicles, seed).expect("a built-in scenario"))
    }

    /// The swarm of a scenario file with this text, on the ground.
    ///
    /// # Panics
    /// When the scenario is not sound.
    #[allow(clippy::expect_used)]
    #[must_use]
    pub fn from_text(text: &str) -> Self {
        Self::of(Scenario::from_toml(text, "scenario.toml", None, 1).expect("a sound scenario"))
    }

    /// The swarm of a scenario, on the ground.
    ///
    /// # Panics
    /// When the scenario is not sound.
    #[allow(clippy::expect_used)]
    #[must_use]
    pub fn of(scenario: Scenario) -> Self {
        let network = Network::new(NetworkConfig::default(), scenario.seed);
        let vehicles: Vec<NodeName> = (0..scenario.vehicles.len()).map(fly::vehicle_name).collect();
        let link = |node: &NodeName| Box::new(network.join(node)) as Box<dyn Link>;
        let links = Links { vehicles: vehicles.iter().map(link).collect(), ground: link(&fly::GROUND) };
        let fleet = Fleet::new(fly::FLEET).expect("a plain name");
        let swarm = Swarm::new(
            Simulation::new(fly::simulation_config(&scenario)),
            fly::agent_configs(&scenario),
            fly::ground_config(&scenario, fleet, Controller::Bp),
            links,
        )
        .expect("sound configurations");
        let nodes = vehicles.into_iter().chain([fly::GROUND.clone()]).collect();
        Self { swarm, network, nodes, scenario }
    }

    /// One step of 4 ms.
    pub fn step(&mut self) -> Happenings {
        self.network.advance(self.swarm.now() + skein_world::STEP);
        self.swarm.step()
    }

    /// Steps until `end`, or until the mission is over.
    pub fn run_until(&mut self, end: Duration) {
        while self.swarm.now() < end && !(self.swarm.is_over() && self.swarm.is_grounded()) {
            self.step();
        }
    }
}

/// The folder of real worlds and missions, if it is there; says so if not.
#[must_use]
pub fn shared_data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    if !folder.is_dir() {
        skipped("../shared/data");
        return None;
    }
    Some(folder)
}

/// Says that a test was skipped, past the test runner's capture, so that whoever reads the log sees it.
pub fn skipped(needs: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: needs {needs}");
}
