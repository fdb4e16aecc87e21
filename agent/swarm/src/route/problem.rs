//! The search for one vehicle's route, as an objective.

use nalgebra::Vector3;

use super::cost::Assessment;
use super::traffic::Traffic;
use super::weights::RouteCost;
use crate::particle_swarm::{Objective, SearchSpace, SearchSpaceError};
use skein_planning::airspace::Airspace;

/// From where to where, through what, among whom.
///
/// A position in the search space is the route's inner waypoints: all their eastings in order, then all northings, then
/// all heights (ENU, metres), each anywhere in the airspace. Its centre is the direct way, cut into equal legs.
#[derive(Clone, Debug)]
pub struct RouteProblem<'a> {
    airspace: &'a Airspace,
    traffic: &'a Traffic,
    cost: RouteCost,
    space: SearchSpace,
    /// Start, waypoints and goal of the route evaluated last.
    route: Vec<Vector3<f64>>,
}

/// Why there is nothing to search.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RouteError {
    #[error("the route's {which} ({:.1}, {:.1}, {:.1}) is outside the airspace; move it, or make the airspace larger", .point.x, .point.y, .point.z)]
    Outside { which: &'static str, point: Vector3<f64> },
    #[error("a route cannot be searched for: {0}")]
    Space(#[from] SearchSpaceError),
}

impl<'a> RouteProblem<'a> {
    /// The search for a route with so many inner waypoints.
    ///
    /// # Errors
    /// If an end is outside the airspace, that is no box, or there is no waypoint.
    pub fn new(
        airspace: &'a Airspace,
        traffic: &'a Traffic,
        cost: RouteCost,
        ends: (Vector3<f64>, Vector3<f64>),
        waypoints: usize,
    ) -> Result<Self, RouteError> {
        let (start, goal) = ends;
        for (which, point) in [("start", start), ("goal", goal)] {
            if airspace.nearest_inside(&point) != point {
                return Err(RouteError::Outside { which, point });
            }
        }
        let direct: Vec<_> = (0..=waypoints + 1)
            .map(|k| start + (goal - start) * (k as f64 / (waypoints + 1) as f64))
            .collect();
        let on_axes = |of: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..3).flat_map(|axis| (1..=waypoints).map(move |k| of(axis, k))).collect()
        };
        let space = SearchSpace::new(
            on_axes(&|axis, _| airspace.lower[axis]),
            on_axes(&|axis, _| airspace.upper[axis]),
        )?
        .in_chains_of(waypoints)?
        .about(on_axes(&|axis, k| direct[k][axis]))?;
        Ok(RouteProblem { airspace, traffic, cost, space, route: direct })
    }

    /// The same with other weights.
    pub fn weighed(&self, cost: RouteCost) -> RouteProblem<'a> {
        RouteProblem { cost, ..self.clone() }
    }

    pub fn airspace(&self) -> &Airspace {
        self.airspace
    }

    pub fn weights(&self) -> &RouteCost {
        &self.cost
    }

    /// Start and goal (ENU, metres).
    pub fn ends(&self) -> (Vector3<f64>, Vector3<f64>) {
        (self.route[0], self.route[self.space.chain() + 1])
    }

    /// The cost of a route of any number of points (ENU, metres), part by part.
    pub fn judge(&self, route: &[Vector3<f64>]) -> Assessment {
        self.cost.assess(route, self.airspace, self.traffic)
    }

    /// Its cost, metres, as far as it is needed to know whether it is below a limit.
    pub(super) fn judge_below(&self, limit_m: f64, route: &[Vector3<f64>]) -> f64 {
        self.cost.assess_below(limit_m, route, self.airspace, self.traffic).cost_m
    }

    /// The route that a position is: start, waypoints, goal (ENU, metres).
    #[must_use]
    pub fn route(&mut self, position: &[f64]) -> &[Vector3<f64>] {
        let waypoints = self.space.chain();
        for k in 0..waypoints {
            self.route[k + 1] =
                Vector3::new(position[k], position[waypoints + k], position[2 * waypoints + k]);
        }
        &self.route
    }
}

impl Objective for RouteProblem<'_> {
    fn space(&self) -> &SearchSpace {
        &self.space
    }

    fn cost_below(&mut self, limit: f64, position: &[f64]) -> f64 {
        let (cost, airspace, traffic) = (self.cost, self.airspace, self.traffic);
        cost.assess_below(limit, self.route(position), airspace, traffic).cost_m
    }
}
