//! The search for a path, a little in each tick, so that no search holds up the set-points.

use nalgebra::Vector3;
use skein_planning::{
    global::astar::PlanError,
    map::{ClearanceMap, VoxelIndex},
};

use super::global::{Found, PathFinder, Task};

/// The effort of the search in one tick: so many expansions in one layer, some three milliseconds.
pub const ALLOWANCE: usize = 10_000;

/// The planner, and the search under way, if one is.
#[derive(Debug)]
pub struct RouteSearch {
    finder: Box<dyn PathFinder>,
    under_way: Option<UnderWay>,
}

#[derive(Debug)]
struct UnderWay {
    /// Leg of the waypoint.
    leg: i64,
    task: Task,
    /// The centre of the map's first voxel: where the window was.
    window: Vector3<f64>,
}

impl RouteSearch {
    /// Searches by this planner.
    pub fn new(finder: Box<dyn PathFinder>) -> Self {
        Self { finder, under_way: None }
    }

    /// Begins a search for the path of a leg, in place of any before.
    pub fn begin(&mut self, leg: i64, task: Task, map: &ClearanceMap) {
        self.finder.begin();
        self.under_way = Some(UnderWay { leg, task, window: window_of(map) });
    }

    /// Gives up whatever search is under way.
    pub fn abandon(&mut self) {
        self.under_way = None;
    }

    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Goes on with the search under way, and takes what that costs from `allowance`. `None` if there is none or it
    /// needs more; else the leg and its path.
    pub fn advance(
        &mut self,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<(i64, Result<Found, PlanError>)> {
        let search = self.under_way.as_mut()?;
        let window = window_of(map);
        if std::mem::replace(&mut search.window, window) != window {
            self.finder.begin();
        }
        let answer = self.finder.advance(&search.task, map, allowance)?;
        Some((self.under_way.take()?.leg, answer))
    }
}

fn window_of(map: &ClearanceMap) -> Vector3<f64> {
    map.voxels().centre_of(VoxelIndex::default())
}

#[cfg(test)]
mod tests {
    use skein_planning::Region;
    use skein_planning::global::{Potential, astar::Disc};
    use skein_planning::map::VoxelMapConfig;

    use super::*;
    use crate::config::GlobalPlanner;
    use crate::pipeline::global::path_finder;

    /// A map with the vehicle at the origin in a closed room, `half_m` from each wall, too high to fly over.
    fn room(half_m: f64) -> ClearanceMap {
        let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 6.0), 2.5).unwrap();
        let steps = (half_m / 0.2) as i32;
        let layers = map.voxels().counts()[2];
        for z in (0..layers).map(|layer| layer as f64 * 0.2 + 0.1) {
            for at in (-steps..=steps).map(|step| f64::from(step) * 0.2) {
                for (x, y) in [(at, half_m), (at, -half_m), (half_m, at), (-half_m, at)] {
                    map.insert(&Vector3::new(x, y, z));
                }
            }
        }
        map
    }

    fn task(goal: Vector3<f64>) -> Task {
        let start = Vector3::new(0.0, 0.0, 3.0);
        let potential = Potential::default();
        let within = Region::EVERYWHERE;
        Task { start, goal, potential, discs: Vec::new(), within, hull_m: 0.25, margin_m: 0.25 }
    }

    /// Both planners: what holds for one holds for the other.
    fn searches() -> [RouteSearch; 2] {
        [GlobalPlanner::Astar, GlobalPlanner::DstarLite].map(|planner| RouteSearch::new(path_finder(planner)))
    }

    #[test]
    fn a_tick_never_searches_more_than_it_may() {
        for mut search in searches() {
            let mut map = room(15.0);
            search.begin(4, task(Vector3::new(30.0, 0.0, 3.0)), &map);
            let mut ticks = 0;
            let answer = loop {
                let mut allowance = ALLOWANCE;
                let answer = search.advance(&mut map, &mut allowance);
                ticks += 1;
                match answer {
                    Some(answer) => break answer,
                    None => assert_eq!(allowance, 0, "a tick that leaves off has used what it may"),
                }
            };
            assert!(matches!(answer, (4, Err(PlanError::Unreachable { .. }))), "{answer:?}");
            assert!(ticks > 5 && ticks < 200, "{ticks}");
            assert!(!search.is_under_way());
        }
    }

    #[test]
    fn an_easy_path_is_found_in_one_tick() {
        for mut search in searches() {
            let mut map = room(15.0);
            search.begin(4, task(Vector3::new(10.0, 5.0, 3.0)), &map);
            let (leg, found) = search.advance(&mut map, &mut ALLOWANCE.clone()).unwrap();
            assert_eq!((leg, found.unwrap().clearance_m), (4, Some(0.5)));
        }
    }

    #[test]
    fn the_size_of_the_slices_does_not_change_what_is_found() {
        let mut map = room(15.0);
        let disc = Disc { centre: Vector3::new(5.0, 2.0, 3.0), radius_m: 1.5 };
        let mut go = |slice: usize| {
            searches().map(|mut search| {
                search.begin(4, Task { discs: vec![disc], ..task(Vector3::new(10.0, 5.0, 3.0)) }, &map);
                loop {
                    if let Some(answer) = search.advance(&mut map, &mut slice.clone()) {
                        return answer;
                    }
                }
            })
        };
        assert_eq!(go(7), go(usize::MAX));
    }

    #[test]
    fn a_window_that_moves_makes_the_search_begin_again() {
        for mut search in searches() {
            let mut map = room(15.0);
            search.begin(4, task(Vector3::new(10.0, 5.0, 3.0)), &map);
            assert!(search.advance(&mut map, &mut 10).is_none());
            assert!(map.recentre(&Vector3::new(25.0, 0.0, 3.0)));
            let (_, found) = search.advance(&mut map, &mut ALLOWANCE.clone()).unwrap();
            let path = found.unwrap().path;
            assert_eq!(
                (path.start(), path.end()),
                (Vector3::new(0.0, 0.0, 3.0), Vector3::new(10.0, 5.0, 3.0))
            );
        }
    }

    /// A wall across the room at `x_m` with a gap of `gap_m` in it, as high as the map.
    fn wall_with_gap(map: &mut ClearanceMap, x_m: f64, gap_m: f64) {
        let layers = map.voxels().counts()[2];
        for z in (0..layers).map(|layer| layer as f64 * 0.2 + 0.1) {
            let along = (-75..=75).map(|step| f64::from(step) * 0.2);
            along.filter(|y| y.abs() > gap_m / 2.0).for_each(|y| map.insert(&Vector3::new(x_m, y, z)));
        }
    }

    #[test]
    fn where_no_way_is_wide_enough_to_be_repaired_a_star_finds_a_tight_one() {
        let mut search = RouteSearch::new(path_finder(GlobalPlanner::DstarLite));
        let mut find = |map: &mut ClearanceMap| {
            search.begin(4, task(Vector3::new(10.0, 0.0, 3.0)), map);
            loop {
                if let Some((_, found)) = search.advance(map, &mut ALLOWANCE.clone()) {
                    return found.unwrap();
                }
            }
        };
        let mut map = room(15.0);
        assert_eq!(find(&mut map).clearance_m, Some(0.5));
        wall_with_gap(&mut map, 5.0, 0.5);
        let tight = find(&mut map);
        let clearance_m = tight.clearance_m.unwrap();
        assert!(clearance_m < 0.5, "{clearance_m}");
        assert!(tight.path.length_m() < 10.5, "through the gap: {} m", tight.path.length_m());
    }

    #[test]
    fn a_way_is_repaired_for_less_than_a_search_costs() {
        let mut map = room(15.0);
        wall_with_gap(&mut map, 5.0, 4.0);
        let mut search = RouteSearch::new(path_finder(GlobalPlanner::DstarLite));
        let mut cost = |map: &mut ClearanceMap| {
            search.begin(4, task(Vector3::new(10.0, 8.0, 3.0)), map);
            let mut allowance = usize::MAX;
            assert!(matches!(search.advance(map, &mut allowance), Some((4, Ok(_)))));
            usize::MAX - allowance
        };
        let first = cost(&mut map);
        map.insert(&Vector3::new(2.0, 0.1, 3.1));
        let again = cost(&mut map);
        assert!(again * 3 < first, "{again} against {first}");
    }
}
