//! D* Lite as global planner: repairs the last path, and asks A* where that does not lead to one of the margin
//! wanted.

use skein_planning::{
    global::{
        Potential,
        astar::{AstarConfig, PlanError},
        dstar::{Dstar, DstarConfig},
    },
    map::ClearanceMap,
};

use super::astar::AstarFinder;
use super::path_finder::{Found, LEVEL_BUDGET, PathFinder, Task};

/// Repairs the last path, as long as its goal stays.
#[derive(Debug, Default)]
pub struct DstarLiteFinder {
    dstar: Dstar,
    /// Whether no path can be repaired for this task.
    is_tried: bool,
    astar: AstarFinder,
}

impl PathFinder for DstarLiteFinder {
    fn begin(&mut self) {
        self.dstar.begin();
        self.is_tried = false;
        self.astar.begin();
    }

    fn advance(
        &mut self,
        task: &Task,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<Result<Found, PlanError>> {
        if !self.is_tried {
            let clearance_m = task.hull_m + task.margin_m;
            let planar_band_m = AstarConfig::default().planar_band_m;
            let config = DstarConfig { clearance_m, budget: LEVEL_BUDGET, planar_band_m };
            let answer = self.dstar.advance(map, &task.request(&task.discs), &config, allowance)?;
            self.is_tried = true;
            if let Ok(plan) = answer {
                let found = Found::of(&plan, map, clearance_m, &task.discs, &Potential::default());
                return Some(Ok(Found { is_level: task.is_level(planar_band_m), ..found }));
            }
        }
        self.astar.advance(task, map, allowance)
    }
}
