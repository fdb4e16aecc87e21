//! The same searches by the `pathfinding` crate, on the same grids in the same run.

use std::fmt;

use anyhow::ensure;
use ordered_float::OrderedFloat;
use pathfinding::prelude::astar;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use skein_planning::global::{Effort, Search};
use skein_planning::grid::{Grid, Lattice as _, MOVES, OccupancyGrid, StepCosts, octile};
use skein_planning::map::VoxelIndex;

use super::Spread;
use super::movingai::Problem;
use crate::cpu_time;

/// Sides of the random grids, in cells.
const SIDE: usize = 100;
/// Share of their cells that is blocked.
const BLOCKED: f64 = 0.2;
/// Grids that are crossed from corner to corner.
const GRIDS: u64 = 20;
/// Two sums of the same costs in different order differ by less.
const SAME_COST: f64 = 1e-6;

/// Both on the same problems.
#[derive(Debug, Serialize)]
pub(super) struct Case {
    name: &'static str,
    problems: usize,
    ours_ms: Spread,
    theirs_ms: Spread,
    /// Their processor time over ours, all problems together.
    ratio: f64,
    /// The same of the median problem.
    ratio_of_medians: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Case { name, problems, ours_ms: ours, theirs_ms: theirs, ratio, ratio_of_medians } = self;
        write!(
            f,
            "{name}: {problems} problems, all of the same length; median {:.3} ms against {:.3} ms of `pathfinding` \
             ({ratio_of_medians:.1} times), p95 {:.3} against {:.3}; {ratio:.1} times as fast in all",
            ours.median, theirs.median, ours.p95, theirs.p95
        )
    }
}

/// Crosses random grids, and solves published problems.
pub(super) fn run(published: Option<(&Grid, &[Problem])>) -> anyhow::Result<Vec<Case>> {
    let mut search = Search::default();
    let mut crossed = Vec::new();
    for seed in 1..=GRIDS {
        let grid = random_grid(seed)?;
        let (start, goal) = corners();
        crossed.extend(both(&grid, start, goal, &mut search)?);
    }
    let mut cases = vec![case("random grids of 100 x 100 x 100, a fifth blocked", &crossed)];
    if let Some((grid, problems)) = published {
        let solved: Vec<Option<[f64; 2]>> = problems
            .iter()
            .map(|problem| both(grid, problem.start, problem.goal, &mut search))
            .collect::<anyhow::Result<_>>()?;
        cases.push(case("the map", &solved.into_iter().flatten().collect::<Vec<_>>()));
    }
    Ok(cases)
}

fn corners() -> (VoxelIndex, VoxelIndex) {
    (VoxelIndex::default(), VoxelIndex { x: SIDE - 1, y: SIDE - 1, z: SIDE - 1 })
}

fn random_grid(seed: u64) -> anyhow::Result<Grid> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut cells = OccupancyGrid::new([SIDE; 3])?;
    let (start, goal) = corners();
    for place in 0..SIDE * SIDE * SIDE {
        let cell = VoxelIndex { x: place % SIDE, y: place / SIDE % SIDE, z: place / (SIDE * SIDE) };
        let blocked = rng.random::<f64>() < BLOCKED;
        cells.set_blocked(cell, blocked && cell != start && cell != goal);
    }
    Ok(Grid { cells, costs: StepCosts::EUCLIDEAN })
}

/// Processor time, in milliseconds, that we and they take for the same problem; `None` if it has no solution.
fn both(
    grid: &Grid,
    start: VoxelIndex,
    goal: VoxelIndex,
    search: &mut Search,
) -> anyhow::Result<Option<[f64; 2]>> {
    let (ours, our_ms) = cpu_time::measured_ms(|| search.solve(grid, start, goal, Effort::OPTIMAL))?;
    let (theirs, their_ms) = cpu_time::measured_ms(|| peer(grid, start, goal))?;
    match (ours, theirs) {
        (Ok(ours), Some(theirs)) => {
            let apart = (ours.cost - theirs).abs();
            ensure!(apart <= SAME_COST, "from {start:?} to {goal:?} we find {}, they {theirs}", ours.cost);
            Ok(Some([our_ms, their_ms]))
        }
        (Err(_), None) => Ok(None),
        (ours, theirs) => anyhow::bail!("from {start:?} to {goal:?} we find {ours:?}, they {theirs:?}"),
    }
}

/// Their A* over our steps, with our heuristic. Their hasher is quick with a cell in one word.
fn peer(grid: &Grid, start: VoxelIndex, goal: VoxelIndex) -> Option<f64> {
    let neighbours = |cell: &u64| {
        let here = unpack(*cell);
        let mut steps = Vec::with_capacity(MOVES.len());
        grid.steps_from(here, |number, cost| {
            let [x, y, z] = MOVES[number].by.map(isize::from);
            let there = VoxelIndex {
                x: here.x.wrapping_add_signed(x),
                y: here.y.wrapping_add_signed(y),
                z: here.z.wrapping_add_signed(z),
            };
            steps.push((pack(there), OrderedFloat(cost)));
        });
        steps
    };
    let heuristic = |cell: &u64| OrderedFloat(octile(unpack(*cell), goal, grid.costs.lengths));
    let (_, cost) = astar(&pack(start), neighbours, heuristic, |cell| *cell == pack(goal))?;
    Some(cost.into_inner())
}

/// A cell in one word.
fn pack(VoxelIndex { x, y, z }: VoxelIndex) -> u64 {
    ((z as u64) << 21 | y as u64) << 21 | x as u64
}

fn unpack(cell: u64) -> VoxelIndex {
    let axis = |number: u32| (cell >> (21 * number) & 0x1f_ffff) as usize;
    VoxelIndex { x: axis(0), y: axis(1), z: axis(2) }
}

fn case(name: &'static str, times_ms: &[[f64; 2]]) -> Case {
    let of = |side: usize| times_ms.iter().map(move |times| times[side]);
    let [ours_ms, theirs_ms] = [0, 1].map(|side| Spread::of(of(side).collect()));
    Case {
        name,
        problems: times_ms.len(),
        ours_ms,
        theirs_ms,
        ratio: of(1).sum::<f64>() / of(0).sum::<f64>(),
        ratio_of_medians: theirs_ms.median / ours_ms.median,
    }
}
