//! The ground core: the station's program and roster, without I/O.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::catalogue::Whose;
use skein_bp::{Event, EventSet, Program, ProgramConfig};
use skein_dbp::{Board, Happened, Node, NodeConfig, NodeError, NodeName};
use skein_wire::event::{Declared as _, Heard, Situation};
use skein_wire::{Link, MissionState, NodeLink, Readiness, State, Store, joint_roster};

use crate::bthreads::{self, MissionOutcome, Watch};
use crate::config::GroundConfig;
use crate::explain::{Evidence, Explanation, explain};
use crate::order::{Order, Who};
use crate::order_log::{OrderLog, OrderRecord};

/// An order names a vehicle that the station does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is no vehicle of this station")]
pub struct UnknownVehicle {
    pub name: NodeName,
}

/// The ground station. Tick it every 20 ms with its link.
pub struct GroundCore {
    name: NodeName,
    node: NodeLink,
    orders: Vec<(Duration, Order)>,
    vehicles: Vec<NodeName>,
    now: Duration,
    roster: BTreeMap<NodeName, State>,
    readiness: BTreeMap<NodeName, Readiness>,
    order_log: OrderLog,
    evidence: Evidence,
    selections: Vec<Happened>,
}

impl GroundCore {
    /// A station that has heard of nobody yet.
    pub fn new(config: GroundConfig) -> Self {
        Self::with_store(config, None)
    }

    /// A station that keeps in `store` what it must not forget, and takes up what its former life has kept.
    pub fn durable(config: GroundConfig, store: Box<dyn Store>) -> Self {
        Self::with_store(config, Some(store))
    }

    fn with_store(mut config: GroundConfig, store: Option<Box<dyn Store>>) -> Self {
        let mut program = Program::new(ProgramConfig::vehicle(config.seed));
        if config.loaded {
            bthreads::load(&mut program, &config);
        }
        let roster: Vec<_> =
            config.vehicles.iter().chain([&config.name]).chain(&config.operators).cloned().collect();
        let brought = |whose| config.behaviours.events(config.name.as_str(), whose);
        let gateway = EventSet::named(config.name.event_name("order"));
        let node_config = NodeConfig {
            safety: brought(Whose::Own),
            gateway: gateway.or(brought(Whose::Operator)),
            lease: config.lease,
            authority: config.authority,
            joint: Some(joint_roster(config.name.clone(), &roster)),
            durable: store.is_some(),
            kept: config.kept,
            forgot: config.forgot,
            ..NodeConfig::new(config.name.clone(), config.incarnation, roster)
        };
        config.orders.sort_by_key(|(at, _)| *at);
        let node = Node::new(node_config, program);
        let mut evidence = Evidence::default();
        config.vehicles.iter().for_each(|vehicle| evidence.note_vehicle(vehicle));
        let node = match store {
            Some(store) => NodeLink::durable(node, config.fleet, store),
            None => NodeLink::new(node, config.fleet),
        };
        Self {
            node: node.reading_boards(),
            name: config.name,
            orders: config.orders,
            vehicles: config.vehicles,
            now: Duration::ZERO,
            roster: BTreeMap::new(),
            readiness: BTreeMap::new(),
            order_log: OrderLog::default(),
            evidence,
            selections: Vec::new(),
        }
    }

    /// Says something to the vehicles, as the operator. Returns the order's number: see [`orders`](Self::orders).
    ///
    /// # Errors
    /// [`UnknownVehicle`], and then nobody is ordered anything.
    pub fn order(&mut self, order: &Order) -> Result<u64, UnknownVehicle> {
        let who = order.who();
        if let Who::These(named) = who
            && let Some(stranger) = named.iter().find(|name| !self.vehicles.contains(name))
        {
            return Err(UnknownVehicle { name: stranger.clone() });
        }
        let concerned: Vec<_> = self
            .vehicles
            .iter()
            .filter(|vehicle| who.includes(vehicle))
            .map(|vehicle| (vehicle.clone(), self.roster.get(vehicle).map(|state| state.position)))
            .collect();
        for event in order.events(&self.name, &concerned) {
            self.node.node_mut().enqueue(event);
        }
        Ok(self.order_log.give(self.now, order.clone(), concerned.into_iter().map(|(vehicle, _)| vehicle)))
    }

    /// Tells once when the disk does not take `what` must be kept, and once when it does again.
    pub fn note_disk(&mut self, what: &str, trouble: Option<&str>) {
        self.node.node_mut().note_disk(what, trouble);
    }

    /// Hears, decides and answers.
    ///
    /// # Errors
    /// [`NodeError`] when a b-thread misbehaves; the station goes on all the same.
    pub fn tick(&mut self, now: Duration, link: &mut dyn Link) -> Result<(), NodeError> {
        self.now = now;
        let due = self.orders.partition_point(|(at, _)| *at <= now);
        for (_, order) in self.orders.drain(..due).collect::<Vec<_>>() {
            // Nobody is there to hear of a vehicle that is not.
            let _ = self.order(&order);
        }
        let outcome = self.node.pump(now, link);
        for state in self.node.take_states() {
            self.note(state);
        }
        for said in self.node.take_readiness() {
            if self.vehicles.contains(&said.node) {
                self.readiness.insert(said.node.clone(), said);
            }
        }
        self.note_boards(link);
        let happened = self.node.node_mut().take_selections();
        happened.iter().for_each(|happened| self.evidence.note_event(happened.clone()));
        self.order_log.update(now, self.node.node(), &happened);
        self.selections.extend(happened);
        outcome
    }

    fn note(&mut self, state: State) {
        if !self.vehicles.contains(&state.node) {
            return;
        }
        if self.roster.get(&state.node).is_none_or(|known| known.incarnation != state.incarnation) {
            self.node.node_mut().enqueue(first_word(&self.name, &state));
        }
        self.evidence.note_state(self.now, &state);
        self.roster.insert(state.node.clone(), state);
    }

    /// Takes in what the vehicles have on their boards, and tells what this station has.
    fn note_boards(&mut self, link: &mut dyn Link) {
        for board in self.node.take_boards() {
            if self.vehicles.contains(&board.node) {
                self.evidence.note_board(self.now, board);
            }
        }
        if let Some(board) = self.node.put_board(self.now, link) {
            self.evidence.note_board(self.now, board.clone());
        }
    }

    /// The outcome of the mission, once every vehicle is on the ground and knows.
    pub fn finished(&self) -> Option<MissionOutcome> {
        self.node.node().program().state_of::<Watch>(Watch::NAME)?.outcome()
    }

    /// Everything selected here or heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    /// The station's node name.
    pub fn name(&self) -> &NodeName {
        &self.name
    }

    /// The station's node, to explain what it requests and blocks, and what has come in that was not understood.
    pub fn node(&self) -> &NodeLink {
        &self.node
    }

    /// Every vehicle in the order of take-off, with its last word if it has been heard.
    pub fn roster(&self) -> impl Iterator<Item = (&NodeName, Option<&State>)> {
        self.vehicles.iter().map(|vehicle| (vehicle, self.roster.get(vehicle)))
    }

    /// A vehicle's checks before take-off, as it told them last; also of one that does not know where it is.
    pub fn readiness(&self, vehicle: &NodeName) -> Option<&Readiness> {
        self.readiness.get(vehicle)
    }

    /// The newest board of this station and of each vehicle.
    pub fn boards(&self) -> impl Iterator<Item = &Board> {
        self.evidence.boards()
    }

    /// Why a vehicle of this station does what it does now, or does not move.
    pub fn explain(&self, vehicle: &NodeName) -> Option<Explanation> {
        explain(&self.evidence, self.now, vehicle)
    }

    /// The latest orders and their answers, oldest first.
    pub fn orders(&self) -> impl Iterator<Item = &OrderRecord> {
        self.order_log.records()
    }

    /// Grows whenever [`orders`](Self::orders) has changed.
    pub fn orders_revision(&self) -> u64 {
        self.order_log.revision()
    }
}

/// The event by which the station `ground` tells that it has heard a vehicle for the first time in the vehicle's life.
/// So a station that starts late, or again, launches nobody who flies and waits for nobody who has landed.
fn first_word(ground: &NodeName, state: &State) -> Event {
    let situation = match state.mission {
        MissionState::UnderWay if state.armed => Situation::Flying,
        MissionState::UnderWay => Situation::Grounded,
        MissionState::Complete => Situation::Complete,
        MissionState::Failed => Situation::Failed,
    };
    let why = state.task.as_str().into();
    Heard { vehicle: state.node.clone(), situation, why }.at(ground)
}
