//! A* is optimal, weighted and budgeted A* keep the bound they tell.

use proptest::prelude::*;
use skein_planning::global::{Effort, Search, Unsolved, cost_of};
use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};

use crate::grids::reference::{cell, costs_to, problem};

proptest! {
    #[test]
    fn the_first_path_of_astar_is_the_best((grid, start, goal) in problem()) {
        let least = costs_to(&grid, goal)(start);
        match (Search::default().solve(&grid, start, goal, Effort::OPTIMAL), least) {
            (Ok(route), Some(least)) => {
                prop_assert!((route.cost - least).abs() < 1e-9, "{} instead of {least}", route.cost);
                prop_assert_eq!(route.bound, 1.0);
                prop_assert_eq!((route.cells.first(), route.cells.last()), (Some(&start), Some(&goal)));
                prop_assert!((cost_of(&grid, &route.cells) - route.cost).abs() < 1e-9);
            }
            (Err(Unsolved::Unreachable { .. }), None) => {}
            (found, least) => prop_assert!(false, "{found:?}, expected {least:?}"),
        }
    }

    #[test]
    fn no_path_costs_more_than_its_bound_says(
        (grid, start, goal) in problem(),
        weight in 1.0..6.0_f64,
        bound in 1.0..3.0_f64,
        budget in 1..300_usize,
    ) {
        let least = costs_to(&grid, goal)(start);
        let mut search = Search::default();
        for effort in [Effort::weighted(weight), Effort::budgeted(bound, budget), Effort { weight, bound, budget }] {
            match (search.solve(&grid, start, goal, effort), least) {
                (Ok(route), Some(least)) => {
                    prop_assert!(route.cost >= least - 1e-9, "{route:?} is better than {least}");
                    prop_assert!(route.cost <= route.bound * least + 1e-9, "{route:?} against {least}");
                    prop_assert!((cost_of(&grid, &route.cells) - route.cost).abs() < 1e-9);
                    prop_assert!(route.expanded <= effort.budget);
                    prop_assert!(route.bound <= effort.bound || route.expanded == effort.budget, "{route:?} of {effort:?}");
                }
                (Err(Unsolved::Unreachable { .. }), None) => {}
                (Err(Unsolved::Spent { expanded, partial }), _) => {
                    prop_assert_eq!(expanded, effort.budget);
                    prop_assert_eq!(partial.first(), Some(&start));
                    prop_assert!(cost_of(&grid, &partial).is_finite());
                }
                (found, least) => prop_assert!(false, "{found:?}, expected {least:?}"),
            }
        }
    }

    #[test]
    fn a_search_a_little_at_a_time_finds_the_same((grid, start, goal) in problem(), slice in 1..9_usize) {
        let effort = Effort::budgeted(1.1, 200);
        let mut search = Search::default();
        let at_once = search.solve(&grid, start, goal, effort);
        search.begin(&grid, start, goal, effort);
        let bit_by_bit = loop {
            let before = search.expanded();
            let answer = search.advance(&grid, slice);
            prop_assert!(search.expanded() - before <= slice);
            if let Some(answer) = answer {
                break answer;
            }
        };
        prop_assert_eq!(bit_by_bit, at_once);
    }
}

#[test]
fn more_budget_makes_paths_better_until_one_is_proven() {
    // A wall with a way round its far end: the heuristic leads into it.
    let mut grid = Grid { cells: OccupancyGrid::new([60, 60, 1]).unwrap(), costs: StepCosts::EUCLIDEAN };
    for y in 5..60 {
        grid.cells.set_blocked(cell([30, y, 0]), true);
    }
    let mut search = Search::default();
    let mut go = |effort| search.solve(&grid, cell([5, 50, 0]), cell([55, 50, 0]), effort);
    assert!(matches!(go(Effort::budgeted(1.0, 100)), Err(Unsolved::Spent { .. })));
    let best = go(Effort::OPTIMAL).unwrap();
    let mut last = f64::INFINITY;
    for budget in [2000, 4000, 8000, 100_000] {
        let route = go(Effort::budgeted(1.0, budget)).unwrap();
        assert!(route.bound <= last);
        last = route.bound;
    }
    assert_eq!(last, 1.0);
    assert!(go(Effort::weighted(3.0)).unwrap().expanded < best.expanded);
}
