//! A* as global planner: searches anew for every path.

use skein_planning::{
    global::astar::{Astar, AstarConfig, Disc, PlanError},
    map::ClearanceMap,
};

use super::path_finder::{Found, LEVEL_BUDGET, PathFinder, Task};

/// Margins between hull and obstacles that are tried in turn when there is no path with the envelope's own, m.
const TIGHT_MARGINS_M: [f64; 2] = [0.1, 0.03];
/// The last of them, m. A voxel makes a wall thicker than it is, by up to its diagonal where the wall runs aslant: what
/// is passable is told by the returns, of which the safety filter keeps clear.
const SQUEEZED_MARGIN_M: f64 = -0.1;
/// Most voxels that a search at all heights expands; each costs more.
const CLIMBING_BUDGET: usize = 40_000;
/// As the height band of a level search: search all heights.
const ALL_HEIGHTS: f64 = -1.0;

/// Finds the path with the widest of the margins that allow one: level if there is such a path, else over or under
/// what is in the way, and around the discs if possible.
#[derive(Debug, Default)]
pub struct AstarFinder {
    astar: Astar,
    /// Which of the tries it is at.
    attempt: usize,
    is_begun: bool,
    first_error: Option<PlanError>,
}

impl PathFinder for AstarFinder {
    fn begin(&mut self) {
        (self.attempt, self.is_begun, self.first_error) = (0, false, None);
    }

    fn advance(
        &mut self,
        task: &Task,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<Result<Found, PlanError>> {
        while let Some((config, discs)) = attempt(self.attempt, task) {
            let request = task.request(discs);
            let begun = if self.is_begun { Ok(()) } else { self.astar.begin(map, &request, &config) };
            let answer = match begun {
                Ok(()) => self.astar.advance(map, &request, &config, allowance),
                Err(error) => Some(Err(error)),
            };
            let (clearance_m, is_level) = (config.clearance_m, task.is_level(config.planar_band_m));
            match answer {
                None => {
                    self.is_begun = true;
                    return None;
                }
                Some(Ok(plan)) => {
                    let found = Found::of(&plan, map, clearance_m, discs, &task.potential);
                    return Some(Ok(Found { is_level, ..found }));
                }
                // Far away: begin with the part of the way that leads nearest to the goal.
                Some(Err(PlanError::BudgetExhausted { partial, .. })) if config.planar_band_m > 0.0 => {
                    return Some(Ok(Found { path: partial, clearance_m: Some(clearance_m), is_level }));
                }
                Some(Err(error)) => {
                    self.first_error.get_or_insert(error);
                    (self.attempt, self.is_begun) = (self.attempt + 1, false);
                }
            }
        }
        Some(Err(self.first_error.take().unwrap_or(PlanError::Unreachable { expanded: 0 })))
    }
}

/// The settings and the discs of the search of this number; `None` when all was tried.
fn attempt(number: usize, task: &Task) -> Option<(AstarConfig, &[Disc])> {
    let level = AstarConfig { budget: LEVEL_BUDGET, ..AstarConfig::default() };
    let climbing =
        AstarConfig { planar_band_m: ALL_HEIGHTS, budget: CLIMBING_BUDGET, ..AstarConfig::default() };
    let [tight_m, tightest_m] = TIGHT_MARGINS_M;
    let wide_m = task.margin_m;
    let tries = [
        (level, wide_m),
        (level, tight_m),
        (level, tightest_m),
        (climbing, wide_m),
        (climbing, tightest_m),
        (level, SQUEEZED_MARGIN_M),
    ];
    let rounds = if task.discs.is_empty() { 1 } else { 2 };
    let discs = if number < tries.len() { task.discs.as_slice() } else { &[] };
    let (config, margin_m) = *tries.get(number % tries.len())?;
    let clearance_m = task.hull_m + margin_m;
    (number < rounds * tries.len()).then_some((AstarConfig { clearance_m, ..config }, discs))
}
