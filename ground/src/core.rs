//! The ground core: the station's program and roster, without I/O.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::{Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeError, NodeName};
use skein_wire::{Fleet, Link, NodeLink, State};

use crate::Order;
use crate::bthreads::{self, MissionOutcome, Watch};

/// What a ground station must know.
#[derive(Clone, Debug)]
pub struct GroundConfig {
    /// The fleet.
    pub fleet: Fleet,
    /// The station's node name, such as `ground/main`.
    pub name: NodeName,
    /// The vehicles, in the order in which they take off.
    pub vehicles: Vec<NodeName>,
    /// A number that grows with every start of this node.
    pub incarnation: u64,
    /// Orders known in advance, each with its time.
    pub orders: Vec<(Duration, Order)>,
    /// Whether the b-threads are loaded; without them the station listens and asks for nothing.
    pub loaded: bool,
    /// Whether nobody sets out before everybody is in the air.
    pub muster: bool,
    /// Lease of the station's bids.
    pub lease: Duration,
    /// Seed of the program's tie-breaks.
    pub seed: u64,
}

impl GroundConfig {
    /// The station `name`, in its first incarnation, with the usual lease and nothing ordered yet.
    #[must_use]
    pub fn new(fleet: Fleet, name: NodeName, vehicles: Vec<NodeName>) -> Self {
        let lease = Duration::from_secs(1);
        Self {
            fleet,
            name,
            vehicles,
            incarnation: 1,
            orders: Vec::new(),
            loaded: true,
            muster: false,
            lease,
            seed: 0,
        }
    }
}

/// The ground station. Tick it every 20 ms with its link.
pub struct GroundCore {
    name: NodeName,
    node: NodeLink,
    orders: Vec<(Duration, Order)>,
    roster: BTreeMap<NodeName, State>,
    selections: Vec<Happened>,
}

impl GroundCore {
    /// A station that has heard of nobody yet.
    #[must_use]
    pub fn new(mut config: GroundConfig) -> Self {
        let mut program = Program::new(ProgramConfig::vehicle(config.seed));
        if config.loaded {
            bthreads::load(&mut program, &config);
        }
        let roster = config.vehicles.iter().chain([&config.name]).cloned().collect();
        let node_config = NodeConfig {
            lease: config.lease,
            ..NodeConfig::new(config.name.clone(), config.incarnation, roster)
        };
        config.orders.sort_by_key(|(at, _)| *at);
        Self {
            node: NodeLink::new(Node::new(node_config, program), config.fleet),
            name: config.name,
            orders: config.orders,
            roster: BTreeMap::new(),
            selections: Vec::new(),
        }
    }

    /// Says something to the vehicles, as the operator.
    pub fn order(&mut self, order: &Order) {
        let event = order.event(&self.name);
        self.node.node_mut().enqueue(event);
    }

    /// Hears, decides and answers.
    ///
    /// # Errors
    /// [`NodeError`] when a b-thread misbehaves; the station goes on all the same.
    pub fn tick(&mut self, now: Duration, link: &mut dyn Link) -> Result<(), NodeError> {
        let due = self.orders.partition_point(|(at, _)| *at <= now);
        for (_, order) in self.orders.drain(..due).collect::<Vec<_>>() {
            self.order(&order);
        }
        let outcome = self.node.pump(now, link);
        for state in self.node.take_states() {
            self.roster.insert(state.node.clone(), state);
        }
        self.selections.extend(self.node.node_mut().take_selections());
        outcome
    }

    /// How the mission went, once every vehicle is on the ground and knows.
    #[must_use]
    pub fn finished(&self) -> Option<MissionOutcome> {
        self.node.node().program().state_of::<Watch>(Watch::NAME)?.outcome()
    }

    /// Everything selected here or heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    /// The station's node name.
    #[must_use]
    pub fn name(&self) -> &NodeName {
        &self.name
    }

    /// The station's node, to explain what it requests and blocks.
    #[must_use]
    pub fn node(&self) -> &Node {
        self.node.node()
    }

    /// Each vehicle's last word.
    pub fn roster(&self) -> impl Iterator<Item = &State> {
        self.roster.values()
    }
}
