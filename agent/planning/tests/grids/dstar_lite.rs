//! D* Lite finds what a fresh search finds, whatever changed and wherever the vehicle went.

use proptest::prelude::*;
use skein_planning::global::{DStarLite, Effort, Search, Unsolved, cost_of};
use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
use skein_planning::map::VoxelIndex;

use crate::grids::reference::{cell, cells, costs_to, problem};

/// What happens before a plan: cells that change, and where the vehicle goes, as shares of all cells.
fn happenings() -> impl Strategy<Value = Vec<(Vec<f64>, Option<f64>)>> {
    let share = 0.0..1.0_f64;
    prop::collection::vec((prop::collection::vec(share.clone(), 0..8), prop::option::of(share)), 1..12)
}

proptest! {
    #[test]
    fn it_costs_what_a_fresh_search_costs(
        (mut grid, mut start, goal) in problem(),
        happenings in happenings(),
        slice in prop::sample::select(vec![3, usize::MAX]),
    ) {
        let all: Vec<VoxelIndex> = cells(grid.cells.size()).collect();
        let pick = |share: f64| all[(share * all.len() as f64) as usize];
        let mut search = DStarLite::new(&grid, start, goal);
        for (changes, leap) in happenings {
            let found = loop {
                match search.plan(&grid, slice) {
                    Err(Unsolved::Spent { expanded, .. }) => prop_assert_eq!(expanded, slice),
                    found => break found,
                }
            };
            match (&found, costs_to(&grid, goal)(start)) {
                (Ok(route), Some(least)) => {
                    prop_assert!((route.cost - least).abs() < 1e-9, "{} instead of {least}", route.cost);
                    prop_assert!((cost_of(&grid, &route.cells) - route.cost).abs() < 1e-9);
                }
                (Err(Unsolved::Unreachable { .. }), None) => {}
                (found, least) => prop_assert!(false, "{found:?}, expected {least:?}"),
            }
            // Without a leap, on along the way.
            start = match (leap, found) {
                (Some(share), _) => pick(share),
                (None, Ok(route)) => *route.cells.get(1).unwrap_or(&start),
                (None, Err(_)) => start,
            };
            search.move_to(start);
            let changed: Vec<VoxelIndex> = changes.into_iter().map(pick).collect();
            for cell in &changed {
                let was_blocked = grid.cells.is_blocked(*cell);
                grid.cells.set_blocked(*cell, !was_blocked);
            }
            search.heed(&grid, &changed);
        }
    }
}

#[test]
fn a_change_near_the_vehicle_is_cheaper_than_a_fresh_search() {
    let mut grid = Grid { cells: OccupancyGrid::new([100, 100, 1]).unwrap(), costs: StepCosts::FLYING };
    for y in 0..90 {
        grid.cells.set_blocked(cell([50, y, 0]), true);
    }
    let (start, goal) = (cell([5, 20, 0]), cell([95, 20, 0]));
    let mut search = DStarLite::new(&grid, start, goal);
    let first = search.plan(&grid, usize::MAX).unwrap();
    let ahead = first.cells[6];
    let block: Vec<VoxelIndex> =
        (0..25).map(|n| VoxelIndex { x: ahead.x + n % 5 - 2, y: ahead.y + n / 5 - 2, z: 0 }).collect();
    for cell in &block {
        grid.cells.set_blocked(*cell, true);
    }
    search.heed(&grid, &block);
    let again = search.plan(&grid, usize::MAX).unwrap();
    let fresh = Search::default().solve(&grid, start, goal, Effort::OPTIMAL).unwrap();
    assert!((again.cost - fresh.cost).abs() < 1e-9);
    assert!(again.cost > first.cost);
    assert!(again.expanded * 5 < fresh.expanded, "{} against {}", again.expanded, fresh.expanded);
}
