//! The search for a path, a little in each tick, so that no search holds up the set-points.

use nalgebra::Vector3;
use skein_planning::{
    Path,
    global::{
        Potential,
        astar::{Astar, AstarConfig, Disc, Plan, PlanError, Request},
        dstar::{Dstar, DstarConfig},
        simplify_around,
    },
    map::{ClearanceMap, VoxelIndex},
};

use crate::config::GlobalPlanner;

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

impl Found {
    fn of(plan: &Plan, map: &ClearanceMap, clearance_m: f64, discs: &[Disc]) -> Self {
        Self { path: simplify_around(map, &plan.path, clearance_m, discs), clearance_m }
    }
}

/// The search under way, if one is, and what searches keep for the next one.
#[derive(Debug, Default)]
pub struct RouteSearch {
    astar: Astar,
    /// What is tried first, if it is not A*.
    dstar: Option<Dstar>,
    under_way: Option<UnderWay>,
}

#[derive(Debug)]
struct UnderWay {
    task: Task,
    /// Whether the last way is being repaired still.
    repairs: bool,
    /// Which of the tries with A* it is at.
    attempt: usize,
    is_begun: bool,
    first_error: Option<PlanError>,
    /// The centre of the map's first voxel: where the window was.
    window: Vector3<f64>,
}

impl RouteSearch {
    /// Searches by this planner.
    #[must_use]
    pub fn new(planner: GlobalPlanner) -> Self {
        let dstar = (planner == GlobalPlanner::DstarLite).then(Dstar::default);
        Self { dstar, ..Self::default() }
    }

    /// Begins a search, in place of any before.
    pub fn begin(&mut self, task: Task, map: &ClearanceMap) {
        let window = window_of(map);
        self.under_way =
            Some(UnderWay { task, repairs: true, attempt: 0, is_begun: false, first_error: None, window });
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
            (search.repairs, search.attempt, search.is_begun, search.first_error) = (true, 0, false, None);
        }
        let dstar = self.dstar.as_mut().filter(|_| search.repairs);
        let repaired = match dstar.map(|dstar| search.repair(dstar, map, allowance)) {
            Some(answer) => answer?,
            None => None,
        };
        if let Some(found) = repaired {
            let leg = search.task.leg;
            self.under_way = None;
            return Some((leg, Ok(found)));
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
                Some(Ok(plan)) => break Ok(Found::of(&plan, map, clearance_m, discs)),
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
    /// Goes on repairing the last way. `None` if there is no answer yet; else the way, if there is one of the margin wanted.
    fn repair(
        &mut self,
        dstar: &mut Dstar,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<Option<Found>> {
        let Task { start, goal, potential, discs, hull_m, margin_m, .. } = &self.task;
        let request = Request { start: *start, goal: *goal, potential, discs };
        let clearance_m = hull_m + margin_m;
        let planar_band_m = AstarConfig::default().planar_band_m;
        let config = DstarConfig { clearance_m, budget: LEVEL_BUDGET, planar_band_m };
        if !std::mem::replace(&mut self.is_begun, true) {
            dstar.begin();
        }
        let answer = dstar.advance(map, &request, &config, allowance)?;
        (self.repairs, self.is_begun) = (false, false);
        Some(answer.ok().map(|plan| Found::of(&plan, map, clearance_m, discs)))
    }

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

    /// Both planners: what holds for one holds for the other.
    fn searches() -> [RouteSearch; 2] {
        [GlobalPlanner::Astar, GlobalPlanner::DstarLite].map(RouteSearch::new)
    }

    #[test]
    fn a_tick_never_searches_more_than_it_may() {
        for mut search in searches() {
            let mut map = room(15.0);
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
    }

    #[test]
    fn an_easy_path_is_found_in_one_tick() {
        for mut search in searches() {
            let mut map = room(15.0);
            search.begin(task(Vector3::new(10.0, 5.0, 3.0)), &map);
            let (leg, found) = search.advance(&mut map, &mut ALLOWANCE.clone()).unwrap();
            assert_eq!((leg, found.unwrap().clearance_m), (4, 0.5));
        }
    }

    #[test]
    fn the_size_of_the_slices_does_not_change_what_is_found() {
        let mut map = room(15.0);
        let disc = Disc { centre: Vector3::new(5.0, 2.0, 3.0), radius_m: 1.5 };
        let mut go = |slice: usize| {
            searches().map(|mut search| {
                search.begin(Task { discs: vec![disc], ..task(Vector3::new(10.0, 5.0, 3.0)) }, &map);
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
            search.begin(task(Vector3::new(10.0, 5.0, 3.0)), &map);
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
        let mut search = RouteSearch::new(GlobalPlanner::DstarLite);
        let mut find = |map: &mut ClearanceMap| {
            search.begin(task(Vector3::new(10.0, 0.0, 3.0)), map);
            loop {
                if let Some((_, found)) = search.advance(map, &mut ALLOWANCE.clone()) {
                    return found.unwrap();
                }
            }
        };
        let mut map = room(15.0);
        assert_eq!(find(&mut map).clearance_m, 0.5);
        wall_with_gap(&mut map, 5.0, 0.5);
        let tight = find(&mut map);
        assert!(tight.clearance_m < 0.5, "{}", tight.clearance_m);
        assert!(tight.path.length_m() < 10.5, "through the gap: {} m", tight.path.length_m());
    }

    #[test]
    fn a_way_is_repaired_for_less_than_a_search_costs() {
        let mut map = room(15.0);
        wall_with_gap(&mut map, 5.0, 4.0);
        let mut search = RouteSearch::new(GlobalPlanner::DstarLite);
        let mut cost = |map: &mut ClearanceMap| {
            search.begin(task(Vector3::new(10.0, 8.0, 3.0)), map);
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
