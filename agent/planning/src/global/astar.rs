//! A*, and A* combined with an artificial potential field (Wang 2023).

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::Potential;
use crate::map::{ClearanceMap, VoxelIndex};
use crate::path::Path;

/// How [`plan`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AstarConfig {
    /// Clearance that every voxel of the path must have, metres: hull radius, tracking error and position
    /// error.
    pub clearance_m: f64,
    /// Clearance from which a path is not made longer to keep further away, metres.
    pub comfort_m: f64,
    /// Added cost per metre at the required clearance; it falls to zero, squared, at `comfort_m`. 0 gives the
    /// shortest path.
    pub comfort_weight: f64,
    /// Most voxels that may be expanded.
    pub budget: usize,
    /// If start and goal differ in height by no more than this, metres, the search stays in the start's layer
    /// (8 neighbours), and height changes evenly along the path. A planar lidar knows no more than its layer.
    /// Otherwise there are 26 neighbours.
    pub planar_band_m: f64,
    /// How far above the higher and below the lower of start and goal a search with 26 neighbours may go,
    /// metres.
    pub vertical_margin_m: f64,
}

impl Default for AstarConfig {
    fn default() -> Self {
        AstarConfig {
            clearance_m: 0.5,
            comfort_m: 1.0,
            comfort_weight: 1.0,
            budget: 200_000,
            planar_band_m: 1.0,
            vertical_margin_m: 2.0,
        }
    }
}

/// A cylinder of any height that a path must not enter: a vehicle that stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Centre (ENU, metres); its height does not matter.
    pub centre: Vector3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
}

/// From where to where, and what is in the way beside the map.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Where the vehicle is (ENU, metres).
    pub start: Vector3<f64>,
    /// Where it shall go.
    pub goal: Vector3<f64>,
    /// `U(n)`, a cost per metre; [`Potential::default`] for plain A*.
    pub potential: &'a Potential,
    /// Places that are blocked though the map is free there.
    pub discs: &'a [Disc],
}

/// A path found.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// From the start to the goal exactly, through voxel centres between.
    pub path: Path,
    /// Sum over the path's steps of length times cost per metre; metres if nothing but length costs.
    pub cost: f64,
    /// Voxels expanded.
    pub expanded: usize,
}

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The start is not in the map's window.
    #[error("start ({:.2}, {:.2}, {:.2}) is outside the map's window; recentre the map on the vehicle", .start.x, .start.y, .start.z)]
    StartOutside {
        /// The start.
        start: Vector3<f64>,
    },
    /// The goal is not in the map's window.
    #[error("goal ({:.2}, {:.2}, {:.2}) is outside the map's window; plan to a nearer one", .goal.x, .goal.y, .goal.z)]
    GoalOutside {
        /// The goal.
        goal: Vector3<f64>,
    },
    /// The goal is too near an obstacle, or in a disc.
    #[error("goal ({:.2}, {:.2}, {:.2}) has a clearance of {clearance_m:.2} m, expected {required_m:.2} m or more", .goal.x, .goal.y, .goal.z)]
    GoalBlocked {
        /// The goal.
        goal: Vector3<f64>,
        /// Clearance there, metres.
        clearance_m: f64,
        /// Clearance required, metres.
        required_m: f64,
    },
    /// No path exists in what is known.
    #[error("no path: everything reachable from the start was searched ({expanded} voxels)")]
    Unreachable {
        /// Voxels expanded.
        expanded: usize,
    },
    /// The budget was spent first.
    #[error("no path within the budget of {budget} expansions")]
    BudgetExhausted {
        /// The budget.
        budget: usize,
        /// The way to the voxel nearest to the goal (by the heuristic) that was reached.
        partial: Path,
    },
}

/// Memory that searches reuse, so that a replan allocates nothing and clears nothing.
#[derive(Clone, Debug, Default)]
pub struct AstarScratch {
    nodes: Vec<Node>,
    generation: u32,
    open: BinaryHeap<Open>,
}

/// What a search knows of a voxel; valid if `generation` is the search's own.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    g: f64,
    generation: u32,
    /// Index of the move that led here, or [`ROOT`].
    arrived_by: u8,
    closed: bool,
}

/// Room in a voxel that is occupied.
const BLOCKED: i32 = i32::MIN;
/// How finely depth in a disc is told apart.
const DISC_STEPS: f64 = 64.0;
/// Mark of the start, which no move led to.
const ROOT: u8 = u8::MAX;

/// An entry of the open list: least `f` first, then greatest `g`, then lowest index, so that ties have one
/// answer.
#[derive(Clone, Copy, Debug)]
struct Open {
    f: f64,
    g: f64,
    index: usize,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.f.total_cmp(&self.f).then(self.g.total_cmp(&other.g)).then(other.index.cmp(&self.index))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

/// Finds the path of least cost from start to goal.
///
/// The cost of a step is its length times the mean, over its two voxels, of `1 + comfort + U`: `comfort`
/// keeps paths away from obstacles where that is cheap, and `U` is Wang's potential, so that the evaluation
/// is `f = g + h` outside the potential field and `f = g + h + U` inside it (Wang 2023). `U` is summed into
/// `g` along the path: added to the last node alone, it would change the order of the search but not which
/// path is best. The heuristic is the shortest way on an empty grid (octile distance; never less than Wang's
/// Euclidean one). It never overestimates, because a metre costs at least 1: the path found is optimal on the
/// grid.
///
/// A diagonal step needs every voxel of the box it sweeps to be passable: no corners are cut. Unknown space
/// is passable. A start closer to obstacles than required may be left by steps of growing clearance.
///
/// The layers searched are tracked in `map` from then on.
///
/// # Errors
/// See [`PlanError`].
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::global::{Potential, astar};
/// use skein_planning::map::{ClearanceMap, VoxelMapConfig};
///
/// let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
/// let request = astar::Request {
///     start: Vector3::new(0.1, 0.1, 3.1),
///     goal: Vector3::new(6.1, 0.1, 3.1),
///     potential: &Potential::default(),
///     discs: &[],
/// };
/// let plan = astar::plan(&mut map, &request, &astar::AstarConfig::default(), &mut astar::AstarScratch::default()).unwrap();
/// assert!((plan.cost - 6.0).abs() < 1e-9);
/// ```
pub fn plan(
    map: &mut ClearanceMap,
    request: &Request<'_>,
    config: &AstarConfig,
    scratch: &mut AstarScratch,
) -> Result<Plan, PlanError> {
    let planar = (request.goal.z - request.start.z).abs() <= config.planar_band_m;
    let voxels = map.voxels();
    let start = voxels.index_of(&request.start).ok_or(PlanError::StartOutside { start: request.start })?;
    let outside = PlanError::GoalOutside { goal: request.goal };
    let mut goal = voxels.index_of(&request.goal).ok_or(outside)?;
    let layers = if planar {
        goal.z = start.z;
        start.z..start.z + 1
    } else {
        let margin = (config.vertical_margin_m / voxels.config().resolution_m).ceil().max(0.0) as usize;
        start.z.min(goal.z).saturating_sub(margin)..(start.z.max(goal.z) + margin + 1).min(voxels.counts()[2])
    };
    for z in layers.clone() {
        map.track_layer(z);
    }
    let [nx, ny, _] = map.voxels().counts();
    let mut search = Search {
        map,
        request,
        config,
        required: map.required(config.clearance_m),
        moves: moves(planar),
        box_low: [0, 0, layers.start],
        box_size: [nx, ny, layers.len()],
        start,
        goal,
        scratch,
    };
    search.check_goal()?;
    search.run(planar)
}

/// A step to a neighbour.
struct Move {
    by: [i32; 3],
    /// Length in voxels.
    length: f64,
    /// The other voxels of the box between here and there.
    swept: Vec<[i32; 3]>,
}

fn moves(planar: bool) -> Vec<Move> {
    let heights: &[i32] = if planar { &[0] } else { &[-1, 0, 1] };
    let mut moves = Vec::new();
    for dz in heights {
        for (dy, dx) in [-1, 0, 1].into_iter().flat_map(|dy| [-1, 0, 1].map(|dx| (dy, dx))) {
            let by = [dx, dy, *dz];
            if by == [0, 0, 0] {
                continue;
            }
            let squared: i32 = by.iter().map(|c| c * c).sum();
            // Each subset of the axes moved along is a corner of the box; all and none are the step's ends.
            let swept = (1..7)
                .map(|axes| [0, 1, 2].map(|axis: usize| if axes >> axis & 1 == 1 { by[axis] } else { 0 }))
                .filter(|corner| *corner != by && *corner != [0, 0, 0])
                .collect::<std::collections::BTreeSet<_>>();
            moves.push(Move { by, length: f64::from(squared).sqrt(), swept: swept.into_iter().collect() });
        }
    }
    moves
}

struct Search<'a> {
    map: &'a ClearanceMap,
    request: &'a Request<'a>,
    config: &'a AstarConfig,
    /// Squared distance to the nearest occupied voxel that is enough.
    required: i32,
    moves: Vec<Move>,
    box_low: [usize; 3],
    box_size: [usize; 3],
    start: VoxelIndex,
    goal: VoxelIndex,
    scratch: &'a mut AstarScratch,
}

impl Search<'_> {
    fn check_goal(&self) -> Result<(), PlanError> {
        let room = self.room(self.goal);
        if room >= self.required || self.start == self.goal {
            return Ok(());
        }
        Err(PlanError::GoalBlocked {
            goal: self.request.goal,
            clearance_m: self.map.clearance_of(room.max(0)),
            required_m: self.config.clearance_m,
        })
    }

    fn run(&mut self, planar: bool) -> Result<Plan, PlanError> {
        let count = self.box_size.iter().product();
        let scratch = &mut *self.scratch;
        scratch.open.clear();
        if scratch.nodes.len() < count {
            scratch.nodes.resize(count, Node::default());
        }
        scratch.generation = match scratch.generation.checked_add(1) {
            Some(generation) => generation,
            None => {
                scratch.nodes.fill(Node::default());
                1
            }
        };
        let mut best = self.start;
        let mut best_h = self.heuristic(self.start);
        self.open(self.start, 0.0, ROOT);
        let mut expanded = 0;
        while let Some(next) = self.scratch.open.pop() {
            let node = &mut self.scratch.nodes[next.index];
            if node.closed || next.g > node.g {
                continue;
            }
            node.closed = true;
            let here = self.voxel(next.index);
            if here == self.goal {
                let path = self.path_to(here, self.request.goal, planar);
                return Ok(Plan { path, cost: next.g * self.resolution_m(), expanded });
            }
            let h = self.heuristic(here);
            if h < best_h {
                (best, best_h) = (here, h);
            }
            if expanded == self.config.budget {
                let end = self.map.voxels().centre_of(best);
                return Err(PlanError::BudgetExhausted {
                    budget: expanded,
                    partial: self.path_to(best, end, planar),
                });
            }
            expanded += 1;
            self.expand(here, next.g);
        }
        Err(PlanError::Unreachable { expanded })
    }

    fn expand(&mut self, here: VoxelIndex, g: f64) {
        let room = self.room(here);
        let cost = self.cost(here, room);
        for index in 0..self.moves.len() {
            let Some(there) = self.step(here, self.moves[index].by) else { continue };
            let node = self.scratch.nodes[self.index(there)];
            let seen = node.generation == self.scratch.generation;
            if seen && node.closed {
                continue;
            }
            let there_room = self.room(there);
            if !self.may_enter(here, room, there_room) {
                continue;
            }
            let swept_free = self.moves[index].swept.iter().all(|by| {
                self.step(here, *by).is_some_and(|voxel| self.may_enter(here, room, self.room(voxel)))
            });
            if !swept_free {
                continue;
            }
            let step_cost = self.moves[index].length * 0.5 * (cost + self.cost(there, there_room));
            let g = g + step_cost;
            if !seen || g < node.g {
                self.open(there, g, index as u8);
            }
        }
    }

    fn open(&mut self, voxel: VoxelIndex, g: f64, arrived_by: u8) {
        let index = self.index(voxel);
        let f = g + self.heuristic(voxel);
        self.scratch.nodes[index] =
            Node { g, generation: self.scratch.generation, arrived_by, closed: false };
        self.scratch.open.push(Open { f, g, index });
    }

    /// Squared distance, in voxels, to the nearest obstacle; inside a disc negative, and less the nearer to
    /// its centre; in an obstacle [`BLOCKED`].
    fn room(&self, voxel: VoxelIndex) -> i32 {
        let room = self.map.squared_at(voxel);
        if room == 0 {
            return BLOCKED;
        }
        let mut least = room;
        if !self.request.discs.is_empty() {
            let centre = self.map.voxels().centre_of(voxel);
            for disc in self.request.discs {
                let offset = (centre - disc.centre).xy();
                let inside = (disc.radius_m * disc.radius_m - offset.norm_squared()) / self.resolution_m();
                if inside > 0.0 {
                    least = least.min(-((inside * DISC_STEPS).ceil() as i32));
                }
            }
        }
        least
    }

    /// A voxel may be entered if it has the clearance, or, on the way out of a place that has not, if it has
    /// more. From the start, as much is enough.
    fn may_enter(&self, here: VoxelIndex, here_room: i32, there_room: i32) -> bool {
        let better = there_room > here_room
            || (here == self.start && there_room == here_room && there_room != BLOCKED);
        there_room >= self.required || (here_room < self.required && better)
    }

    /// Cost per metre.
    fn cost(&self, voxel: VoxelIndex, room: i32) -> f64 {
        let mut cost = 1.0;
        let clearance_m = self.map.clearance_of(room.max(0));
        let span_m = self.config.comfort_m - self.config.clearance_m;
        if span_m > 0.0 && clearance_m < self.config.comfort_m {
            let discomfort = (self.config.comfort_m - clearance_m) / span_m;
            cost += self.config.comfort_weight * discomfort * discomfort;
        }
        if !self.request.potential.is_zero() {
            cost += self.request.potential.at(&self.map.voxels().centre_of(voxel));
        }
        cost
    }

    /// Shortest way on an empty grid, in voxels.
    fn heuristic(&self, voxel: VoxelIndex) -> f64 {
        let mut apart =
            [voxel.x.abs_diff(self.goal.x), voxel.y.abs_diff(self.goal.y), voxel.z.abs_diff(self.goal.z)];
        apart.sort_unstable();
        let [least, middle, most] = apart.map(|count| count as f64);
        // Diagonals through space, then through a face, then along an axis.
        least * 3.0_f64.sqrt() + (middle - least) * 2.0_f64.sqrt() + (most - middle)
    }

    /// The way to `last`, the start's and the end's voxels replaced by the exact places.
    fn path_to(&self, last: VoxelIndex, end: Vector3<f64>, planar: bool) -> Path {
        let mut points = vec![end];
        let mut voxel = last;
        loop {
            let arrived_by = self.scratch.nodes[self.index(voxel)].arrived_by;
            let Some(Move { by, .. }) = self.moves.get(usize::from(arrived_by)) else { break };
            let Some(previous) = self.step(voxel, by.map(|c| -c)) else { break };
            voxel = previous;
            points.push(self.map.voxels().centre_of(voxel));
        }
        if let Some(first) = points.last_mut()
            && last != self.start
        {
            *first = self.request.start;
        }
        if last == self.start {
            points.push(self.request.start);
        }
        points.reverse();
        if planar {
            spread_height(&mut points, self.request);
        }
        Path::new(points).unwrap_or_else(|| Path::at(self.request.start))
    }

    fn step(&self, from: VoxelIndex, by: [i32; 3]) -> Option<VoxelIndex> {
        let x = from.x.checked_add_signed(by[0] as isize)?;
        let y = from.y.checked_add_signed(by[1] as isize)?;
        let z = from.z.checked_add_signed(by[2] as isize)?;
        let inside = x < self.box_size[0]
            && y < self.box_size[1]
            && (self.box_low[2]..self.box_low[2] + self.box_size[2]).contains(&z);
        inside.then_some(VoxelIndex { x, y, z })
    }

    fn index(&self, voxel: VoxelIndex) -> usize {
        ((voxel.z - self.box_low[2]) * self.box_size[1] + voxel.y) * self.box_size[0] + voxel.x
    }

    fn voxel(&self, index: usize) -> VoxelIndex {
        let [nx, ny, _] = self.box_size;
        VoxelIndex { x: index % nx, y: index / nx % ny, z: index / (nx * ny) + self.box_low[2] }
    }

    fn resolution_m(&self) -> f64 {
        self.map.voxels().config().resolution_m
    }
}

/// Lets height change evenly along a path planned in one layer.
fn spread_height(points: &mut [Vector3<f64>], request: &Request<'_>) {
    let level = |a: &Vector3<f64>, b: &Vector3<f64>| (a.xy() - b.xy()).norm();
    let to_goal = points.last().map_or(0.0, |last| level(last, &request.goal));
    let length: f64 = points.windows(2).map(|pair| level(&pair[0], &pair[1])).sum::<f64>() + to_goal;
    let climb = request.goal.z - request.start.z;
    let mut travelled = 0.0;
    let mut previous = request.start;
    for point in points.iter_mut() {
        travelled += level(&previous, point);
        previous = *point;
        point.z = request.start.z + if length > 0.0 { climb * travelled / length } else { 0.0 };
    }
}
