//! Routes by A* on a lattice, pulled taut and refined: on a fine lattice slow, and near the best there is.

use nalgebra::Vector3;

use super::planner::Plan;
use super::problem::RouteProblem;
use super::weights::RouteCost;
use skein_planning::airspace::Airspace;
use skein_planning::global::{Effort, Search};
use skein_planning::grid::{Lattice, MOVES, moved};
use skein_planning::map::VoxelIndex;

/// The parameters of [`any_angle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnyAngleConfig {
    /// Distance between neighbours of the lattice, metres.
    pub pitch_m: f64,
    /// Longest leg of the route that is refined, metres.
    pub longest_leg_m: f64,
    /// The refinement ends with steps of this length, metres.
    pub finest_m: f64,
    /// The refinement ends when it has looked at so many routes.
    pub evaluations: usize,
}

impl AnyAngleConfig {
    /// Of this effort in an airspace of any size: so many points of the lattice, so many routes looked at.
    pub fn within(airspace: &Airspace, points: usize, evaluations: usize) -> Self {
        let extent = (airspace.upper - airspace.lower).map(|edge| edge.max(f64::MIN_POSITIVE));
        let pitch_m = (extent.product() / points.max(1) as f64).cbrt();
        // A flat box has few layers: its pitch is what cuts its base into so many squares.
        let pitch_m = pitch_m.max((extent.x * extent.y / points.max(1) as f64).sqrt());
        AnyAngleConfig { pitch_m, longest_leg_m: 1.5 * pitch_m, finest_m: pitch_m / 100.0, evaluations }
    }
}

impl Default for AnyAngleConfig {
    fn default() -> Self {
        AnyAngleConfig { pitch_m: 50.0, longest_leg_m: 150.0, finest_m: 0.5, evaluations: usize::MAX }
    }
}

/// The feasible route of least cost that this can find. `None` if no way of the lattice is feasible.
///
/// 1. A* on a cubic lattice, 26 neighbours, by the cost of each leg without the other vehicles: its best way is found.
/// 2. Pulled taut: of all routes through some of that way's points in order, the best, by dynamic programming.
/// 3. Refined, now by the whole cost, others included: legs are divided until none is longer than asked, then
///    waypoints are moved, alone and together with their neighbours, as long as that makes the route cheaper, with
///    steps that get finer.
///
/// It is free in the number of waypoints and in its effort: `O(V log V)` for `V` lattice points, then some thousand
/// evaluations of the cost.
#[must_use]
pub fn any_angle(problem: &RouteProblem<'_>, config: &AnyAngleConfig) -> Option<Plan> {
    let lattice = LegLattice::new(problem, config.pitch_m);
    let taut = lattice.pull_taut(&lattice.search()?);
    Some(refined(&subdivide(&taut, config.longest_leg_m), problem, config))
}

/// A route of any number of points, refined as [`any_angle`] does.
#[must_use]
pub fn refined(route: &[Vector3<f64>], problem: &RouteProblem<'_>, config: &AnyAngleConfig) -> Plan {
    let route = refine(route.to_vec(), problem, config);
    Plan { assessment: problem.judge(&route), route, convergence_m: vec![] }
}

/// Points of the airspace at equal distances, with the legs between neighbours that violate nothing.
struct LegLattice<'a> {
    airspace: &'a Airspace,
    cost: &'a RouteCost,
    ends: (Vector3<f64>, Vector3<f64>),
    pitch_m: f64,
    size: [usize; 3],
}

impl<'a> LegLattice<'a> {
    fn new(problem: &'a RouteProblem<'_>, pitch_m: f64) -> Self {
        let airspace = problem.airspace();
        let extent = airspace.upper - airspace.lower;
        let size = [0, 1, 2].map(|axis| (extent[axis] / pitch_m + 1e-9).floor() as usize + 1);
        LegLattice { airspace, cost: problem.weights(), ends: problem.ends(), pitch_m, size }
    }

    fn point(&self, cell: VoxelIndex) -> Vector3<f64> {
        self.airspace.lower + Vector3::new(cell.x as f64, cell.y as f64, cell.z as f64) * self.pitch_m
    }

    /// The cost of a leg; `None` if it violates something.
    fn leg_m(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<f64> {
        let leg = self.cost.assess_leg(from, to, self.airspace);
        leg.is_feasible().then_some(leg.cost_m)
    }

    /// The moves to neighbours, by number, and where these are.
    fn neighbours(&self, cell: VoxelIndex) -> impl Iterator<Item = (usize, Vector3<f64>)> {
        MOVES.iter().enumerate().filter_map(move |(number, step)| {
            let next = moved(cell, step.by);
            let [wide, deep, high] = self.size;
            (next.x < wide && next.y < deep && next.z < high).then(|| (number, self.point(next)))
        })
    }

    /// The nearest lattice point that can be flown to from an end of the route.
    fn beside(&self, end: &Vector3<f64>) -> Option<VoxelIndex> {
        let near = |axis: usize| {
            let at = ((end[axis] - self.airspace.lower[axis]) / self.pitch_m).floor() as usize;
            (at..=at + 1).filter(move |k| *k < self.size[axis])
        };
        let cells =
            near(2).flat_map(|z| near(1).flat_map(move |y| near(0).map(move |x| VoxelIndex { x, y, z })));
        let distance_m = |cell: &VoxelIndex| (self.point(*cell) - end).norm();
        cells
            .filter(|cell| self.leg_m(end, &self.point(*cell)).is_some())
            .min_by(|one, other| distance_m(one).total_cmp(&distance_m(other)))
    }

    /// The way of least cost along the lattice, with the route's own ends.
    fn search(&self) -> Option<Vec<Vector3<f64>>> {
        let (start, goal) = self.ends;
        let (first, last) = (self.beside(&start)?, self.beside(&goal)?);
        let route = Search::default().solve(self, first, last, Effort::OPTIMAL).ok()?;
        let between = route.cells.iter().map(|cell| self.point(*cell));
        Some(std::iter::once(start).chain(between).chain([goal]).collect())
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

impl Lattice for LegLattice<'_> {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    fn least_costs(&self) -> [f64; 3] {
        let metre = self.cost.length_weight + self.cost.time_weight_m_s / self.cost.cruise_m_s;
        [1.0, 2.0, 3.0].map(|axes: f64| metre * self.pitch_m * axes.sqrt())
    }

    fn steps_from(&self, cell: VoxelIndex, mut visit: impl FnMut(usize, f64)) {
        let here = self.point(cell);
        for (number, there) in self.neighbours(cell) {
            if let Some(leg_m) = self.leg_m(&here, &there) {
                visit(number, leg_m);
            }
        }
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

/// Moves stretches of waypoints along the axes as long as the route gets cheaper: a pattern search (Hooke and Jeeves
/// 1961).
fn refine(
    mut route: Vec<Vector3<f64>>,
    problem: &RouteProblem<'_>,
    config: &AnyAngleConfig,
) -> Vec<Vector3<f64>> {
    let mut best_m = problem.judge(&route).cost_m;
    let mut step_m = config.pitch_m;
    let mut left = config.evaluations;
    while step_m >= config.finest_m && left > 0 {
        let before_m = best_m;
        for reach in [8, 4, 2, 1] {
            for middle in 1..route.len().saturating_sub(1) {
                if left == 0 {
                    return route;
                }
                for direction in DIRECTIONS {
                    left = left.saturating_sub(1);
                    let moved = bulge(&route, middle, reach, &(direction * step_m), problem.airspace());
                    let moved_m = problem.judge_below(best_m, &moved);
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
