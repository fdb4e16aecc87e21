//! A whole swarm in one process: the world, an agent for each vehicle, and the ground station.
//!
//! One call of [`Swarm::step`] is one step of the world. Who calls it, and how often, is the clock's business.

use std::time::{Duration, Instant};

use skein_agent::{AgentConfig, AgentCore, AgentError, Outcome, Parts};
use skein_dbp::{Happened, NodeName};
use skein_ground::{Giver, GroundConfig, GroundCore, Refusal};
use skein_wire::{Link, MemoryStore, Order, Scan};
use skein_world::{Simulation, Truth};

use super::{account::Account, plan_times::PlanTimes, trace_hash::TraceHash};
use crate::summary::{EventCounts, Traffic};

/// Agents and ground tick once in so many steps of the world: every 20 ms.
const STEPS_PER_TICK: u64 = 5;

/// A swarm, the world it flies in, and the links between its nodes.
pub struct Swarm {
    simulation: Simulation,
    vehicles: Vec<Vehicle>,
    ground: GroundCore,
    ground_link: Box<dyn Link>,
    ground_is_dead: bool,
    steps: u64,
    trace: TraceHash,
    /// Equal configurations give equal runs.
    replays: bool,
    events: EventCounts,
    plan_times: PlanTimes,
    stopwatch: Option<Stopwatch>,
}

/// The time that the agents take, by somebody's clock.
#[derive(Clone, Copy)]
struct Stopwatch {
    clock: fn() -> Duration,
    total: Duration,
}

struct Vehicle {
    agent: AgentCore,
    link: Box<dyn Link>,
    /// Its agent was killed.
    is_dead: bool,
    has_mission: bool,
}

/// The events and messages of one step, for a recording.
#[derive(Debug, Default)]
pub struct Happenings {
    /// Selections at their homes, by node.
    pub selections: Vec<Happened>,
    /// Lidar scans, by vehicle.
    pub scans: Vec<(usize, Scan)>,
    /// MAVLink from each autopilot.
    pub mavlink: Vec<Vec<u8>>,
    /// Agents and ground ticked in this step.
    pub ticked: bool,
}

impl Swarm {
    /// Puts an agent beside each vehicle of the world; `links` has one link for each, then the ground's.
    ///
    /// # Errors
    /// [`AgentError`] names what is wrong in an agent's configuration.
    pub fn new(
        simulation: Simulation,
        agents: Vec<AgentConfig>,
        ground: GroundConfig,
        links: Links,
    ) -> Result<Self, AgentError> {
        Self::with_parts(simulation, agents, &Parts::of, ground, links)
    }

    /// The same with agents of these parts.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_parts(
        simulation: Simulation,
        agents: Vec<AgentConfig>,
        parts: &dyn Fn(&AgentConfig) -> Parts,
        ground: GroundConfig,
        links: Links,
    ) -> Result<Self, AgentError> {
        let vehicles = agents
            .into_iter()
            .zip(links.vehicles)
            .map(|(config, link)| {
                let parts = parts(&config);
                let store = Box::new(MemoryStore::default());
                Ok(Vehicle {
                    agent: AgentCore::with_parts(config, parts, Some(store))?,
                    link,
                    is_dead: false,
                    has_mission: true,
                })
            })
            .collect::<Result<_, AgentError>>()?;
        Ok(Self {
            simulation,
            vehicles,
            ground: GroundCore::durable(ground, Box::new(MemoryStore::default())),
            plan_times: PlanTimes::default(),
            stopwatch: None,
            ground_link: links.ground,
            ground_is_dead: false,
            steps: 0,
            trace: TraceHash::default(),
            replays: true,
            events: EventCounts::default(),
        })
    }

    /// Lets others fly vehicles of the world in place of their built-in autopilots. Such a run does not replay.
    ///
    /// # Errors
    /// As `seat`.
    pub fn seat<E>(&mut self, seat: impl FnOnce(&mut Simulation) -> Result<(), E>) -> Result<(), E> {
        self.replays = false;
        seat(&mut self.simulation)
    }

    /// Ends the agent of vehicle `index` as if its process had been killed: it hears and says nothing any more.
    pub fn kill_agent(&mut self, index: usize) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.is_dead = true;
        }
    }

    /// Begins another life of the agent of vehicle `index`, over this link.
    ///
    /// # Errors
    /// [`AgentError`] names what is wrong in its configuration.
    pub fn restart_agent(
        &mut self,
        index: usize,
        config: AgentConfig,
        link: Box<dyn Link>,
    ) -> Result<(), AgentError> {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            let agent = AgentCore::durable(config, Box::new(MemoryStore::default()))?;
            *vehicle = Vehicle { agent, link, is_dead: false, has_mission: true };
        }
        Ok(())
    }

    /// Ends the ground station as if its process had been killed.
    pub fn kill_ground(&mut self) {
        self.ground_is_dead = true;
    }

    /// Begins another life of the ground station, over this link.
    pub fn restart_ground(&mut self, ground: GroundCore, link: Box<dyn Link>) {
        (self.ground, self.ground_link, self.ground_is_dead) = (ground, link, false);
    }

    /// From now on the mission of vehicle `index` is silent, or decides again, as if its thread hung or went
    /// on.
    pub fn halt_mission(&mut self, index: usize, is_silent: bool) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.has_mission = !is_silent;
        }
    }

    /// Moves world, agents and ground on by one step of 4 ms.
    pub fn step(&mut self) -> Happenings {
        self.simulation.step();
        self.steps += 1;
        let now = self.simulation.now();
        let mut happenings = Happenings { scans: self.simulation.take_scans(), ..Happenings::default() };
        for (index, vehicle) in self.vehicles.iter_mut().enumerate() {
            let bytes = self.simulation.receive(index);
            if !vehicle.is_dead {
                vehicle.agent.receive_mavlink(now, &bytes);
            }
            happenings.mavlink.push(bytes);
        }
        for (index, scan) in &happenings.scans {
            if let Some(vehicle) = self.vehicles.get_mut(*index).filter(|vehicle| !vehicle.is_dead) {
                timed(&mut self.stopwatch, || vehicle.agent.sense(now, scan));
            }
        }
        for (index, fix) in self.simulation.take_fixes() {
            if let Some(vehicle) = self.vehicles.get_mut(index).filter(|vehicle| !vehicle.is_dead) {
                timed(&mut self.stopwatch, || vehicle.agent.see_markers(now, &fix));
            }
        }
        if self.steps.is_multiple_of(STEPS_PER_TICK) {
            happenings.ticked = true;
            self.tick(now, &mut happenings.selections);
        }
        for index in 0..self.vehicles.len() {
            if let Some(state) = self.simulation.vehicle(index) {
                self.trace.pose(&state.motion);
            }
        }
        happenings
    }

    fn tick(&mut self, now: Duration, selections: &mut Vec<Happened>) {
        if !self.ground_is_dead
            && let Err(error) = self.ground.tick(now, self.ground_link.as_mut())
        {
            tracing::error!("{error}");
        }
        let mut heard = self.ground.take_selections();
        keep_own(&mut heard, self.ground.name());
        selections.append(&mut heard);
        for (index, vehicle) in self.vehicles.iter_mut().enumerate().filter(|(_, vehicle)| !vehicle.is_dead) {
            let began = Instant::now();
            timed(&mut self.stopwatch, || match vehicle.has_mission {
                true => vehicle.agent.tick(now, vehicle.link.as_mut()),
                false => vehicle.agent.tick_without_mission(now, vehicle.link.as_mut()),
            });
            let mut heard = vehicle.agent.take_selections();
            self.plan_times.take_in(index, began, &heard, vehicle.agent.is_planning());
            self.simulation.send(index, &vehicle.agent.take_mavlink());
            keep_own(&mut heard, vehicle.agent.name());
            selections.append(&mut heard);
        }
        for selection in selections.iter() {
            self.trace.event(selection.home.as_str(), selection.seq, &selection.event);
            self.events.occurred += 1;
            self.events.remote += u64::from(is_requested_from_afar(selection));
        }
    }

    /// Says something to the vehicles, as the ground station itself.
    ///
    /// # Errors
    /// There is no such vehicle, somebody else holds it, or it is a launch, which takes two messages.
    pub fn order(&mut self, order: &Order) -> Result<u64, Refusal> {
        let by = Giver::from(self.ground.name());
        self.ground.order(&by, order)
    }

    /// Says something to the autopilot of vehicle `index`, as another program would.
    pub fn send_mavlink(&mut self, index: usize, bytes: &[u8]) {
        self.simulation.send(index, bytes);
    }

    /// Takes what the autopilot of vehicle `index` has said since the last call, where no agent listens to it: of a
    /// vehicle that the world has beside those of the agents.
    pub fn receive_mavlink(&mut self, index: usize) -> Vec<u8> {
        self.simulation.receive(index)
    }

    /// The ground station.
    #[must_use]
    pub fn ground(&self) -> &GroundCore {
        &self.ground
    }

    /// The ground station, for its operators.
    pub fn ground_mut(&mut self) -> &mut GroundCore {
        &mut self.ground
    }

    /// Every mission has ended, or its vehicle has crashed.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.vehicles.iter().zip(0..).all(|(vehicle, index)| {
            let crashed = self.simulation.vehicle(index).is_some_and(|state| state.crashed);
            crashed || vehicle.agent.outcome().is_some()
        })
    }

    #[must_use]
    pub fn is_grounded(&self) -> bool {
        (0..self.vehicles.len())
            .all(|index| self.simulation.vehicle(index).is_none_or(|state| !state.airborne))
    }

    /// Time since the run began.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.simulation.now()
    }

    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The agents, in the order of their vehicles.
    pub fn agents(&self) -> impl ExactSizeIterator<Item = &AgentCore> {
        self.vehicles.iter().map(|vehicle| &vehicle.agent)
    }

    /// The end of each vehicle's mission, as far as it has come.
    pub fn outcomes(&self) -> impl Iterator<Item = Option<&Outcome>> {
        self.agents().map(AgentCore::outcome)
    }

    /// The account of the run so far; `network` is the traffic of its nodes.
    #[must_use]
    pub fn account(&self, network: Traffic) -> Account<'_> {
        Account {
            simulation: &self.simulation,
            outcomes: self.outcomes().map(Option::<&Outcome>::cloned).collect(),
            waiting_for: self.agents().map(|agent| agent.status(self.now()).waiting_for).collect(),
            set_points: self.agents().map(AgentCore::set_points).collect(),
            plan_times_ms: self.plan_times.milliseconds(),
            events: self.events,
            network,
            trace_hash: self.replays.then(|| self.trace.hex()),
        }
    }

    /// Measures the time of all agents together by this clock from now on.
    pub fn time_agents(&mut self, clock: fn() -> Duration) {
        self.stopwatch = Some(Stopwatch { clock, total: Duration::ZERO });
    }

    /// The time that the agents have taken since [`time_agents`](Self::time_agents).
    #[must_use]
    pub fn agents_time(&self) -> Duration {
        self.stopwatch.map_or(Duration::ZERO, |watch| watch.total)
    }

    #[must_use]
    pub fn truth(&self) -> Truth {
        self.simulation.truth()
    }

    /// Events so far.
    #[must_use]
    pub fn events(&self) -> EventCounts {
        self.events
    }

    /// The hash of everything so far.
    #[must_use]
    pub fn trace_hash(&self) -> String {
        self.trace.hex()
    }
}

/// The links of a swarm's nodes.
pub struct Links {
    /// One for each vehicle.
    pub vehicles: Vec<Box<dyn Link>>,
    /// The ground station's.
    pub ground: Box<dyn Link>,
}

fn timed(stopwatch: &mut Option<Stopwatch>, act: impl FnOnce()) {
    let began = stopwatch.map(|watch| (watch.clock)());
    act();
    if let (Some(watch), Some(began)) = (stopwatch, began) {
        watch.total += (watch.clock)().saturating_sub(began);
    }
}

/// Remote b-threads are named `node#bthread`.
fn is_requested_from_afar(selection: &Happened) -> bool {
    selection.requested_by.iter().any(|bthread| bthread.contains('#'))
}

/// A node hears of all occurrences; each is recorded once, at its home.
fn keep_own(selections: &mut Vec<Happened>, node: &NodeName) {
    selections.retain(|selection| selection.home == *node);
}
