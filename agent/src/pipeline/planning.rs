//! Planning: which path leads to the waypoint, around what the map knows and around others.

use nalgebra::Vector3;
use skein_planning::{
    Region,
    global::{Potential, PotentialConfig, PotentialObstacle, astar::Disc},
    map::ClearanceMap,
    separation::{self, FilterConfig},
};

use super::{
    course::{Course, Following},
    global::{Found, PathFinder, Task},
    route_search::{ALLOWANCE, RouteSearch},
    way_back::Space,
};
use crate::{
    config::{Envelope, Fence},
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
/// A path that must be another than the one that led into a local minimum keeps this far from there, m.
const MINIMUM_M: f64 = 0.7;
/// Something that moves is taken to go straight on for so long at most, s.
const FORESEEN_S: f64 = 3.0;

/// The rest of the way beyond the goal of a search.
#[derive(Clone, Copy, Debug)]
enum Beyond {
    /// Nothing: it is the waypoint.
    Nothing,
    /// The waypoint, and nothing that is known lies in the way there.
    Waypoint(Vector3<f64>),
    /// The waypoint, behind what is closed.
    Closed,
}

/// The obstacles of a plan beside the map.
#[derive(Clone, Copy, Debug)]
pub struct InTheWay<'a> {
    /// The vehicle is stuck: neighbours that stand, and what moves, are gone around.
    pub is_stuck: bool,
    /// The local minimum that the last path led into, m ENU.
    pub minimum: Option<Vector3<f64>>,
    pub neighbours: &'a [Neighbour],
    /// Moving things that tell nobody.
    pub movers: &'a [separation::Neighbour],
}

/// Plans paths, a little in each tick.
#[derive(Debug)]
pub struct Planning {
    envelope: Envelope,
    fence: Fence,
    filter: FilterConfig,
    potential: PotentialConfig,
    routes: RouteSearch,
    /// The region that the plan under way is to stay in.
    within: Region,
    /// Where it is to lead.
    goal: Vector3<f64>,
    /// The waypoint, if it lies beyond the map.
    beyond: Beyond,
    /// Whether it is to take the place of a path that is flown meanwhile.
    extends: bool,
    /// The vehicles that have fallen silent, for whoever asks why there is no path.
    silent: String,
    /// The effort left to the search for a path in this tick.
    allowance: usize,
}

impl Planning {
    /// Plans for a vehicle of this envelope inside this fence by this planner, with paths dearer where something
    /// repels.
    pub fn new(
        envelope: Envelope,
        fence: Fence,
        finder: Box<dyn PathFinder>,
        potential: PotentialConfig,
    ) -> Self {
        let (filter, routes) = (envelope.filter(), RouteSearch::new(finder));
        Self {
            envelope,
            fence,
            filter,
            potential,
            routes,
            within: Region::EVERYWHERE,
            goal: Vector3::zeros(),
            beyond: Beyond::Nothing,
            extends: false,
            silent: String::new(),
            allowance: ALLOWANCE,
        }
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
    /// around, and what moves, are obstacles too. A neighbour that has fallen silent always is, as large as its ghost
    /// will be. The answer comes at once if this tick's allowance is enough for it, else from [`Planning::go_on`].
    /// From outside the space that paths lead through the way leads straight back, and is planned on from there.
    pub fn begin(
        &mut self,
        in_the_way: InTheWay<'_>,
        course: &mut Course,
        within: Region,
        motion: &Motion,
        map: &mut ClearanceMap,
    ) -> Option<Report> {
        let Some(waypoint) = &mut course.waypoint else {
            return Some(Report::Unplannable { leg: 0, why: "there is no waypoint".to_owned(), zone: None });
        };
        self.extends = false;
        let space = self.space(map);
        let back = space.is_left_at(&motion.position).then(|| space.way_from(&motion.position, map));
        if let Some(path) = back.flatten() {
            self.abandon();
            let following = course.following.insert(Following::back(path, space, within));
            return Some(Report::Planned { leg: waypoint.leg, length_m: following.path.length_m() });
        }
        self.prepare(in_the_way, waypoint, within, motion, map);
        self.search(course, map)
    }

    /// The space that paths lead through.
    fn space(&self, map: &ClearanceMap) -> Space {
        Space::of(&self.fence, map, self.envelope.obstacle_clearance_m())
    }

    /// Begins to plan on from where the vehicle is, if the path that it flies ends short of the waypoint and half of
    /// it lies behind: a leg longer than the map is flown without a stop. The answer comes from [`Planning::go_on`].
    pub fn extend(
        &mut self,
        in_the_way: InTheWay<'_>,
        course: &mut Course,
        within: Region,
        motion: &Motion,
        map: &ClearanceMap,
    ) {
        let needs_more = course.following.as_ref().is_some_and(Following::needs_more);
        if let Some(waypoint) = course.waypoint.as_mut().filter(|_| needs_more && !self.is_under_way()) {
            self.extends = true;
            self.prepare(in_the_way, waypoint, within, motion, map);
        }
    }

    fn prepare(
        &mut self,
        InTheWay { is_stuck, minimum, neighbours, movers }: InTheWay<'_>,
        waypoint: &mut Waypoint,
        within: Region,
        motion: &Motion,
        map: &ClearanceMap,
    ) {
        self.within = within;
        // Outside the map, as beyond the fence, the way begins and ends where the map does.
        let inside = |place: Vector3<f64>| match map.voxels().index_of(&place) {
            Some(_) => place,
            None => map.voxels().clamp(&place),
        };
        let goal = inside(within.clamp_height(&open_goal(waypoint, map)));
        // The vehicle comes to an allowed height first.
        let start = inside(within.clamp_height(&motion.position));
        (self.goal, self.beyond) = (goal, beyond(&goal, &within.clamp_height(&waypoint.target), map));
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
        self.silent = silent(neighbours);
        let discs = standing.iter().filter(in_the_way).map(|&centre| Disc { centre, radius_m });
        let ends = [start, goal];
        let in_its_way = movers.iter().filter(|_| is_stuck);
        let in_its_way = in_its_way.filter_map(|mover| self.kept_clear_of(mover, motion, ends));
        let minimum = minimum.and_then(|centre| beside(centre, MINIMUM_M, ends));
        let discs =
            discs.chain(self.ghosts(neighbours, motion, ends)).chain(in_its_way).chain(minimum).collect();
        let potential = self.potential(&standing, movers, motion, &goal, map);
        let within = self.inside_fence(within, &goal);
        let Envelope { hull_m, margin_m, .. } = self.envelope;
        let task = Task { start, goal, potential, discs, within, hull_m, margin_m };
        self.routes.begin(waypoint.leg, task, map);
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
                let following = course.following.insert(self.following(found));
                Report::Planned { leg, length_m: following.path.length_m() }
            }
            // What is flown is still good as far as it goes.
            Err(_) if self.extends => {
                course.following.as_mut()?.end_where_searched();
                return None;
            }
            Err(error) => {
                course.following = None;
                Report::Unplannable { leg, why: format!("{error}{}", self.silent), zone: None }
            }
        })
    }

    /// The part of a region from whose sides the filter does not keep the vehicle, and the goal.
    fn inside_fence(&self, within: Region, goal: &Vector3<f64>) -> Region {
        let kept_m = self.envelope.obstacle_clearance_m();
        let Fence { min, max } = self.fence;
        let Region { min: mut low, max: mut high } = within;
        for axis in 0..2 {
            low[axis] = low[axis].max((min[axis] + kept_m).min(goal[axis]));
            high[axis] = high[axis].min((max[axis] - kept_m).max(goal[axis]));
        }
        Region { min: low, max: high }
    }

    fn following(&self, found: Found) -> Following {
        let leads_there = (found.path.end() - self.goal).norm() < SAME_PLACE_M;
        match self.beyond {
            Beyond::Nothing if leads_there => Following::new(found, self.within),
            Beyond::Waypoint(place) if leads_there => {
                Following::part_of_the_way(found, Some(place), self.within)
            }
            _ => Following::part_of_the_way(found, None, self.within),
        }
    }

    /// What makes places on the way ahead dearer: those who stand, and where everything repels also what moves, where
    /// the vehicle would meet it, and the map.
    fn potential(
        &self,
        standing: &[Vector3<f64>],
        movers: &[separation::Neighbour],
        motion: &Motion,
        goal: &Vector3<f64>,
        map: &ClearanceMap,
    ) -> Potential {
        let heading = if motion.velocity.norm() > 0.3 { motion.velocity } else { goal - motion.position };
        let influence_m = 2.0 * self.envelope.separation_m;
        let moving = movers.iter().filter(|_| self.potential.of_everything);
        let met = moving.map(|mover| {
            let meets_s = (mover.position - motion.position).norm() / self.envelope.cruise_m_s;
            mover.position + mover.velocity * meets_s.min(FORESEEN_S)
        });
        let repellers: Vec<_> = standing
            .iter()
            .copied()
            .chain(met)
            .map(|centre| PotentialObstacle { centre, influence_m })
            .collect();
        Potential::felt(&motion.position, &heading, &repellers, map, &self.potential)
    }

    /// The places that silent neighbours may come to take. The ends of the path are outside in any case: the filter
    /// leads out of a ghost.
    fn ghosts<'a>(
        &'a self,
        neighbours: &'a [Neighbour],
        motion: &'a Motion,
        ends: [Vector3<f64>; 2],
    ) -> impl Iterator<Item = Disc> + 'a {
        let silent = neighbours.iter().filter(|neighbour| neighbour.has_fallen_silent());
        silent.filter_map(move |neighbour| {
            let grown = separation::Neighbour { age_s: f64::INFINITY, ..neighbour.track };
            self.kept_clear_of(&grown, motion, ends)
        })
    }

    /// The distance that the filter keeps from somebody, as a place that no path leads through.
    fn kept_clear_of(
        &self,
        other: &separation::Neighbour,
        motion: &Motion,
        ends: [Vector3<f64>; 2],
    ) -> Option<Disc> {
        let kept_m = separation::distance_kept_m(motion.position_sigma_m(), other, &self.filter);
        beside(other.position, kept_m + GHOST_SLACK_M, ends)
    }
}

/// The neighbours around whose ghosts a path is planned, as a reason why there is none; empty if there are none.
fn silent(neighbours: &[Neighbour]) -> String {
    let silent = neighbours.iter().filter(|neighbour| neighbour.has_fallen_silent());
    let names: Vec<_> = silent.map(|neighbour| neighbour.node.to_string()).collect();
    if names.is_empty() {
        return String::new();
    }
    format!("; {} fell silent and may stand in the way", names.join(", "))
}

/// A disc that is smaller where the ends of the path would lie in it.
fn beside(centre: Vector3<f64>, radius_m: f64, ends: [Vector3<f64>; 2]) -> Option<Disc> {
    let to_ends = ends.map(|end| (end - centre).xy().norm() - GHOST_SLACK_M);
    let radius_m = to_ends.into_iter().fold(radius_m, f64::min);
    (radius_m > 0.0).then_some(Disc { centre, radius_m })
}

/// The rest of the way beyond the goal of a search for the way to a waypoint.
fn beyond(goal: &Vector3<f64>, waypoint: &Vector3<f64>, map: &ClearanceMap) -> Beyond {
    if (waypoint - goal).xy().norm() < SAME_PLACE_M {
        Beyond::Nothing
    } else if map.is_open(goal, waypoint) {
        Beyond::Waypoint(*waypoint)
    } else {
        Beyond::Closed
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
