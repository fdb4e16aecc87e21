//! D* Lite on a vehicle's map (Koenig and Likhachev 2002), with the collision factor of Zhang 2019.

use nalgebra::Vector3;

use super::astar::{Disc, HALF_A_VOXEL, LAYER_EXPANSIONS, Plan, Request, path_through};
use super::{DStarLite, Route, Unsolved};
use crate::grid::{Grid, OccupancyGrid, StepCosts};
use crate::map::{ClearanceMap, VoxelIndex};
use crate::region::Region;

/// The settings of [`Dstar`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DstarConfig {
    /// Clearance that every voxel of the path must have, metres.
    pub clearance_m: f64,
    /// Most voxels that may be expanded for one plan.
    pub budget: usize,
    /// Start and goal may differ in height by so much, metres: the search stays in the start's layer, and height
    /// changes evenly along the path.
    pub planar_band_m: f64,
}

/// In the allowance an expansion of A* in one layer counts one. One of D* Lite takes as long as so many,
const EXPANSION: usize = 3;
/// to look through a layer as so many,
const SURVEY: usize = 500;
/// and to take in a voxel that has changed as so many.
const CHANGE: usize = 4;
/// More changes than this are not taken in: the search begins anew.
const MOST_CHANGES: usize = 2500;

/// The way through one layer of the map, which is not searched for again but repaired: what was found out for one
/// plan serves the next, as long as the goal stays. Between two plans the map may learn and forget, the vehicle move
/// and change its height, and others come to stand in the way.
///
/// A step costs its length, and by [`StepCosts::FLYING`] more where a voxel next to it is not open. Open is a voxel
/// with the clearance that is not closed ([`ClearanceMap::keep_out`]), nor in a disc, nor beyond the request's box. A
/// potential counts for nothing. A vehicle that does not stand in the open, and a way that leads over something, are
/// for [`astar`](super::astar).
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::Region;
/// use skein_planning::global::{Potential, astar::Request, dstar::{Dstar, DstarConfig}};
/// use skein_planning::map::{ClearanceMap, VoxelMapConfig};
///
/// let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
/// let request = Request {
///     start: Vector3::new(0.1, 0.1, 3.1),
///     goal: Vector3::new(6.1, 0.1, 3.1),
///     potential: &Potential::default(),
///     discs: &[],
///     within: Region::EVERYWHERE,
/// };
/// let config = DstarConfig { clearance_m: 0.5, budget: 10_000, planar_band_m: 1.0 };
/// let mut search = Dstar::default();
/// search.begin();
/// let plan = search.advance(&mut map, &request, &config, &mut 10_000).unwrap().unwrap();
/// assert!((plan.cost - 6.0).abs() < 1e-9);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Dstar {
    kept: Option<Kept>,
    /// Of the plan under way, whether the layer was looked through, and how many voxels were expanded.
    is_surveyed: bool,
    expanded: usize,
}

#[derive(Clone, Debug)]
struct Kept {
    /// Which cells of the grid are blocked, row by row: rows are compared faster than cells.
    blocked: Vec<bool>,
    grid: Grid,
    search: DStarLite,
}

impl Dstar {
    /// Begins a plan, in place of any before. [`Dstar::advance`] does the work.
    pub fn begin(&mut self) {
        (self.is_surveyed, self.expanded) = (false, 0);
    }

    /// Goes on with a plan, given the same request and configuration, for about as long as `allowance` expansions of
    /// A* take, and takes what was used from it. `None` if there is no answer yet. What the map learns before there
    /// is one counts for the next plan. If the map's window has moved, begin again.
    ///
    /// The layer is tracked in `map` from then on.
    ///
    /// # Errors
    /// There is no way through the layer: at once, if start or goal is not open or outside the map, or they differ
    /// too much in height. Or the budget was spent.
    pub fn advance(
        &mut self,
        map: &mut ClearanceMap,
        request: &Request<'_>,
        config: &DstarConfig,
        allowance: &mut usize,
    ) -> Option<Result<Plan, Unsolved>> {
        if *allowance == 0 {
            return None;
        }
        let none = Some(Err(Unsolved::Unreachable { expanded: 0 }));
        let is_level = (request.goal.z - request.start.z).abs() <= config.planar_band_m;
        let voxels = map.voxels();
        let ends = voxels.index_of(&request.start).zip(voxels.index_of(&request.goal));
        let Some((start, goal)) = ends.filter(|_| is_level) else { return none };
        let layer = start.z;
        let [start, goal] = [start, goal].map(|voxel| VoxelIndex { z: 0, ..voxel });
        if !std::mem::replace(&mut self.is_surveyed, true) {
            let tracked = if map.track_layer(layer) { LAYER_EXPANSIONS } else { 0 };
            let survey = Survey { map, request, layer, required: map.required(config.clearance_m) };
            let changes = self.take_in(&survey, start, goal);
            *allowance = allowance.saturating_sub(tracked + SURVEY + CHANGE * changes);
        }
        let Some(kept) = &mut self.kept else { return none };
        if [start, goal].iter().any(|end| kept.grid.cells.is_blocked(*end)) {
            return none;
        }
        let left = config.budget.saturating_sub(self.expanded);
        let answer = kept.search.plan(&kept.grid, left.min(allowance.div_ceil(EXPANSION)));
        let (Ok(Route { expanded, .. })
        | Err(Unsolved::Unreachable { expanded } | Unsolved::Spent { expanded, .. })) = &answer;
        self.expanded += expanded;
        *allowance = allowance.saturating_sub(EXPANSION * expanded);
        if matches!(answer, Err(Unsolved::Spent { .. })) && self.expanded < config.budget {
            return None;
        }
        Some(answer.map(|route| {
            let centre = |cell: &VoxelIndex| map.voxels().centre_of(VoxelIndex { z: layer, ..*cell });
            Plan {
                path: path_through(request, route.cells.iter().map(centre), request.goal, true),
                cost: route.cost * map.voxels().config().resolution_m,
                expanded: self.expanded,
            }
        }))
    }

    /// Takes in what has changed since the last plan, so many voxels; or begins anew, which costs nothing yet.
    fn take_in(&mut self, survey: &Survey<'_>, start: VoxelIndex, goal: VoxelIndex) -> usize {
        let [nx, ny, _] = survey.map.voxels().counts();
        let size = [nx, ny, 1];
        let serves = |kept: &&mut Kept| kept.grid.cells.size() == size && kept.search.goal() == goal;
        let Some(kept) = self.kept.as_mut().filter(serves) else {
            self.kept = OccupancyGrid::new(size).ok().map(|cells| {
                let mut grid = Grid { cells, costs: StepCosts::FLYING };
                let mut blocked = vec![false; nx * ny];
                survey.renew(&mut blocked, &mut grid.cells);
                let search = DStarLite::new(&grid, start, goal);
                Kept { blocked, grid, search }
            });
            return 0;
        };
        let changed = survey.renew(&mut kept.blocked, &mut kept.grid.cells);
        if changed.len() > MOST_CHANGES {
            kept.search = DStarLite::new(&kept.grid, start, goal);
            return 0;
        }
        kept.search.move_to(start);
        kept.search.heed(&kept.grid, &changed);
        changed.len()
    }
}

/// A look through one layer, which is tracked.
struct Survey<'a> {
    map: &'a ClearanceMap,
    request: &'a Request<'a>,
    layer: usize,
    /// Squared distance to the nearest occupied voxel that is enough.
    required: i32,
}

impl Survey<'_> {
    /// Blocks the cells that are not open and frees the others; gives back those that have changed.
    fn renew(&self, blocked: &mut [bool], cells: &mut OccupancyGrid) -> Vec<VoxelIndex> {
        let [nx, ..] = cells.size();
        let mut seen = Vec::with_capacity(nx);
        let mut changed = Vec::new();
        for (y, row) in blocked.chunks_exact_mut(nx).enumerate() {
            seen.clear();
            seen.extend(self.map.row_squared(y, self.layer).map(|squared| squared < self.required));
            self.block_closed(y, &mut seen);
            self.block_taken(y, &mut seen);
            self.block_beyond(y, &mut seen);
            if row == seen {
                continue;
            }
            for (x, is) in (0..nx).zip(&seen).filter(|(x, is)| row[*x] != **is) {
                let cell = VoxelIndex { x, y, z: 0 };
                cells.set_blocked(cell, *is);
                changed.push(cell);
            }
            row.copy_from_slice(&seen);
        }
        changed
    }

    /// Blocks what is closed at the height of either end of the path. From voxel to voxel, the distance to what is
    /// closed changes by no more than the way between them, so few must be asked.
    fn block_closed(&self, y: usize, row: &mut [bool]) {
        let Some(keep_out) = self.map.keep_out() else { return };
        let resolution_m = self.map.voxels().config().resolution_m;
        let mut x = 0;
        while x < row.len() {
            let centre = self.centre(x, y);
            let at = |z: f64| keep_out.room_m(&Vector3::new(centre.x, centre.y, z));
            let room_m = at(self.request.start.z).min(at(self.request.goal.z));
            let alike = ((room_m.abs() / resolution_m) as usize).saturating_add(1).min(row.len() - x);
            if room_m < 0.0 {
                row[x..x + alike].fill(true);
            }
            x += alike;
        }
    }

    /// Blocks what is in a disc.
    fn block_taken(&self, y: usize, row: &mut [bool]) {
        for Disc { centre, radius_m } in self.request.discs {
            let is_taken = |x: usize| (self.centre(x, y) - centre).xy().norm() < *radius_m;
            if (self.centre(0, y).y - centre.y).abs() < *radius_m {
                row.iter_mut().enumerate().for_each(|(x, blocked)| *blocked |= is_taken(x));
            }
        }
    }

    /// Blocks what does not reach into the request's box.
    fn block_beyond(&self, y: usize, row: &mut [bool]) {
        let within = &self.request.within;
        if *within == Region::EVERYWHERE {
            return;
        }
        let half_m = HALF_A_VOXEL * self.map.voxels().config().resolution_m;
        let is_beyond = |x: usize| within.level_room_m(&self.centre(x, y)) + half_m < 0.0;
        row.iter_mut().enumerate().for_each(|(x, blocked)| *blocked |= is_beyond(x));
    }

    fn centre(&self, x: usize, y: usize) -> Vector3<f64> {
        self.map.voxels().centre_of(VoxelIndex { x, y, z: self.layer })
    }
}
