//! The particle swarms with which P3 compares its own.

use rand_chacha::ChaCha8Rng;
use skein_swarm::particle_swarm::{Motion, Mover, Objective as _, SearchSpace, Swarm};
use skein_swarm::route::{Effort, Plan, RouteProblem};

/// A swarm whose numbers never change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baseline {
    /// `w`, or `chi`.
    pub inertia: f64,
    /// `c1` and `c2`.
    pub attraction: f64,
    /// Most that a particle moves at once, as a share of the box's width. P3 does not give it; the usual `vmax = xmax`
    /// (Eberhart and Shi 2000) is half the width of a box `-xmax..xmax`.
    pub max_step: f64,
}

impl Baseline {
    /// The standard swarm: `w = 0.9`, `c1 = c2 = 2` (P3).
    pub const STANDARD: Self = Self { inertia: 0.9, attraction: 2.0, max_step: 0.5 };
    /// The swarm with constriction (Clerc and Kennedy 2002): `chi = 0.729`, `c1 = c2 = 1.494`, which `phi = 4.1`
    /// gives and with which a swarm contracts by itself.
    pub const CONSTRICTION: Self = Self { inertia: 0.729, attraction: 1.494, max_step: 0.5 };

    /// Searches for a route, as [`Planner::plan`](skein_swarm::route::Planner::plan) does.
    #[must_use]
    pub fn plan(self, problem: &mut RouteProblem<'_>, effort: Effort, seed: u64) -> Plan {
        let swarm = Swarm::new(problem.space(), self, effort.particles, seed);
        Plan::by_swarm(problem, swarm, effort)
    }
}

impl Motion for Baseline {
    fn accelerate(&mut self, mover: Mover<'_>, _: &SearchSpace, rng: &mut ChaCha8Rng) {
        mover.attract(self.inertia, self.attraction, self.attraction, rng);
    }

    fn max_step(&self) -> f64 {
        self.max_step
    }
}
