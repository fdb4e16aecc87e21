//! The planners of routes.

use nalgebra::Vector3;

use skein_planning::airspace::Airspace;

use super::cost::Assessment;
use super::problem::{RouteError, RouteProblem};
use super::traffic::Traffic;
use super::weights::RouteCost;
use crate::particle_swarm::{
    Best, Improved, ImprovedConfig, Motion, Objective, Swarm, TabuConfig, TabuSwarm,
};

/// The algorithms of P3. Both begin with the same particles, if the seed is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planner {
    /// The improved particle swarm: on a vehicle.
    Onboard,
    /// The same with tabu search: on the ground.
    Ground,
}

/// The effort for a plan: `particles * generations` evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// `Ns`.
    pub particles: usize,
    /// `T`.
    pub generations: usize,
}

impl Default for Effort {
    /// `Ns = 30`, `T = 50` (P3).
    fn default() -> Self {
        Effort { particles: 30, generations: 50 }
    }
}

/// A route that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Start, waypoints, goal (ENU, metres).
    pub route: Vec<Vector3<f64>>,
    pub assessment: Assessment,
    /// The least cost found until the end of each generation, metres.
    pub convergence_m: Vec<f64>,
}

impl Planner {
    /// Searches for a route. The same seed gives the same one.
    pub fn plan(self, problem: &mut RouteProblem<'_>, effort: Effort, seed: u64) -> Plan {
        let space = problem.space();
        match self {
            Planner::Onboard => {
                let motion = Improved::new(space, ImprovedConfig::default());
                Plan::by_swarm(problem, Swarm::new(space, motion, effort.particles, seed), effort)
            }
            Planner::Ground => {
                let mut swarm = TabuSwarm::new(space, TabuConfig::default(), effort.particles, seed);
                Plan::by(problem, effort, |problem, evaluations| {
                    swarm.run(problem, evaluations);
                    swarm.best().clone()
                })
            }
        }
    }
}

impl Plan {
    /// Lets a swarm in the problem's space search for a route.
    pub fn by_swarm<M: Motion>(problem: &mut RouteProblem<'_>, mut swarm: Swarm<M>, effort: Effort) -> Plan {
        Plan::by(problem, effort, |problem, evaluations| {
            swarm.run(problem, evaluations);
            swarm.best().clone()
        })
    }

    /// Lets `run` spend the evaluations, and asks it for the best so far after each generation.
    fn by<'a>(
        problem: &mut RouteProblem<'a>,
        effort: Effort,
        mut run: impl FnMut(&mut RouteProblem<'a>, usize) -> Best,
    ) -> Plan {
        let mut position = problem.space().centre().to_vec();
        let mut convergence_m = Vec::with_capacity(effort.generations);
        for _ in 0..effort.generations {
            let best = run(problem, effort.particles);
            convergence_m.push(best.cost);
            position = best.position;
        }
        let route = problem.route(&position).to_vec();
        Plan { assessment: problem.judge(&route), route, convergence_m }
    }
}

/// Plans for vehicles one after another, each among those before it. `plan` is given the vehicle's number, from 0,
/// and its problem.
pub fn plan_in_turn<E: From<RouteError>>(
    airspace: &Airspace,
    cost: RouteCost,
    ends: &[(Vector3<f64>, Vector3<f64>)],
    waypoints: usize,
    mut plan: impl FnMut(usize, &mut RouteProblem<'_>) -> Result<Plan, E>,
) -> Result<Vec<Plan>, E> {
    let mut traffic = Traffic::default();
    let mut plans = Vec::with_capacity(ends.len());
    for (vehicle, ends) in ends.iter().enumerate() {
        let next = plan(vehicle, &mut RouteProblem::new(airspace, &traffic, cost, *ends, waypoints)?)?;
        traffic.add(&next.route, &cost);
        plans.push(next);
    }
    Ok(plans)
}
