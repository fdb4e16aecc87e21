//! Planning: which path leads to the waypoint, around what the map knows and around others.

use nalgebra::Vector3;
use skein_planning::{
    Region,
    global::{Potential, PotentialObstacle, astar::Disc},
    map::ClearanceMap,
    separation::{self, FilterConfig},
};

use super::{
    course::{Course, Following},
    global::{PathFinder, Task},
    route_search::{ALLOWANCE, RouteSearch},
};
use crate::{
    config::Envelope,
    instruction::Waypoint,
    neighbours::{Neighbour, STANDING_M_S},
    positioning::Motion,
    report::Report,
};

/// Neighbours within this distance are gone around when the vehicle is stuck, m.
const AROUND_NEIGHBOURS_M: f64 = 8.0;
/// A path keeps this far outside the ghost of a silent neighbour, m.
const GHOST_SLACK_M: f64 = 0.3;
/// Nearer than this is the same place, m.
const SAME_PLACE_M: f64 = 1e-6;

/// Plans paths, a little in each tick.
#[derive(Debug)]
pub struct Planning {
    envelope: Envelope,
    filter: FilterConfig,
    routes: RouteSearch,
    /// The region that the plan under way is to stay in.
    within: Region,
    /// The effort left to the search for a path in this tick.
    allowance: usize,
}

impl Planning {
    /// Plans for a vehicle of this envelope by this planner.
    pub fn new(envelope: Envelope, finder: Box<dyn PathFinder>) -> Self {
        let (filter, routes) = (envelope.filter(), RouteSearch::new(finder));
        Self { envelope, filter, routes, within: Region::EVERYWHERE, allowance: ALLOWANCE }
    }

    /// Gives up the plan that is under way.
    pub fn abandon(&mut self) {
        self.routes.abandon();
    }

    /// Whether a plan has been begun that has no answer yet.
    pub fn is_under_way(&self) -> bool {
        self.routes.is_under_way()
    }

    /// Begins to plan a path to the waypoint, `within` a region. Where the vehicle is stuck, neighbours that stand
    /// around are obstacles too. One that has fallen silent always is, as large as its ghost will be. The answer
    /// comes at once if this tick's allowance is enough for it, else from [`Planning::go_on`].
    pub fn begin(
        &mut self,
        is_stuck: bool,
        course: &mut Course,
        within: Region,
        motion: &Motion,
        map: &mut ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        self.within = within;
        let Some(waypoint) = &mut course.waypoint else {
            return Some(Report::Unplannable { leg: 0, why: "there is no waypoint".to_owned() });
        };
        // Outside the map, as beyond the fence, the way begins and ends where the map does.
        let inside = |place: Vector3<f64>| match map.voxels().index_of(&place) {
            Some(_) => place,
            None => map.voxels().clamp(&place),
        };
        let goal = inside(within.clamp_height(&open_goal(waypoint, map)));
        // The vehicle comes to an allowed height first.
        let start = inside(within.clamp_height(&motion.position));
        let standing: Vec<Vector3<f64>> = neighbours
            .iter()
            .filter(|neighbour| neighbour.armed && neighbour.track.cooperative)
            .filter(|neighbour| neighbour.track.velocity.norm() < STANDING_M_S)
            .map(Neighbour::position)
            .filter(|position| (position - motion.position).norm() < AROUND_NEIGHBOURS_M)
            .collect();
        let radius_m = self.envelope.separation_m;
        let in_the_way = |disc: &&Vector3<f64>| {
            is_stuck
                && (*disc - goal).xy().norm() > radius_m
                && (*disc - motion.position).xy().norm() > radius_m
        };
        let discs = standing.iter().filter(in_the_way).map(|&centre| Disc { centre, radius_m });
        let discs = discs.chain(self.ghosts(neighbours, motion, [start, goal])).collect();
        let potential = self.potential(&standing, motion, &goal);
        let Envelope { hull_m, margin_m, .. } = self.envelope;
        let task = Task { start, goal, potential, discs, within, hull_m, margin_m };
        self.routes.begin(waypoint.leg, task, map);
        self.search(course, map)
    }

    /// Goes on with a plan that the ticks before were not enough for. Once in each tick, before anything else is
    /// planned.
    pub fn go_on(&mut self, course: &mut Course, map: &mut ClearanceMap) -> Option<Report> {
        self.allowance = ALLOWANCE;
        self.search(course, map)
    }

    fn search(&mut self, course: &mut Course, map: &mut ClearanceMap) -> Option<Report> {
        let (leg, found) = self.routes.advance(map, &mut self.allowance)?;
        Some(match found {
            Ok(found) => {
                let length_m = found.path.length_m();
                course.following = Some(Following::new(found, self.within));
                Report::Planned { leg, length_m }
            }
            Err(error) => {
                course.following = None;
                Report::Unplannable { leg, why: error.to_string() }
            }
        })
    }

    /// What makes places near those who stand dearer, on the way ahead.
    fn potential(&self, standing: &[Vector3<f64>], motion: &Motion, goal: &Vector3<f64>) -> Potential {
        let heading = if motion.velocity.norm() > 0.3 { motion.velocity } else { goal - motion.position };
        let influence_m = 2.0 * self.envelope.separation_m;
        let repellers: Vec<_> =
            standing.iter().map(|&centre| PotentialObstacle { centre, influence_m }).collect();
        Potential::gated(&motion.position, &heading, &repellers, 2.0)
    }

    /// The places that silent neighbours may come to take. The ends of the path are outside in any case: the filter
    /// leads out of a ghost.
    fn ghosts<'a>(
        &'a self,
        neighbours: &'a [Neighbour],
        motion: &'a Motion,
        ends: [Vector3<f64>; 2],
    ) -> impl Iterator<Item = Disc> + 'a {
        let silent = neighbours.iter().filter(|neighbour| neighbour.armed && !neighbour.track.cooperative);
        silent.filter_map(move |neighbour| {
            let grown = separation::Neighbour { age_s: f64::INFINITY, ..neighbour.track };
            let centre = neighbour.position();
            let to_ends = ends.map(|end| (end - centre).xy().norm() - GHOST_SLACK_M);
            let sigma_m = motion.position_sigma_m();
            let kept_m = separation::distance_kept_m(sigma_m, &grown, &self.filter) + GHOST_SLACK_M;
            let radius_m = to_ends.into_iter().fold(kept_m, f64::min);
            (radius_m > 0.0).then_some(Disc { centre, radius_m })
        })
    }
}

/// Where to plan to: the waypoint, or the nearest place that is open instead of one that is closed, if that is on the
/// way to a waypoint beyond the map, or home; there the way home ends. Other waypoints are flown to as they are, or
/// not at all.
fn open_goal(waypoint: &mut Waypoint, map: &ClearanceMap) -> Vector3<f64> {
    let goal = map.voxels().clamp(&waypoint.target);
    let is_waypoint = (goal - waypoint.target).norm() < SAME_PLACE_M;
    let Some(keep_out) = map.keep_out().filter(|_| !is_waypoint || waypoint.is_home) else {
        return goal;
    };
    let is_known = |place: &Vector3<f64>| {
        let voxel = map.voxels().index_of(place);
        voxel.is_some_and(|voxel| keep_out.room_m(&map.voxels().centre_of(voxel)) >= 0.0)
    };
    let open = keep_out.nearest_open(&goal, is_known).unwrap_or(goal);
    if is_waypoint && open != goal {
        waypoint.target = open;
    }
    open
}
