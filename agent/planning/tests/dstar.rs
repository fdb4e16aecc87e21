//! A way that is repaired is as good as one that is searched for, whatever the map has learnt and wherever the
//! vehicle went.

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use skein_planning::Region;
use skein_planning::airspace::{Airspace, KeepOut, NoFlyZone};
use skein_planning::global::astar::{Disc, Plan, Request};
use skein_planning::global::dstar::{Dstar, DstarConfig};
use skein_planning::global::{Effort, Potential, Search, Unsolved};
use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
use skein_planning::map::{ClearanceMap, VoxelIndex, VoxelMapConfig};

/// Voxels along x, y and z; they are one metre wide and begin at the origin.
const SIZE: [usize; 3] = [14, 12, 3];

fn map() -> ClearanceMap {
    let size_m = SIZE.map(|cells| cells as f64);
    let config = VoxelMapConfig {
        resolution_m: 1.0,
        size_m,
        max_range_m: 10.0,
        vertical_extent_m: 0.0,
        ground_m: -1.0,
        ..VoxelMapConfig::default()
    };
    ClearanceMap::new(config, Vector3::from(size_m) / 2.0, 5.0).unwrap()
}

/// A no-fly zone that begins above the lowest layer.
fn zone() -> KeepOut {
    let zone = NoFlyZone { centre: Vector2::new(9.3, 3.2), radius_m: 1.7, floor_m: 1.4, ceiling_m: 9.0 };
    KeepOut::new(Airspace { no_fly: vec![zone], ..Airspace::default() }, 0.0, 0.0)
}

fn centre(x: usize, y: usize, z: usize) -> Vector3<f64> {
    Vector3::from([x, y, z].map(|c| c as f64 + 0.5))
}

fn place() -> impl Strategy<Value = Vector3<f64>> {
    let [nx, ny, nz] = SIZE.map(|cells| cells as f64);
    (0.0..nx, 0.0..ny, 0.0..nz).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

/// What there is to plan, and what has happened to the map since the last plan.
#[derive(Clone, Debug)]
struct Turn {
    start: Vector3<f64>,
    hits: Vec<Vector3<f64>>,
    cleared: Option<Vector3<f64>>,
    discs: Vec<Vector3<f64>>,
    clearance_m: f64,
}

fn turn() -> impl Strategy<Value = Turn> {
    let hits = prop::collection::vec(place(), 0..6);
    let clearance_m = prop::sample::select(vec![0.0, 0.5, 1.0]);
    (place(), hits, prop::option::of(place()), prop::collection::vec(place(), 0..2), clearance_m).prop_map(
        |(start, hits, cleared, discs, clearance_m)| Turn { start, hits, cleared, discs, clearance_m },
    )
}

fn plan(
    search: &mut Dstar,
    map: &mut ClearanceMap,
    request: &Request<'_>,
    clearance_m: f64,
    slice: usize,
) -> Result<Plan, Unsolved> {
    let config = DstarConfig { clearance_m, budget: usize::MAX, planar_band_m: 5.0 };
    search.begin();
    loop {
        if let Some(answer) = search.advance(map, request, &config, &mut slice.clone()) {
            return answer;
        }
    }
}

/// What the way costs that A* finds on a grid drawn by the rules as documented; `None` if there is none.
fn searched(map: &ClearanceMap, request: &Request<'_>, clearance_m: f64) -> Option<f64> {
    let [nx, ny, _] = SIZE;
    let layer = request.start.z as usize;
    let mut grid = Grid { cells: OccupancyGrid::new([nx, ny, 1]).unwrap(), costs: StepCosts::FLYING };
    for (x, y) in (0..ny).flat_map(|y| (0..nx).map(move |x| (x, y))) {
        let there = centre(x, y, layer);
        let is_closed = |z: f64| {
            let place = Vector3::new(there.x, there.y, z);
            map.keep_out().is_some_and(|keep_out| keep_out.room_m(&place) < 0.0)
        };
        let is_taken = |disc: &Disc| (there - disc.centre).xy().norm() < disc.radius_m;
        let is_open = map.is_segment_clear(&there, &there, clearance_m)
            && !is_closed(request.start.z)
            && !is_closed(request.goal.z)
            && !request.discs.iter().any(is_taken);
        grid.cells.set_blocked(VoxelIndex { x, y, z: 0 }, !is_open);
    }
    let [start, goal] =
        [request.start, request.goal].map(|end| VoxelIndex { x: end.x as usize, y: end.y as usize, z: 0 });
    let is_shut = [start, goal].iter().any(|end| grid.cells.is_blocked(*end));
    let route = Search::default().solve(&grid, start, goal, Effort::OPTIMAL).ok()?;
    (!is_shut).then_some(route.cost)
}

proptest! {
    #[test]
    fn it_costs_what_a_search_from_scratch_costs(
        goals in prop::collection::vec(place(), 1..3),
        turns in prop::collection::vec(turn(), 1..10),
        has_zone in any::<bool>(),
        slice in prop::sample::select(vec![3, usize::MAX]),
    ) {
        let mut map = if has_zone { map().with_keep_out(zone()) } else { map() };
        let mut search = Dstar::default();
        for (number, turn) in turns.iter().enumerate() {
            turn.hits.iter().for_each(|hit| map.insert(hit));
            turn.cleared.iter().for_each(|place| map.clear_ball(place, 2.0));
            let goal = goals[number * goals.len() / turns.len()];
            let discs: Vec<Disc> = turn.discs.iter().map(|&centre| Disc { centre, radius_m: 1.6 }).collect();
            let potential = Potential::default();
            let (start, within) = (turn.start, Region::EVERYWHERE);
            let request = Request { start, goal, potential: &potential, discs: &discs, within };
            let found = plan(&mut search, &mut map, &request, turn.clearance_m, slice);
            match (found, searched(&map, &request, turn.clearance_m)) {
                (Ok(plan), Some(least)) => {
                    prop_assert!((plan.cost - least).abs() < 1e-9, "{} instead of {least}", plan.cost);
                    let ends = [(plan.path.start(), turn.start), (plan.path.end(), goal)];
                    prop_assert!(ends.iter().all(|(end, wanted)| (end - wanted).norm() < 1e-9), "{ends:?}");
                }
                (Err(Unsolved::Unreachable { .. }), None) => {}
                (found, least) => prop_assert!(false, "{found:?}, expected {least:?}"),
            }
        }
    }
}

/// A request without potential and discs, from one end of the middle layer to the other.
fn across(potential: &Potential) -> Request<'_> {
    Request {
        start: centre(0, 6, 1),
        goal: centre(13, 6, 1),
        potential,
        discs: &[],
        within: Region::EVERYWHERE,
    }
}

#[test]
fn what_is_learnt_near_the_vehicle_is_cheaper_to_take_in_than_to_search_again() {
    let (mut map, potential) = (map(), Potential::default());
    let request = across(&potential);
    (0..11).for_each(|y| map.insert(&centre(10, y, 1)));
    let mut search = Dstar::default();
    plan(&mut search, &mut map, &request, 0.0, usize::MAX).unwrap();
    (5..8).for_each(|y| map.insert(&centre(2, y, 1)));
    let repaired = plan(&mut search, &mut map, &request, 0.0, usize::MAX).unwrap();
    let fresh = plan(&mut Dstar::default(), &mut map, &request, 0.0, usize::MAX).unwrap();
    assert_eq!(repaired.cost, fresh.cost);
    assert!(repaired.expanded * 2 < fresh.expanded, "{} against {}", repaired.expanded, fresh.expanded);
}

#[test]
fn a_window_that_has_moved_is_looked_through_anew() {
    let (mut map, potential) = (map(), Potential::default());
    let mut search = Dstar::default();
    plan(&mut search, &mut map, &across(&potential), 0.0, usize::MAX).unwrap();
    assert!(map.recentre(&Vector3::new(20.5, 6.0, 1.5)));
    let request = Request { start: centre(16, 6, 1), goal: centre(24, 6, 1), ..across(&potential) };
    (4..9).for_each(|y| map.insert(&centre(20, y, 1)));
    let plan = plan(&mut search, &mut map, &request, 0.0, usize::MAX).unwrap();
    assert!(map.is_path_clear(&plan.path, 0.0, plan.path.length_m(), 0.0));
}

#[test]
fn a_budget_that_is_spent_ends_the_search() {
    let (mut map, potential) = (map(), Potential::default());
    let config = DstarConfig { clearance_m: 0.0, budget: 5, planar_band_m: 1.0 };
    let mut search = Dstar::default();
    search.begin();
    let answer = search.advance(&mut map, &across(&potential), &config, &mut 100_000);
    assert!(matches!(answer, Some(Err(Unsolved::Spent { expanded: 5, .. }))), "{answer:?}");
}

#[test]
fn ends_that_differ_in_height_are_not_for_it() {
    let (mut map, potential) = (map(), Potential::default());
    let config = DstarConfig { clearance_m: 0.0, budget: 1000, planar_band_m: 1.0 };
    let request = Request { start: centre(0, 6, 0), goal: centre(13, 6, 2), ..across(&potential) };
    let answer = Dstar::default().advance(&mut map, &request, &config, &mut 1000);
    assert_eq!(answer, Some(Err(Unsolved::Unreachable { expanded: 0 })));
}
