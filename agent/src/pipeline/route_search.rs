//! The search for a path, a little in each tick, so that no search holds up the set-points.

use nalgebra::Vector3;
use skein_planning::{
    Path,
    global::{
        Potential,
        astar::{Astar, AstarConfig, Disc, PlanError, Request},
        simplify_around,
    },
    map::{ClearanceMap, VoxelIndex},
};

/// What the search may do in one tick: as much as so many expansions in one layer take, some three milliseconds.
pub const ALLOWANCE: usize = 10_000;
/// Margins between hull and obstacles that are tried in turn when there is no path with the envelope's own, m.
const TIGHT_MARGINS_M: [f64; 2] = [0.1, 0.03];
/// Most voxels that a search at one height expands.
const LEVEL_BUDGET: usize = 100_000;
/// Most voxels that a search at all heights expands; each costs more.
const CLIMBING_BUDGET: usize = 40_000;
/// As the height band of a level search: search all heights.
const ALL_HEIGHTS: f64 = -1.0;

/// From where to where a path is wanted, and by what kind of vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Leg of the waypoint.
    pub leg: i64,
    /// Where the vehicle is, m ENU.
    pub start: Vector3<f64>,
    /// Where it shall go, m ENU.
    pub goal: Vector3<f64>,
    /// What makes some places dearer.
    pub potential: Potential,
    /// Standing vehicles and ghosts, to be gone around if that is possible.
    pub discs: Vec<Disc>,
    /// Radius of the sphere around the vehicle, m.
    pub hull_m: f64,
    /// Clearance wanted between hull and obstacles, m.
    pub margin_m: f64,
}

/// A path that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// From the start towards the goal.
    pub path: Path,
    /// The clearance it keeps, m.
    pub clearance_m: f64,
}

/// The search under way, if one is, and the memory that searches reuse.
#[derive(Debug, Default)]
pub struct RouteSearch {
    astar: Astar,
    under_way: Option<UnderWay>,
}

#[derive(Debug)]
struct UnderWay {
    task: Task,
    /// Which of the tries it is at; `None` before the first and whenever it must begin again.
    attempt: usize,
    is_begun: bool,
    first_error: Option<PlanError>,
    /// The centre of the map's first voxel: where the window was.
    window: Vector3<f64>,
}

impl RouteSearch {
    /// Begins a search, in place of any before.
    pub fn begin(&mut self, task: Task, map: &ClearanceMap) {
        let window = window_of(map);
        self.under_way = Some(UnderWay { task, attempt: 0, is_begun: false, first_error: None, window });
    }

    /// Gives up whatever search is under way.
    pub fn abandon(&mut self) {
        self.under_way = None;
    }

    /// Whether a search is under way.
    #[must_use]
    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Goes on with the search under way, and takes what that costs from `allowance`. `None` if there is none or it needs
    /// more; else the leg and the path: that with the widest of the margins that allow one, level if there is such a path, else over or
    /// under what is in the way, and around the discs if possible.
    pub fn advance(
        &mut self,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<(i64, Result<Found, PlanError>)> {
        let search = self.under_way.as_mut()?;
        let window = window_of(map);
        if std::mem::replace(&mut search.window, window) != window {
            (search.attempt, search.is_begun, search.first_error) = (0, false, None);
        }
        let answer = loop {
            let Some((config, discs)) = search.attempt() else {
                let error = search.first_error.take();
                break Err(error.unwrap_or(PlanError::Unreachable { expanded: 0 }));
            };
            let task = &search.task;
            let request = Request { start: task.start, goal: task.goal, potential: &task.potential, discs };
            let begun = if search.is_begun { Ok(()) } else { self.astar.begin(map, &request, &config) };
            let answer = match begun {
                Ok(()) => self.astar.advance(map, &request, &config, allowance),
                Err(error) => Some(Err(error)),
            };
            let clearance_m = config.clearance_m;
            match answer {
                None => {
                    search.is_begun = true;
                    return None;
                }
                Some(Ok(plan)) => {
                    break Ok(Found {
                        path: simplify_around(map, &plan.path, clearance_m, discs),
                        clearance_m,
                    });
                }
                // Far away: begin with the part of the way that leads nearest to the goal.
                Some(Err(PlanError::BudgetExhausted { partial, .. })) if config.planar_band_m > 0.0 => {
                    break Ok(Found { path: partial, clearance_m });
                }
                Some(Err(error)) => {
                    search.first_error.get_or_insert(error);
                    (search.attempt, search.is_begun) = (search.attempt + 1, false);
                }
            }
        };
        let leg = search.task.leg;
        self.under_way = None;
        Some((leg, answer))
    }
}

impl UnderWay {
    /// How to search now, and around what; `None` when all was tried.
    fn attempt(&self) -> Option<(AstarConfig, &[Disc])> {
        let level = AstarConfig { budget: LEVEL_BUDGET, ..AstarConfig::default() };
        let climbing =
            AstarConfig { planar_band_m: ALL_HEIGHTS, budget: CLIMBING_BUDGET, ..AstarConfig::default() };
        let [tight_m, tightest_m] = TIGHT_MARGINS_M;
        let wide_m = self.task.margin_m;
        let tries = [
            (level, wide_m),
            (level, tight_m),
            (level, tightest_m),
            (climbing, wide_m),
            (climbing, tightest_m),
        ];
        let rounds = if self.task.discs.is_empty() { 1 } else { 2 };
        let discs = if self.attempt < tries.len() { self.task.discs.as_slice() } else { &[] };
        let (config, margin_m) = *tries.get(self.attempt % tries.len())?;
        let clearance_m = self.task.hull_m + margin_m;
        (self.attempt < rounds * tries.len()).then_some((AstarConfig { clearance_m, ..config }, discs))
    }
}

fn window_of(map: &ClearanceMap) -> Vector3<f64> {
    map.voxels().centre_of(VoxelIndex::default())
}

#[cfg(test)]
mod tests {
    use skein_planning::map::VoxelMapConfig;

    use super::*;

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
        Task { leg: 4, start, goal, potential, discs: Vec::new(), hull_m: 0.25, margin_m: 0.25 }
    }

    #[test]
    fn a_tick_never_searches_more_than_it_may() {
        let mut map = room(15.0);
        let mut search = RouteSearch::default();
        search.begin(task(Vector3::new(30.0, 0.0, 3.0)), &map);
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

    #[test]
    fn an_easy_path_is_found_in_one_tick() {
        let mut map = room(15.0);
        let mut search = RouteSearch::default();
        search.begin(task(Vector3::new(10.0, 5.0, 3.0)), &map);
        let (leg, found) = search.advance(&mut map, &mut ALLOWANCE.clone()).unwrap();
        assert_eq!((leg, found.unwrap().clearance_m), (4, 0.5));
    }

    #[test]
    fn the_size_of_the_slices_does_not_change_what_is_found() {
        let mut map = room(15.0);
        let disc = Disc { centre: Vector3::new(5.0, 2.0, 3.0), radius_m: 1.5 };
        let mut go = |slice: usize| {
            let mut search = RouteSearch::default();
            search.begin(Task { discs: vec![disc], ..task(Vector3::new(10.0, 5.0, 3.0)) }, &map);
            loop {
                if let Some(answer) = search.advance(&mut map, &mut slice.clone()) {
                    return answer;
                }
            }
        };
        assert_eq!(go(7), go(usize::MAX));
    }

    #[test]
    fn a_window_that_moves_makes_the_search_begin_again() {
        let mut map = room(15.0);
        let mut search = RouteSearch::default();
        search.begin(task(Vector3::new(10.0, 5.0, 3.0)), &map);
        assert!(search.advance(&mut map, &mut 10).is_none());
        assert!(map.recentre(&Vector3::new(25.0, 0.0, 3.0)));
        let (_, found) = search.advance(&mut map, &mut ALLOWANCE.clone()).unwrap();
        let path = found.unwrap().path;
        assert_eq!((path.start(), path.end()), (Vector3::new(0.0, 0.0, 3.0), Vector3::new(10.0, 5.0, 3.0)));
    }
}
