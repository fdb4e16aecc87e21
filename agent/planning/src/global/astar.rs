//! A*, and A* combined with an artificial potential field (Wang 2023).

use std::f64::consts::SQRT_2;

use nalgebra::Vector3;

use super::{Effort, Potential, Search, Unsolved};
use crate::grid::{Lattice, MOVES, SQRT_3, moved};
use crate::map::{ClearanceMap, VoxelIndex};
use crate::path::Path;
use crate::region::Region;

/// The settings of [`plan`].
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
    /// The box that the path stays in, and enters if it begins outside.
    pub within: Region,
}

/// A path found.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// From the start to the goal exactly, through voxel centres between.
    pub path: Path,
    /// Sum over the path's steps of length times cost per metre; metres if nothing but length costs.
    pub cost: f64,
    pub expanded: usize,
}

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    #[error("start ({:.2}, {:.2}, {:.2}) is outside the map's window; recentre the map on the vehicle", .start.x, .start.y, .start.z)]
    StartOutside { start: Vector3<f64> },
    #[error("goal ({:.2}, {:.2}, {:.2}) is outside the map's window; plan to a nearer one", .goal.x, .goal.y, .goal.z)]
    GoalOutside { goal: Vector3<f64> },
    #[error("goal ({:.2}, {:.2}, {:.2}) has a clearance of {clearance_m:.2} m, expected {required_m:.2} m or more", .goal.x, .goal.y, .goal.z)]
    GoalBlocked { goal: Vector3<f64>, clearance_m: f64, required_m: f64 },
    #[error("goal ({:.2}, {:.2}, {:.2}) is in or next to a no-fly zone or a threat, or too low above the terrain, by {inside_m:.2} m", .goal.x, .goal.y, .goal.z)]
    GoalClosed { goal: Vector3<f64>, inside_m: f64 },
    #[error("goal ({:.2}, {:.2}, {:.2}) is outside what limits allow, by {outside_m:.2} m", .goal.x, .goal.y, .goal.z)]
    GoalBeyondLimits { goal: Vector3<f64>, outside_m: f64 },
    #[error("no path: everything reachable from the start was searched ({expanded} voxels)")]
    Unreachable { expanded: usize },
    #[error("no path within the budget of {budget} expansions")]
    BudgetExhausted { budget: usize, partial: Path },
}

/// Room in a voxel that is occupied or outside.
const BLOCKED: i32 = i32::MIN;
/// Extra cost of a metre on the way out of a closed place, so that the way out is about the shortest.
const CLOSED_WEIGHT: f64 = 20.0;
/// Steps of depth in a disc that are told apart.
const DISC_STEPS: f64 = 64.0;
/// So much of a voxel may stick out of the box that a path stays in: half of it, whatever the rounding.
pub(super) const HALF_A_VOXEL: f64 = 0.501;
/// Beginning to track a layer takes as long as so many expansions in one layer.
pub(super) const LAYER_EXPANSIONS: usize = 4000;
/// An expansion with 26 neighbours takes as long as so many with 8.
const SPACE_EXPANSIONS: usize = 4;

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
/// What is closed ([`ClearanceMap::keep_out`]) is not entered. A start inside may be left, no deeper than it is, by
/// the way out that is about the shortest, for a metre inside costs 20 metres more.
///
/// The layers searched are tracked in `map` from then on.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::Region;
/// use skein_planning::global::{Potential, astar};
/// use skein_planning::map::{ClearanceMap, VoxelMapConfig};
///
/// let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
/// let request = astar::Request {
///     start: Vector3::new(0.1, 0.1, 3.1),
///     goal: Vector3::new(6.1, 0.1, 3.1),
///     potential: &Potential::default(),
///     discs: &[],
///     within: Region::EVERYWHERE,
/// };
/// let plan = astar::plan(&mut map, &request, &astar::AstarConfig::default(), &mut astar::Astar::default()).unwrap();
/// assert!((plan.cost - 6.0).abs() < 1e-9);
/// ```
pub fn plan(
    map: &mut ClearanceMap,
    request: &Request<'_>,
    config: &AstarConfig,
    search: &mut Astar,
) -> Result<Plan, PlanError> {
    search.begin(map, request, config)?;
    loop {
        if let Some(answer) = search.advance(map, request, config, &mut usize::MAX.clone()) {
            return answer;
        }
    }
}

/// A search that can be done a little at a time, and the memory that searches reuse.
#[derive(Clone, Debug, Default)]
pub struct Astar {
    search: Search,
    extent: Extent,
    /// Whether the layers are tracked and the search has begun.
    is_begun: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    start: VoxelIndex,
    goal: VoxelIndex,
    low: usize,
    /// Number of layers; one in planar mode.
    layers: usize,
    /// Whether height changes evenly along the path.
    planar: bool,
}

impl Astar {
    /// Begins a search, in place of any before. [`Astar::advance`] does the work, given the same request and
    /// configuration.
    ///
    /// # Errors
    /// Start or goal is outside the map.
    pub fn begin(
        &mut self,
        map: &ClearanceMap,
        request: &Request<'_>,
        config: &AstarConfig,
    ) -> Result<(), PlanError> {
        let planar = (request.goal.z - request.start.z).abs() <= config.planar_band_m;
        let voxels = map.voxels();
        let start =
            voxels.index_of(&request.start).ok_or(PlanError::StartOutside { start: request.start })?;
        let mut goal = voxels.index_of(&request.goal).ok_or(PlanError::GoalOutside { goal: request.goal })?;
        let layers = if planar {
            goal.z = start.z;
            start.z..start.z + 1
        } else {
            let margin = (config.vertical_margin_m / voxels.config().resolution_m).ceil().max(0.0) as usize;
            let top = start.z.max(goal.z).saturating_add(margin).saturating_add(1);
            start.z.min(goal.z).saturating_sub(margin)..top.min(voxels.counts()[2])
        };
        self.extent = Extent { start, goal, low: layers.start, layers: layers.len(), planar };
        self.is_begun = false;
        Ok(())
    }

    /// Goes on with a search, for about as long as `allowance` expansions in one layer take, and takes what was used
    /// from it; a last layer or expansion may cost more than is left. `None` if there is no answer yet.
    ///
    /// What the map has learnt meanwhile counts for what is still to be expanded. If its window has moved, begin again.
    pub fn advance(
        &mut self,
        map: &mut ClearanceMap,
        request: &Request<'_>,
        config: &AstarConfig,
        allowance: &mut usize,
    ) -> Option<Result<Plan, PlanError>> {
        let Extent { start, goal, low, layers, planar } = self.extent;
        for z in low..low + layers {
            if *allowance == 0 {
                return None;
            }
            if map.track_layer(z) {
                *allowance = allowance.saturating_sub(LAYER_EXPANSIONS);
            }
        }
        let [nx, ny, _] = map.voxels().counts();
        let mut rooms = Rooms {
            map,
            request,
            config,
            required: map.required(config.clearance_m),
            low,
            size: [nx, ny, layers],
            start,
            planar,
            start_depth_m: 0.0,
        };
        rooms.start_depth_m = -rooms.open_m(start).min(0.0);
        if !self.is_begun {
            self.is_begun = true;
            if let Err(error) = rooms.check_goal(goal) {
                return Some(Err(error));
            }
            let effort = Effort { budget: config.budget, ..Effort::OPTIMAL };
            self.search.begin(&rooms, rooms.cell(start), rooms.cell(goal), effort);
        }
        let each = if layers == 1 { 1 } else { SPACE_EXPANSIONS };
        let before = self.search.expanded();
        let answer = self.search.advance(&rooms, allowance.div_ceil(each));
        *allowance = allowance.saturating_sub(each * (self.search.expanded() - before));
        Some(match answer? {
            Ok(route) => Ok(Plan {
                path: rooms.path(&route.cells, request.goal, planar),
                cost: route.cost * rooms.resolution_m(),
                expanded: route.expanded,
            }),
            Err(Unsolved::Unreachable { expanded }) => Err(PlanError::Unreachable { expanded }),
            Err(Unsolved::Spent { expanded, partial }) => {
                let last = partial.last().map_or(start, |last| rooms.voxel(*last));
                let partial = rooms.path(&partial, map.voxels().centre_of(last), planar);
                Err(PlanError::BudgetExhausted { budget: expanded, partial })
            }
        })
    }
}

/// A map's layers as a lattice: its steps keep the clearance, and cost what comfort and potential add.
struct Rooms<'a> {
    map: &'a ClearanceMap,
    request: &'a Request<'a>,
    config: &'a AstarConfig,
    /// Squared distance to the nearest occupied voxel that is enough.
    required: i32,
    /// The map's layer that is the lattice's lowest.
    low: usize,
    size: [usize; 3],
    start: VoxelIndex,
    /// Whether height changes evenly along the path.
    planar: bool,
    /// Depth of the start in a closed place, metres; 0 outside.
    start_depth_m: f64,
}

impl Lattice for Rooms<'_> {
    fn size(&self) -> [usize; 3] {
        self.size
    }

    fn least_costs(&self) -> [f64; 3] {
        [1.0, SQRT_2, SQRT_3]
    }

    fn steps_from(&self, cell: VoxelIndex, mut visit: impl FnMut(usize, f64)) {
        let here = self.voxel(cell);
        let room = self.room(here);
        // Next to nothing that is closed no neighbour is.
        let open_m = self.open_m(here);
        let is_near = open_m < SQRT_3 * self.resolution_m();
        let (mut rooms, mut passable) = ([BLOCKED; MOVES.len()], 0);
        for (there_room, step) in rooms.iter_mut().zip(&MOVES) {
            let there = moved(cell, step.by);
            if self.contains(there) {
                let there = self.voxel(there);
                *there_room = self.room(there);
                let is_allowed = !is_near || self.may_intrude(open_m, self.open_m(there));
                let is_passable = is_allowed && self.may_enter(here, room, *there_room);
                passable |= if is_passable { step.end } else { 0 };
            }
        }
        let cost = self.cost(here, room);
        for (number, (step, there_room)) in MOVES.iter().zip(rooms).enumerate() {
            if step.swept & !passable == 0 {
                let there = self.voxel(moved(cell, step.by));
                visit(number, step.length * 0.5 * (cost + self.cost(there, there_room)));
            }
        }
    }
}

impl Rooms<'_> {
    fn check_goal(&self, goal: VoxelIndex) -> Result<(), PlanError> {
        if self.start == goal {
            return Ok(());
        }
        let room_m = self.request.within.room_m(&self.request.goal);
        if room_m < 0.0 {
            return Err(PlanError::GoalBeyondLimits { goal: self.request.goal, outside_m: -room_m });
        }
        let open_m = self.open_m(goal);
        if open_m < 0.0 {
            return Err(PlanError::GoalClosed { goal: self.request.goal, inside_m: -open_m });
        }
        let room = self.room(goal);
        if room >= self.required {
            return Ok(());
        }
        Err(PlanError::GoalBlocked {
            goal: self.request.goal,
            clearance_m: self.map.clearance_of(room.max(0)),
            required_m: self.config.clearance_m,
        })
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

    /// Distance to what is closed or beyond the request's box, metres; negative inside of that. Where height changes
    /// along the path, that at the worse of the heights at its ends: what is closed with its margin is taller than
    /// the ends are apart.
    fn open_m(&self, voxel: VoxelIndex) -> f64 {
        let within = self.room_within_m(voxel);
        let Some(keep_out) = self.map.keep_out() else { return within };
        let centre = self.map.voxels().centre_of(voxel);
        let at = |z: f64| keep_out.room_m(&Vector3::new(centre.x, centre.y, z));
        let open_m =
            if self.planar { at(self.request.start.z).min(at(self.request.goal.z)) } else { at(centre.z) };
        open_m.min(within)
    }

    /// The depth of a voxel inside the request's box, metres; one that reaches inside is. A way through one layer
    /// changes its height on the way from start to goal, not here.
    fn room_within_m(&self, voxel: VoxelIndex) -> f64 {
        let within = &self.request.within;
        if *within == Region::EVERYWHERE {
            return f64::INFINITY;
        }
        let centre = self.map.voxels().centre_of(voxel);
        let room_m = if self.planar { within.level_room_m(&centre) } else { within.room_m(&centre) };
        room_m + HALF_A_VOXEL * self.resolution_m()
    }

    /// What is closed is entered from inside alone, and no deeper than the start is.
    fn may_intrude(&self, here_m: f64, there_m: f64) -> bool {
        there_m >= 0.0 || (here_m < 0.0 && -there_m <= self.start_depth_m)
    }

    /// Cost per metre.
    fn cost(&self, voxel: VoxelIndex, room: i32) -> f64 {
        let mut cost = 1.0;
        if self.start_depth_m > 0.0 && self.open_m(voxel) < 0.0 {
            cost += CLOSED_WEIGHT;
        }
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

    /// The way through cells.
    fn path(&self, cells: &[VoxelIndex], end: Vector3<f64>, planar: bool) -> Path {
        let centres = cells.iter().map(|cell| self.map.voxels().centre_of(self.voxel(*cell)));
        path_through(self.request, centres, end, planar)
    }

    fn contains(&self, cell: VoxelIndex) -> bool {
        let [nx, ny, nz] = self.size;
        cell.x < nx && cell.y < ny && cell.z < nz
    }

    /// The map's voxel that a cell is.
    fn voxel(&self, cell: VoxelIndex) -> VoxelIndex {
        VoxelIndex { z: cell.z + self.low, ..cell }
    }

    /// The cell that a voxel of the layers searched is.
    fn cell(&self, voxel: VoxelIndex) -> VoxelIndex {
        VoxelIndex { z: voxel.z - self.low, ..voxel }
    }

    fn resolution_m(&self) -> f64 {
        self.map.voxels().config().resolution_m
    }
}

/// The path through the centres of voxels, the first and the last replaced by the exact places.
pub(super) fn path_through(
    request: &Request<'_>,
    centres: impl ExactSizeIterator<Item = Vector3<f64>>,
    end: Vector3<f64>,
    planar: bool,
) -> Path {
    let last = centres.len().saturating_sub(1);
    let inner = centres.take(last).skip(1);
    let mut points: Vec<Vector3<f64>> = std::iter::once(request.start).chain(inner).chain([end]).collect();
    if planar {
        spread_height(&mut points, request);
    }
    Path::new(points).unwrap_or_else(|| Path::at(request.start))
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
