//! Three vehicles, a ground station and a gate, over a hostile network in lockstep.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Duration;

use skein_bp::{Event, EventSet, Program, ProgramConfig};
use skein_dbp::{Authority, Grant, Happened, Node, NodeConfig, Role, Roster};
use skein_wire::{Fleet as FleetName, MemoryLink, MemoryStore, Network, NetworkConfig, NodeLink, NodeName};

pub const VEHICLES: [&str; 3] = ["uav/1", "uav/2", "uav/3"];
pub const GROUND: &str = "ground/main";

/// The period of each node's steps.
const TICK: Duration = Duration::from_millis(20);

/// Loses three messages of ten, repeats and reorders others, and delays all by up to 300 ms.
const HOSTILE: NetworkConfig = NetworkConfig {
    latency: (Duration::from_millis(1), Duration::from_millis(300)),
    loss: 0.3,
    duplicate: 0.2,
    reorder: 0.5,
    range_m: None,
};

/// Vehicles may keep each other out of the gate; the ground may lift such a block, and nothing else.
fn rights() -> Authority {
    let role =
        |name: &str, nodes: &str, grant: Grant| Role { name: name.into(), nodes: vec![nodes.into()], grant };
    let vehicle = Grant { request: EventSet::None, block: "uav/*/enter".into() };
    let ground = Grant { request: "uav/*/lift".into(), block: EventSet::None };
    Authority::new(vec![role("vehicle", "uav/*", vehicle), role("ground", "ground/*", ground)], None)
}

/// The nodes, the network between them, and the time that they share.
#[derive(Debug)]
pub struct Fleet {
    seed: u64,
    now: Duration,
    network: Network,
    roster: Vec<NodeName>,
    nodes: BTreeMap<NodeName, (NodeLink, MemoryLink)>,
    /// What survives the end of a node's life.
    stores: BTreeMap<NodeName, MemoryStore>,
}

impl Fleet {
    /// A fleet in which no node runs yet. All chance is drawn from `seed`.
    pub fn new(seed: u64) -> Result<Self, Box<dyn Error>> {
        let names = VEHICLES.into_iter().chain([GROUND]);
        Ok(Self {
            seed,
            now: Duration::ZERO,
            network: Network::new(HOSTILE, seed),
            roster: names.map(NodeName::new).collect::<Result<_, _>>()?,
            nodes: BTreeMap::new(),
            stores: BTreeMap::new(),
        })
    }

    /// Starts a node, again if it has run before, with what `load` adds to its program, given its name.
    pub fn start(
        &mut self,
        name: &str,
        incarnation: u64,
        load: impl FnOnce(&NodeName, &mut Program),
    ) -> Result<(), Box<dyn Error>> {
        let name = NodeName::new(name)?;
        self.stop(&name);
        let mut program = Program::new(ProgramConfig::vehicle(self.seed));
        load(&name, &mut program);
        let store = self.stores.entry(name.clone()).or_default();
        let config = NodeConfig {
            authority: rights(),
            joint: Some(Roster::first(NodeName::new(GROUND)?, self.roster.clone())),
            durable: true,
            kept: store.kept(),
            ..NodeConfig::new(name.clone(), incarnation, self.roster.clone())
        };
        let node = Node::new(config, program);
        let node = NodeLink::durable(node, FleetName::new("example")?, Box::new(store.clone()));
        let link = self.network.join(&name);
        self.nodes.insert(name, (node, link));
        Ok(())
    }

    /// Ends a node's life at once, as a crash does.
    pub fn stop(&mut self, name: &NodeName) {
        self.network.leave(name);
        self.nodes.remove(name);
    }

    /// Cuts one vehicle off from all others, or ends that.
    pub fn cut_off(&mut self, vehicle: Option<usize>) {
        match vehicle.and_then(|index| self.roster.get(index)) {
            Some(name) => self.network.partition(&[std::slice::from_ref(name)]),
            None => self.network.heal(),
        }
    }

    /// Hands a node an event from outside, as its operator does.
    pub fn tell(&mut self, name: &str, event: impl Into<Event>) {
        if let Some((node, _)) = self.nodes.get_mut(name) {
            node.node_mut().enqueue(event);
        }
    }

    /// A node that runs.
    pub fn node(&self, name: &NodeName) -> Option<&Node> {
        self.nodes.get(name).map(|(node, _)| node.node())
    }

    /// Time since the run began.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Lets every node go on once; gives what has occurred, each event at its home.
    pub fn tick(&mut self) -> Result<Vec<Happened>, Box<dyn Error>> {
        self.network.advance(self.now);
        let mut occurred = Vec::new();
        for (name, (node, link)) in &mut self.nodes {
            node.pump(self.now, link)?;
            occurred.extend(node.node_mut().take_selections().into_iter().filter(|seen| seen.home == *name));
        }
        self.now += TICK;
        Ok(occurred)
    }
}
