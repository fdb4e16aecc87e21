//! Routes by A* on a lattice, pulled taut and refined: slow, and near the best there is.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::{Plan, RouteCost, RouteProblem};
use crate::airspace::Airspace;

/// How [`any_angle`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnyAngleConfig {
    /// Distance between neighbours of the lattice, metres.
    pub pitch_m: f64,
    /// Longest leg of the route that is refined, metres.
    pub longest_leg_m: f64,
    /// The refinement ends with steps of this length, metres.
    pub finest_m: f64,
}

impl Default for AnyAngleConfig {
    fn default() -> Self {
        AnyAngleConfig { pitch_m: 50.0, longest_leg_m: 150.0, finest_m: 0.5 }
    }
}

/// The feasible route of least cost that this can find. `None` if no way of the lattice is feasible.
///
/// 1. A* on a cubic lattice, 26 neighbours, by the cost of each leg without the other vehicles. The heuristic is what the
///    straight way would cost in empty air: the lattice's best way is found.
/// 2. Pulled taut: of all routes through some of that way's points in order, the best, by dynamic programming.
/// 3. Refined, now by the whole cost, others included: legs are divided until none is longer than asked, then waypoints are
///    moved, alone and together with their neighbours, as long as that makes the route cheaper, with steps that get finer.
///
/// It is free in the number of waypoints and in its effort: `O(V log V)` for `V` lattice points, then some thousand
/// evaluations of the cost.
#[must_use]
pub fn any_angle(problem: &RouteProblem<'_>, config: &AnyAngleConfig) -> Option<Plan> {
    let lattice = Lattice::new(problem, config.pitch_m);
    let taut = lattice.pull_taut(&lattice.search()?);
    let route = refine(subdivide(&taut, config.longest_leg_m), problem, config);
    Some(Plan { assessment: problem.judge(&route), route, convergence_m: vec![] })
}

struct Lattice<'a> {
    airspace: &'a Airspace,
    cost: &'a RouteCost,
    start: Vector3<f64>,
    goal: Vector3<f64>,
    pitch_m: f64,
    size: [usize; 3],
}

/// An entry of the open list: the least `f` first, and of equals the first node.
#[derive(PartialEq)]
struct Open {
    f: f64,
    node: usize,
}

impl Eq for Open {}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.f.total_cmp(&self.f).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<'a> Lattice<'a> {
    fn new(problem: &'a RouteProblem<'_>, pitch_m: f64) -> Self {
        let (airspace, (start, goal)) = (problem.airspace(), problem.ends());
        let extent = airspace.upper - airspace.lower;
        let size = [0, 1, 2].map(|axis| (extent[axis] / pitch_m + 1e-9).floor() as usize + 1);
        Lattice { airspace, cost: problem.weights(), start, goal, pitch_m, size }
    }

    /// Lattice points, then start, then goal.
    fn point(&self, node: usize) -> Vector3<f64> {
        let [wide, deep, high] = self.size;
        match node.checked_sub(wide * deep * high) {
            Some(0) => self.start,
            Some(_) => self.goal,
            None => {
                let cell = [node % wide, node / wide % deep, node / (wide * deep)];
                self.airspace.lower + Vector3::from(cell.map(|k| k as f64 * self.pitch_m))
            }
        }
    }

    /// What a leg costs; `None` if it violates something.
    fn leg_m(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<f64> {
        let leg = self.cost.assess_leg(from, to, self.airspace);
        leg.is_feasible().then_some(leg.cost_m)
    }

    /// Never more than the best way costs.
    fn heuristic_m(&self, from: &Vector3<f64>) -> f64 {
        self.cost.least_m(from, &self.goal)
    }

    /// Calls `with` for the nodes next to one.
    fn neighbours(&self, node: usize, mut with: impl FnMut(usize)) {
        let lattice_points: usize = self.size.iter().product();
        let here = self.point(node);
        if (here - self.goal).amax() <= self.pitch_m && node != lattice_points + 1 {
            with(lattice_points + 1);
        }
        let range = |axis: usize| {
            let at = (here[axis] - self.airspace.lower[axis]) / self.pitch_m;
            let low = (at - 1.0 - 1e-9).ceil().max(0.0) as usize;
            let high = (at + 1.0 + 1e-9).floor().min(self.size[axis] as f64 - 1.0) as usize;
            low..=high
        };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let next = x + self.size[0] * (y + self.size[1] * z);
                    if next != node {
                        with(next);
                    }
                }
            }
        }
    }

    fn search(&self) -> Option<Vec<Vector3<f64>>> {
        let lattice_points: usize = self.size.iter().product();
        let (start, goal) = (lattice_points, lattice_points + 1);
        let mut costs_m = vec![f64::INFINITY; lattice_points + 2];
        let mut parents = vec![start; lattice_points + 2];
        let mut closed = vec![false; lattice_points + 2];
        let mut open = BinaryHeap::from([Open { f: 0.0, node: start }]);
        costs_m[start] = 0.0;
        while let Some(Open { node, .. }) = open.pop() {
            if node == goal {
                return Some(self.way_back(goal, start, &parents));
            }
            if std::mem::replace(&mut closed[node], true) {
                continue;
            }
            let here = self.point(node);
            self.neighbours(node, |next| {
                let there = self.point(next);
                if closed[next] {
                    return;
                }
                let Some(leg_m) = self.leg_m(&here, &there) else { return };
                let cost_m = costs_m[node] + leg_m;
                if cost_m < costs_m[next] {
                    costs_m[next] = cost_m;
                    parents[next] = node;
                    open.push(Open { f: cost_m + self.heuristic_m(&there), node: next });
                }
            });
        }
        None
    }

    fn way_back(&self, goal: usize, start: usize, parents: &[usize]) -> Vec<Vector3<f64>> {
        let mut way = vec![self.goal];
        let mut node = goal;
        while node != start {
            node = parents[node];
            way.push(self.point(node));
        }
        way.reverse();
        way
    }

    /// Of all routes through some of the points in order, with the first and the last, the one of least cost.
    fn pull_taut(&self, way: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut best: Vec<(f64, usize)> = vec![(0.0, 0)];
        for to in 1..way.len() {
            let mut least = (f64::INFINITY, to - 1);
            for from in (0..to).rev() {
                if let Some(leg_m) = self.leg_m(&way[from], &way[to])
                    && best[from].0 + leg_m <= least.0
                {
                    least = (best[from].0 + leg_m, from);
                }
            }
            best.push(least);
        }
        let mut taut = Vec::new();
        let mut at = way.len() - 1;
        while at > 0 {
            taut.push(way[at]);
            at = best[at].1;
        }
        taut.push(way[0]);
        taut.reverse();
        taut
    }
}

/// The same route with legs no longer than asked.
fn subdivide(route: &[Vector3<f64>], longest_m: f64) -> Vec<Vector3<f64>> {
    let mut finer: Vec<_> = route.first().copied().into_iter().collect();
    for leg in route.windows(2) {
        let parts = ((leg[1] - leg[0]).norm() / longest_m).ceil().max(1.0);
        finer.extend((1..=parts as usize).map(|k| leg[0] + (leg[1] - leg[0]) * (k as f64 / parts)));
    }
    finer
}

/// Moves stretches of waypoints along the axes as long as the route gets cheaper: a pattern search (Hooke and Jeeves 1961).
fn refine(
    mut route: Vec<Vector3<f64>>,
    problem: &RouteProblem<'_>,
    config: &AnyAngleConfig,
) -> Vec<Vector3<f64>> {
    let mut best_m = problem.judge(&route).cost_m;
    let mut step_m = config.pitch_m;
    while step_m >= config.finest_m {
        let before_m = best_m;
        for reach in [8, 4, 2, 1] {
            for middle in 1..route.len().saturating_sub(1) {
                for direction in DIRECTIONS {
                    let moved = bulge(&route, middle, reach, &(direction * step_m), problem.airspace());
                    let moved_m = problem.judge(&moved).cost_m;
                    if moved_m < best_m {
                        (best_m, route) = (moved_m, moved);
                    }
                }
            }
        }
        if before_m - best_m < 1e-5 * before_m {
            step_m /= 2.0;
        }
    }
    route
}

const DIRECTIONS: [Vector3<f64>; 6] = [
    Vector3::new(1.0, 0.0, 0.0),
    Vector3::new(-1.0, 0.0, 0.0),
    Vector3::new(0.0, 1.0, 0.0),
    Vector3::new(0.0, -1.0, 0.0),
    Vector3::new(0.0, 0.0, 1.0),
    Vector3::new(0.0, 0.0, -1.0),
];

/// The route with a waypoint moved, and its neighbours the less the further they are from it.
fn bulge(
    route: &[Vector3<f64>],
    middle: usize,
    reach: usize,
    by: &Vector3<f64>,
    airspace: &Airspace,
) -> Vec<Vector3<f64>> {
    let last = route.len() - 1;
    let mut moved = route.to_vec();
    for (k, point) in moved.iter_mut().enumerate().take(last).skip(1) {
        let away = k.abs_diff(middle);
        if away < reach {
            *point = airspace.nearest_inside(&(*point + by * (1.0 - away as f64 / reach as f64)));
        }
    }
    moved
}
