//! Grids drawn at random, and the least costs in them by relaxation until nothing changes, on the rules as documented.

use proptest::prelude::*;
use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
use skein_planning::map::VoxelIndex;

/// The sizes that are searched: in the plane, in space, and flat without depth.
pub const SIZES: [[usize; 3]; 3] = [[9, 8, 1], [5, 6, 4], [17, 1, 3]];

pub fn cell([x, y, z]: [usize; 3]) -> VoxelIndex {
    VoxelIndex { x, y, z }
}

pub fn cells(size: [usize; 3]) -> impl Iterator<Item = VoxelIndex> {
    let [nx, ny, nz] = size;
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| cell([x, y, z]))))
}

/// Step costs of every kind.
pub fn costs() -> impl Strategy<Value = StepCosts> {
    prop::sample::select(vec![
        StepCosts::EUCLIDEAN,
        StepCosts::FLYING,
        StepCosts::ZHANG_PLAIN,
        StepCosts::ZHANG_IMPROVED,
    ])
}

/// A grid with up to a third of its cells blocked, and two of its cells.
pub fn problem() -> impl Strategy<Value = (Grid, VoxelIndex, VoxelIndex)> {
    (costs(), prop::sample::select(SIZES.to_vec())).prop_flat_map(|(costs, size)| {
        let all: Vec<VoxelIndex> = cells(size).collect();
        let ends = prop::sample::select(all.clone());
        let blocked = prop::sample::subsequence(all.clone(), 0..all.len() / 3);
        (blocked, ends.clone(), ends).prop_map(move |(blocked, start, goal)| {
            let mut grid = Grid { cells: OccupancyGrid::new(size).unwrap(), costs };
            for cell in blocked.into_iter().filter(|cell| *cell != start && *cell != goal) {
                grid.cells.set_blocked(cell, true);
            }
            (grid, start, goal)
        })
    })
}

/// What the step from `here` to the neighbour at `by` costs, if there is one.
fn step(grid: &Grid, here: VoxelIndex, by: [i64; 3]) -> Option<f64> {
    let at = |by: [i64; 3]| {
        let axis = |from: usize, by: i64| usize::try_from(from as i64 + by).ok();
        let there = cell([axis(here.x, by[0])?, axis(here.y, by[1])?, axis(here.z, by[2])?]);
        grid.cells.contains(there).then_some(there)
    };
    let is_blocked = |by: [i64; 3]| at(by).is_some_and(|cell| grid.cells.is_blocked(cell));
    at(by)?;
    if is_blocked([0; 3]) || is_blocked(by) {
        return None;
    }
    let corners = (0..8).map(|bits| [0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { by[axis] } else { 0 }));
    if !grid.costs.cuts_corners && corners.into_iter().any(is_blocked) {
        return None;
    }
    let axes = |by: [i64; 3]| by.iter().map(|c| c.unsigned_abs() as usize).sum::<usize>();
    let near = |straight: bool| neighbours().any(|by| (axes(by) == 1) == straight && is_blocked(by));
    let factor = grid.costs.collision_factor;
    let straight = if near(true) { factor } else { 0.0 };
    let diagonal = if near(false) { factor / 2.0 } else { 0.0 };
    Some(grid.costs.lengths[axes(by) - 1] + straight + diagonal)
}

fn neighbours() -> impl Iterator<Item = [i64; 3]> {
    let all = (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]);
    all.filter(|by| *by != [0; 3])
}

/// The least cost from every cell to the goal.
pub fn costs_to(grid: &Grid, goal: VoxelIndex) -> impl Fn(VoxelIndex) -> Option<f64> + use<> {
    let size = grid.cells.size();
    let index = move |cell: VoxelIndex| (cell.z * size[1] + cell.y) * size[0] + cell.x;
    let mut least = vec![f64::INFINITY; size.iter().product()];
    least[index(goal)] = 0.0;
    let mut changed = true;
    while changed {
        changed = false;
        for here in cells(size) {
            for by in neighbours() {
                let Some(cost) = step(grid, here, by) else { continue };
                let axis = |from: usize, by: i64| (from as i64 + by) as usize;
                let there = cell([axis(here.x, by[0]), axis(here.y, by[1]), axis(here.z, by[2])]);
                let through = cost + least[index(there)];
                if through < least[index(here)] - 1e-12 {
                    least[index(here)] = through;
                    changed = true;
                }
            }
        }
    }
    move |cell| Some(least[index(cell)]).filter(|cost| cost.is_finite())
}
