//! A* finds optimal paths, keeps its rules, and says why when it finds none.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use proptest::prelude::*;
use skein_planning::airspace::{Airspace, KeepOut, NoFlyZone};
use skein_planning::global::astar::{Astar, AstarConfig, Disc, Plan, PlanError, Request, plan};
use skein_planning::global::{Potential, PotentialConfig, PotentialObstacle, elide_collinear, simplify};
use skein_planning::map::{ClearanceMap, VoxelMapConfig};
use skein_planning::{Path, Region};

/// A map of cells of one metre, `size` long, wide and high, whose lowest corner is the origin.
fn grid(size: [usize; 3], blocked: &[[usize; 3]]) -> ClearanceMap {
    let size_m = size.map(|cells| cells as f64);
    let config = VoxelMapConfig {
        resolution_m: 1.0,
        size_m,
        max_range_m: 10.0,
        vertical_extent_m: 0.0,
        ground_m: -1.0,
        ..VoxelMapConfig::default()
    };
    let mut map = ClearanceMap::new(config, Vector3::from(size_m) / 2.0, 5.0).unwrap();
    for cell in blocked {
        map.insert(&centre(*cell));
    }
    map
}

fn centre(cell: [usize; 3]) -> Vector3<f64> {
    Vector3::from(cell.map(|c| c as f64 + 0.5))
}

fn shortest() -> AstarConfig {
    AstarConfig { clearance_m: 0.0, comfort_weight: 0.0, vertical_margin_m: 100.0, ..AstarConfig::default() }
}

fn run(
    map: &mut ClearanceMap,
    from: [usize; 3],
    to: [usize; 3],
    config: &AstarConfig,
) -> Result<Plan, PlanError> {
    let potential = Potential::default();
    let request = Request {
        start: centre(from),
        goal: centre(to),
        potential: &potential,
        discs: &[],
        within: Region::EVERYWHERE,
    };
    plan(map, &request, config, &mut Astar::default())
}

/// The least cost by Dijkstra's algorithm without a heap or a heuristic, on the rules as documented.
fn least_cost(
    size: [usize; 3],
    passable: impl Fn([usize; 3]) -> bool,
    cost: impl Fn([usize; 3]) -> f64,
    from: [usize; 3],
    to: [usize; 3],
) -> Option<f64> {
    let mut open = BTreeMap::from([(from, 0.0_f64)]);
    let mut closed = BTreeMap::new();
    while let Some((here, g)) = open.iter().map(|(c, g)| (*c, *g)).min_by(|a, b| a.1.total_cmp(&b.1)) {
        if here == to {
            return Some(g);
        }
        open.remove(&here);
        closed.insert(here, g);
        for step in 0..27 {
            let by = [step % 3, step / 3 % 3, step / 9].map(|c| c as i64 - 1);
            let at = |share: [bool; 3]| -> Option<[usize; 3]> {
                let mut cell = here;
                for axis in 0..3 {
                    let moved = here[axis] as i64 + if share[axis] { by[axis] } else { 0 };
                    cell[axis] = usize::try_from(moved).ok().filter(|c| *c < size[axis])?;
                }
                Some(cell)
            };
            let Some(there) = at([true; 3]) else { continue };
            let corners = (0..8).map(|bits| at([bits & 1 > 0, bits & 2 > 0, bits & 4 > 0]));
            let swept_free = corners.flatten().filter(|cell| *cell != here).all(&passable);
            if there == here || !swept_free || closed.contains_key(&there) {
                continue;
            }
            let length = (by.iter().map(|c| c * c).sum::<i64>() as f64).sqrt();
            let g = g + length * 0.5 * (cost(here) + cost(there));
            let known = open.entry(there).or_insert(f64::INFINITY);
            *known = known.min(g);
        }
    }
    None
}

fn agree(found: &Result<Plan, PlanError>, expected: Option<f64>) -> bool {
    match (found, expected) {
        (Ok(plan), Some(cost)) => (plan.cost - cost).abs() < 1e-9,
        (Err(PlanError::Unreachable { .. }), None) => true,
        _ => false,
    }
}

fn cells(size: [usize; 3]) -> impl Strategy<Value = Vec<[usize; 3]>> {
    let all: Vec<_> = (0..size[0] * size[1] * size[2])
        .map(|i| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])])
        .collect();
    let most = all.len() * 2 / 5;
    prop::sample::subsequence(all, 0..most)
}

const FLAT: [usize; 3] = [9, 9, 1];
const CUBE: [usize; 3] = [5, 5, 5];

proptest! {
    #[test]
    fn paths_in_a_layer_are_as_short_as_dijkstras(mut blocked in cells(FLAT)) {
        let (from, to) = ([0, 0, 0], [8, 8, 0]);
        blocked.retain(|cell| *cell != from && *cell != to);
        let found = run(&mut grid(FLAT, &blocked), from, to, &shortest());
        let expected = least_cost(FLAT, |cell| !blocked.contains(&cell), |_| 1.0, from, to);
        prop_assert!(agree(&found, expected), "{found:?}, expected {expected:?}");
        if let Ok(plan) = &found {
            prop_assert!((plan.path.length_m() - plan.cost).abs() < 1e-9);
        }
    }

    #[test]
    fn paths_in_space_are_as_short_as_dijkstras(mut blocked in cells(CUBE)) {
        let (from, to) = ([0, 0, 0], [4, 4, 4]);
        blocked.retain(|cell| *cell != from && *cell != to);
        let found = run(&mut grid(CUBE, &blocked), from, to, &shortest());
        let expected = least_cost(CUBE, |cell| !blocked.contains(&cell), |_| 1.0, from, to);
        prop_assert!(agree(&found, expected), "{found:?}, expected {expected:?}");
    }

    #[test]
    fn comfort_and_potential_are_weighed_exactly(mut blocked in cells(FLAT), x in 0.0..9.0_f64, y in 0.0..9.0_f64) {
        let (from, to) = ([0, 0, 0], [8, 8, 0]);
        blocked.retain(|cell| *cell != from && *cell != to);
        let config = AstarConfig { comfort_m: 2.0, comfort_weight: 1.5, ..shortest() };
        let obstacle = PotentialObstacle { centre: Vector3::new(x, y, 0.5), influence_m: 3.0 };
        let potential = Potential::felt(&centre(from), &Vector3::new(1.0, 1.0, 0.0), &[obstacle], &grid(FLAT, &[]),
            &PotentialConfig { gain: 4.0, ..PotentialConfig::default() });
        let (start, goal, within) = (centre(from), centre(to), Region::EVERYWHERE);
        let request = Request { start, goal, potential: &potential, discs: &[], within };
        let found = plan(&mut grid(FLAT, &blocked), &request, &config, &mut Astar::default());
        let clearance = |cell: [usize; 3]| blocked.iter()
            .map(|other| (centre(*other) - centre(cell)).norm() - 0.5).fold(5.0, f64::min);
        let cost = |cell| {
            let discomfort = ((2.0 - clearance(cell)) / 2.0).max(0.0);
            1.0 + 1.5 * discomfort * discomfort + potential.at(&centre(cell))
        };
        let expected = least_cost(FLAT, |cell| !blocked.contains(&cell), cost, from, to);
        prop_assert!(agree(&found, expected), "{found:?}, expected {expected:?}");
    }

    #[test]
    fn paths_keep_the_clearance_and_simplified_ones_too(
        trees in prop::collection::vec((2.0..18.0_f64, 0.0..20.0_f64), 0..25),
        clearance_m in 0.3..0.9_f64,
    ) {
        let config = VoxelMapConfig { size_m: [20.0, 20.0, 4.0], ..VoxelMapConfig::default() };
        let mut map = ClearanceMap::new(config, Vector3::new(10.0, 10.0, 2.0), 2.5).unwrap();
        for (x, y) in &trees {
            map.insert(&Vector3::new(*x, *y, 2.1));
        }
        let potential = Potential::default();
        let request = Request {
            start: Vector3::new(0.5, 10.0, 2.1),
            goal: Vector3::new(19.5, 10.0, 2.1),
            potential: &potential,
            discs: &[],
            within: Region::EVERYWHERE,
        };
        let config = AstarConfig { clearance_m, ..AstarConfig::default() };
        if let Ok(plan) = plan(&mut map, &request, &config, &mut Astar::default()) {
            let simple = simplify(&map, &plan.path, clearance_m);
            let elided = elide_collinear(&plan.path);
            prop_assert!(simple.points().len() <= elided.points().len());
            prop_assert!(simple.length_m() <= plan.path.length_m() + 1e-9);
            prop_assert_eq!((simple.start(), simple.end()), (plan.path.start(), plan.path.end()));
            prop_assert!((elided.length_m() - plan.path.length_m()).abs() < 1e-6);
            // A voxel has the clearance at its centre; at its corner, less by half its diagonal.
            let least = clearance_m - 0.2 * std::f64::consts::FRAC_1_SQRT_2 - 1e-6;
            for k in 0..=1000 {
                let place = simple.point_at(simple.length_m() * f64::from(k) / 1000.0);
                prop_assert!(map.clearance(&place) >= least, "{} at {place:?}", map.clearance(&place));
            }
        }
    }
}

#[test]
fn an_empty_grid_is_crossed_straight() {
    let found = run(&mut grid([10, 10, 1], &[]), [0, 0, 0], [9, 4, 0], &shortest()).unwrap();
    assert!((found.cost - (5.0 + 4.0 * 2.0_f64.sqrt())).abs() < 1e-12);
    assert_eq!(found.path.start(), centre([0, 0, 0]));
    assert_eq!(found.path.end(), centre([9, 4, 0]));
}

#[test]
fn no_corner_is_cut() {
    let found = run(&mut grid([2, 2, 1], &[[1, 0, 0]]), [0, 0, 0], [1, 1, 0], &shortest()).unwrap();
    assert!((found.cost - 2.0).abs() < 1e-12, "round the corner, not across it: {found:?}");
    let closed = run(&mut grid([2, 2, 1], &[[1, 0, 0], [0, 1, 0]]), [0, 0, 0], [1, 1, 0], &shortest());
    assert!(matches!(closed, Err(PlanError::Unreachable { .. })));
}

#[test]
fn paths_keep_away_from_obstacles_where_that_is_cheap() {
    // A wall beside the straight way; there is room on the other side.
    let wall: Vec<_> = (0..40).map(|x| [x, 9, 0]).collect();
    let close = run(&mut grid([40, 20, 1], &wall), [0, 11, 0], [39, 11, 0], &shortest()).unwrap();
    let config = AstarConfig { comfort_m: 4.0, comfort_weight: 2.0, ..shortest() };
    let roomy = run(&mut grid([40, 20, 1], &wall), [0, 11, 0], [39, 11, 0], &config).unwrap();
    let furthest = |plan: &Plan| plan.path.points().iter().map(|p| p.y).fold(0.0, f64::max);
    assert_eq!(furthest(&close), 11.5);
    assert!(furthest(&roomy) > 12.0);
}

#[test]
fn a_start_too_close_to_an_obstacle_can_be_left_but_not_through_it() {
    let wall: Vec<_> = (0..20).map(|y| [10, y, 0]).collect();
    let config = AstarConfig { clearance_m: 2.0, ..shortest() };
    let away = run(&mut grid([21, 20, 1], &wall), [9, 10, 0], [2, 10, 0], &config).unwrap();
    assert!((away.cost - 7.0).abs() < 1e-12);
    let through = run(&mut grid([21, 20, 1], &wall), [9, 10, 0], [18, 10, 0], &config);
    assert!(matches!(through, Err(PlanError::Unreachable { .. })), "{through:?}");
}

#[test]
fn discs_are_gone_round_and_can_be_left() {
    let potential = Potential::default();
    let go = |start: [usize; 3], centre_cell: [usize; 3]| {
        let discs = [Disc { centre: centre(centre_cell), radius_m: 3.0 }];
        let request = Request {
            start: centre(start),
            goal: centre([28, 15, 0]),
            potential: &potential,
            discs: &discs,
            within: Region::EVERYWHERE,
        };
        plan(&mut grid([30, 30, 1], &[]), &request, &shortest(), &mut Astar::default())
    };
    let round = go([1, 15, 0], [15, 15, 0]).unwrap();
    assert!(round.path.points().iter().all(|point| (point - centre([15, 15, 0])).norm() >= 3.0));
    assert!(matches!(go([1, 15, 0], [27, 15, 0]), Err(PlanError::GoalBlocked { .. })));
    assert!(go([1, 15, 0], [2, 15, 0]).is_ok(), "another vehicle came too close to the start");
}

#[test]
fn why_there_is_no_path_is_said() {
    let wall: Vec<_> = (0..10).map(|y| [5, y, 0]).collect();
    let mut map = grid([10, 10, 1], &wall);
    assert!(matches!(
        run(&mut map, [0, 0, 0], [9, 9, 0], &shortest()),
        Err(PlanError::Unreachable { expanded: 50 })
    ));
    let blocked = run(&mut map, [0, 0, 0], [5, 5, 0], &shortest()).unwrap_err();
    assert!(matches!(blocked, PlanError::GoalBlocked { clearance_m: 0.0, .. }), "{blocked}");
    assert!(matches!(run(&mut map, [0, 0, 0], [50, 5, 0], &shortest()), Err(PlanError::GoalOutside { .. })));
    assert!(matches!(run(&mut map, [50, 0, 0], [5, 5, 0], &shortest()), Err(PlanError::StartOutside { .. })));
}

#[test]
fn a_spent_budget_gives_the_way_as_far_as_it_got() {
    let config = AstarConfig { budget: 5, ..shortest() };
    let Err(PlanError::BudgetExhausted { budget: 5, partial }) =
        run(&mut grid([20, 20, 1], &[]), [0, 0, 0], [19, 0, 0], &config)
    else {
        panic!("expected a spent budget")
    };
    assert_eq!(partial.start(), centre([0, 0, 0]));
    assert_eq!(partial.end(), centre([5, 0, 0]));
}

#[test]
fn a_change_of_height_within_the_band_is_spread_along_the_path() {
    let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
    let potential = Potential::default();
    let (start, goal) = (Vector3::new(0.1, 0.1, 3.0), Vector3::new(8.1, 0.1, 3.8));
    let request = Request { start, goal, potential: &potential, discs: &[], within: Region::EVERYWHERE };
    let path = plan(&mut map, &request, &AstarConfig::default(), &mut Astar::default()).unwrap().path;
    assert_eq!(path.end(), goal);
    assert!((path.point_at(path.length_m() / 2.0).z - 3.4).abs() < 0.03);
    assert_eq!(elide_collinear(&path).points().len(), 2);
}

#[test]
fn climbs_and_detours_over_walls_are_found_in_space() {
    let wall: Vec<_> = (0..8).flat_map(|y| (0..4).map(move |z| [4, y, z])).collect();
    let found = run(
        &mut grid([9, 8, 7], &wall),
        [1, 4, 0],
        [7, 4, 1],
        &AstarConfig { planar_band_m: 0.5, ..shortest() },
    )
    .unwrap();
    assert!(found.path.points().iter().any(|point| point.z >= 4.5), "over the wall of height 4");
}

#[test]
fn a_search_does_not_remember_the_last_one() {
    let potential = Potential::default();
    let mut scratch = Astar::default();
    let mut map = grid([20, 20, 1], &[[5, 5, 0], [6, 6, 0]]);
    let mut go = |from, to| {
        let request = Request {
            start: centre(from),
            goal: centre(to),
            potential: &potential,
            discs: &[],
            within: Region::EVERYWHERE,
        };
        plan(&mut map, &request, &shortest(), &mut scratch).unwrap()
    };
    let first = go([0, 0, 0], [19, 17, 0]);
    go([19, 0, 0], [0, 12, 0]);
    assert_eq!(go([0, 0, 0], [19, 17, 0]), first);
}

#[test]
fn where_start_is_goal_the_path_is_a_point() {
    let found = run(&mut grid([5, 5, 1], &[]), [2, 2, 0], [2, 2, 0], &shortest()).unwrap();
    assert_eq!(found.path, Path::new(vec![centre([2, 2, 0])]).unwrap());
}

/// A grid of 24 x 24 x 3 cells whose middle is closed: a circle of 5 m and a margin of 1 m.
fn with_closed_middle() -> ClearanceMap {
    let zone = NoFlyZone {
        centre: nalgebra::Vector2::new(12.0, 12.0),
        radius_m: 5.0,
        floor_m: f64::NEG_INFINITY,
        ceiling_m: f64::INFINITY,
    };
    let airspace = Airspace { no_fly: vec![zone], ..Airspace::default() };
    grid([24, 24, 3], &[]).with_keep_out(KeepOut::new(airspace, 1.0, 0.0))
}

/// How far the cells of a path are from what is closed, metres.
fn rooms_m(map: &ClearanceMap, plan: &Plan) -> Vec<f64> {
    plan.path.points().iter().map(|point| map.keep_out().unwrap().room_m(point)).collect()
}

#[test]
fn what_is_closed_is_gone_around() {
    let mut map = with_closed_middle();
    let plan = run(&mut map, [1, 12, 1], [22, 12, 1], &shortest()).unwrap();
    assert!(rooms_m(&map, &plan).iter().all(|room_m| *room_m >= 0.0), "{:?}", plan.path);
    let mut open = grid([24, 24, 3], &[]);
    assert!(
        run(&mut open, [1, 12, 1], [22, 12, 1], &shortest()).unwrap().path.length_m() < plan.path.length_m()
    );
}

#[test]
fn what_is_closed_is_left_by_about_the_shortest_way_and_is_no_goal() {
    let mut map = with_closed_middle();
    let plan = run(&mut map, [9, 12, 1], [22, 12, 1], &shortest()).unwrap();
    let rooms = rooms_m(&map, &plan);
    let out = rooms.iter().position(|room_m| *room_m >= 0.0).unwrap();
    assert!(rooms[..out].is_sorted() && out <= 5, "straight out: {rooms:?}");
    assert!(rooms[out..].iter().all(|room_m| *room_m >= 0.0), "and not back in: {rooms:?}");
    let refused = run(&mut map, [1, 12, 1], [12, 12, 1], &shortest());
    assert!(matches!(refused, Err(PlanError::GoalClosed { .. })), "{refused:?}");
}
