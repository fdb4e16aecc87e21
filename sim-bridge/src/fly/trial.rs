//! A flight in lockstep, neither recorded nor shown, for whoever looks on.

use std::path::Path;
use std::time::Duration;

use skein_agent::{AgentConfig, Parts};
use skein_dbp::Happened;

use super::call_off::interruptions;
use super::{Agents, Flight, Happenings, Host, Lockstep, Swarm, memory_links, memory_network};
use crate::autopilots::Autopilots;
use crate::cli::Controller;
use crate::scenario::Scenario;
use crate::summary::{Summary, Traffic};

/// An onlooker: the swarm, and the selections at their homes since the last tick.
type Watch<'a> = dyn FnMut(&Swarm, &[Happened]) + 'a;

/// A flight to be made.
pub struct Trial<'a> {
    scenario: &'a Scenario,
    agents: Agents,
    autopilots: Option<(&'a Autopilots, &'a Path)>,
    clock: Option<fn() -> Duration>,
}

#[derive(Debug, Clone)]
pub struct Flown {
    /// As of any flight.
    pub summary: Summary,
    /// Time of all its agents together, if a clock was given.
    pub agents_time: Duration,
}

impl<'a> Trial<'a> {
    #[must_use]
    pub fn new(scenario: &'a Scenario, controller: Controller) -> Self {
        Self { scenario, agents: Agents::of(scenario, controller), autopilots: None, clock: None }
    }

    /// Changes every agent's configuration.
    #[must_use]
    pub fn with_agents(mut self, change: impl FnMut(&mut AgentConfig)) -> Self {
        self.agents.configs.iter_mut().for_each(change);
        self
    }

    /// Makes every agent of these parts.
    #[must_use]
    pub fn with_parts(mut self, parts: impl Fn(&AgentConfig) -> Parts + 'static) -> Self {
        self.agents.parts = Box::new(parts);
        self
    }

    /// Lets these autopilots fly the vehicles that have them; their files go into `folder`.
    #[must_use]
    pub fn on(mut self, autopilots: &'a Autopilots, folder: &'a Path) -> Self {
        self.autopilots = Some((autopilots, folder));
        self
    }

    /// Measures the agents' time by this clock.
    #[must_use]
    pub fn timed_by(mut self, clock: fn() -> Duration) -> Self {
        self.clock = Some(clock);
        self
    }

    /// Flies; `watch` sees the swarm after each tick of its agents, and what has happened in it.
    ///
    /// # Errors
    /// A fault in an agent's configuration; or the user has interrupted it.
    pub fn fly(self, watch: &mut Watch<'_>) -> anyhow::Result<Flown> {
        let network = memory_network(self.scenario);
        let links = memory_links(&network, self.scenario);
        let mut flight = Flight::new(self.scenario, self.agents, links, None, None)?;
        if let Some((autopilots, folder)) = self.autopilots {
            flight.seat(autopilots, folder)?;
        }
        if let Some(clock) = self.clock {
            flight.swarm.time_agents(clock);
        }
        let mut agents_time = Duration::ZERO;
        let mut watch = |swarm: &Swarm, selections: &[Happened]| {
            agents_time = swarm.agents_time();
            watch(swarm, selections);
        };
        let summary = flight.fly(&mut Watched { lockstep: Lockstep(network), watch: &mut watch })?;
        anyhow::ensure!(interruptions() == 0, "interrupted");
        Ok(Flown { summary, agents_time })
    }
}

/// Lockstep with an onlooker.
struct Watched<'a> {
    lockstep: Lockstep,
    watch: &'a mut Watch<'a>,
}

impl Host for Watched<'_> {
    fn before_step(&mut self, swarm: &mut Swarm) {
        self.lockstep.before_step(swarm);
    }

    fn after_step(&mut self, swarm: &Swarm, happenings: &Happenings) {
        if happenings.ticked {
            (self.watch)(swarm, &happenings.selections);
        }
    }

    fn traffic(&self) -> Traffic {
        self.lockstep.traffic()
    }
}
