//! A flight of an experiment: in lockstep, neither recorded nor shown.

use std::time::Duration;

use skein_agent::{AgentConfig, Parts};
use skein_dbp::Happened;

use super::{Agents, Flight, Happenings, Host, Lockstep, Swarm, interruptions, memory_links, memory_network};
use crate::cli::Controller;
use crate::cpu_time;
use crate::scenario::Scenario;
use crate::summary::{Summary, Traffic};

/// An onlooker: the swarm, and the selections at their homes since the last tick.
type Watch<'a> = dyn FnMut(&Swarm, &[Happened]) + 'a;

/// A flight to be made.
pub struct Trial<'a> {
    scenario: &'a Scenario,
    agents: Agents,
}

/// What came of a trial.
#[derive(Debug, Clone)]
pub struct Flown {
    /// As of any flight.
    pub summary: Summary,
    /// Processor time of all its agents together.
    pub agents_cpu: Duration,
    /// Processor time of the whole: world, autopilots, agents and ground station.
    pub whole_cpu: Duration,
}

impl<'a> Trial<'a> {
    #[must_use]
    pub fn new(scenario: &'a Scenario, controller: Controller) -> Self {
        Self { scenario, agents: Agents::of(scenario, controller) }
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

    /// Flies; `watch` sees the swarm after each tick of its agents, and what has happened in it.
    ///
    /// # Errors
    /// What is wrong with an agent's configuration; or the user has interrupted it.
    pub fn fly(self, watch: &mut Watch<'_>) -> anyhow::Result<Flown> {
        let began = cpu_time::this_thread()?;
        let network = memory_network(self.scenario);
        let links = memory_links(&network, self.scenario);
        let flight = Flight::new(self.scenario, self.agents, links, None, None)?;
        let mut agents_cpu = Duration::ZERO;
        let mut watch = |swarm: &Swarm, selections: &[Happened]| {
            agents_cpu = swarm.agents_cpu();
            watch(swarm, selections);
        };
        let summary = flight.fly(&mut Watched { lockstep: Lockstep(network), watch: &mut watch })?;
        anyhow::ensure!(interruptions() == 0, "interrupted");
        Ok(Flown { summary, agents_cpu, whole_cpu: cpu_time::this_thread()?.saturating_sub(began) })
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
