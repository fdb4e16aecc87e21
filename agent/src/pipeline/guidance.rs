//! Guidance: a path to the waypoint, leave to follow it, and the velocity to fly now.

use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::Event;
use skein_mav::SetPoint;
use skein_planning::{
    Path,
    global::{Potential, PotentialObstacle, astar::Disc},
    local::{
        apf,
        escape::{EscapeConfig, EscapeDetector, Verdict},
    },
    map::ClearanceMap,
    passage::{Passage, PassageConfig, first_passage},
    separation::{self, FilterConfig, Outcome, RepulsionConfig, filter, repulsion},
};
use skein_wire::event::{
    self, Arrived, Declared as _, Goto, Leave, PathBlocked, PlanReason, Planned, Stuck, Unplannable,
};

use super::evasion::{Evasion, Room, Way};
use crate::{
    bthreads::HOME_LEG,
    config::{Envelope, Fence, Layer, Planners},
    me::Me,
    neighbours::Neighbour,
    pipeline::{
        local::Local,
        route_search::{ALLOWANCE, Found, RouteSearch, Task},
    },
};

/// Leave to move lasts for so long after an `advance`: a little more than two navigation cycles.
const LEAVE_LASTS: Duration = Duration::from_millis(250);
/// The last waypoint is reached within this distance, m.
const ARRIVAL_M: f64 = 0.35;
/// Other waypoints are reached within this distance, m.
const PASSING_M: f64 = 0.7;
/// A path is kept while its clearance is less by no more than this, m.
const REPLAN_SLACK_M: f64 = 0.15;
/// How far ahead the path is checked against the map, m.
const CHECK_AHEAD_M: f64 = 15.0;
/// A path further away than this is planned anew, m.
const OFF_PATH_M: f64 = 2.0;
/// A passage is announced this far ahead, m: far enough to stop well clear of it.
const PASSAGE_AHEAD_M: f64 = 5.0;
/// A passage lies behind once the vehicle is this far past it, m.
const PASSAGE_BEHIND_M: f64 = 2.5;
/// Neighbours within this distance are gone around when the vehicle is stuck, m.
const AROUND_NEIGHBOURS_M: f64 = 8.0;
/// Height differences below this are flown in planar mode, m.
const PLANAR_BAND_M: f64 = 0.4;
/// Clearance that the safety filter keeps between hull and obstacles, m: less than paths do, so that it does not fight them.
const OBSTACLE_MARGIN_M: f64 = 0.1;
/// Standard deviation of the vehicle's own position, m.
const POSITION_SIGMA_M: f64 = 0.05;
/// How far outside the ghost of a silent neighbour a path leads, m.
const GHOST_SLACK_M: f64 = 0.3;
/// A hovering vehicle that others have pushed this far does not come back, m.
const GIVES_WAY_M: f64 = 1.0;
/// From where a vehicle that is held stops to the place that it was held from, at least, m.
const ROOM_AHEAD_M: f64 = 1.5;
/// Speed at which a hovering vehicle goes back to its place, at most, m/s.
const STATION_KEEPING_M_S: f64 = 0.5;
/// Speed at which a vehicle that is to land goes to where it can, at most, m/s.
const SETTLING_M_S: f64 = 1.0;

/// Nearer than this is the same place, m.
const SAME_PLACE_M: f64 = 1e-6;
/// Walls of closed places are kept clear of from so far, m: further than any vehicle needs to stop.
const WALLS_M: f64 = 15.0;
/// A vehicle that is hemmed in leaves its height where it has this much room, m.
const EVASION_M: f64 = 1.0;

/// How the vehicle moves. World ENU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Position, m.
    pub position: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
}

/// What guidance has found out, for the b-threads.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// A path of this length exists.
    Planned {
        /// Leg of the waypoint.
        leg: i64,
        /// Length of the path, m.
        length_m: f64,
    },
    /// There is no path, and this is why.
    Unplannable {
        /// Leg of the waypoint.
        leg: i64,
        why: String,
    },
    /// The waypoint of this leg is reached.
    Arrived {
        /// Leg of the waypoint.
        leg: i64,
    },
    /// The path runs into something.
    PathBlocked,
    /// No progress in spite of leave to move.
    Stuck,
    /// A narrow passage lies ahead.
    Passage(Vector3<f64>),
    /// The passage lies behind, or the path no longer leads through it.
    PassageLeft,
}

impl Report {
    /// The report as an event of vehicle `me`.
    #[must_use]
    pub fn into_event(self, me: &Me) -> Event {
        match self {
            Self::Planned { leg, length_m } => me.event(Planned { leg, length_m }),
            Self::Unplannable { leg, why } => me.event(Unplannable { leg, why: why.into() }),
            Self::Arrived { leg } => me.event(Arrived { leg }),
            Self::PathBlocked => me.event(PathBlocked),
            Self::Stuck => me.event(Stuck),
            Self::Passage(at) => me.event(event::Passage { x: at.x, y: at.y, z: at.z }),
            Self::PassageLeft => me.event(Leave),
        }
    }
}

/// The waypoint being flown to.
#[derive(Clone, Copy, Debug)]
struct Leg {
    number: i64,
    target: Vector3<f64>,
    lands: bool,
    arrived: bool,
}

/// A path and how far along it the vehicle is.
#[derive(Clone, Debug)]
struct Following {
    path: Path,
    clearance_m: f64,
    station_m: f64,
    blocked: bool,
}

/// Follows paths with leave, hovers without.
#[derive(Debug)]
pub struct Guidance {
    envelope: Envelope,
    fence: Fence,
    planners: Planners,
    leg: Option<Leg>,
    following: Option<Following>,
    leave_until: Duration,
    /// The narrow passage that was announced last.
    passage: Option<Passage>,
    /// Where to hover while there is no leave to move.
    hover_at: Option<Vector3<f64>>,
    /// Where to go before landing.
    settles_at: Option<Vector3<f64>>,
    local: Local,
    filter: FilterConfig,
    escape: EscapeDetector,
    evasion: Evasion,
    routes: RouteSearch,
    /// What the search for a path may still do in this tick.
    allowance: usize,
}

impl Guidance {
    /// Guidance for a vehicle of this envelope inside this fence, by these planners.
    #[must_use]
    pub fn new(envelope: Envelope, fence: Fence, planners: Planners) -> Self {
        let obstacle_clearance_m = envelope.hull_m + OBSTACLE_MARGIN_M;
        Self {
            envelope,
            fence,
            planners,
            leg: None,
            following: None,
            leave_until: Duration::ZERO,
            passage: None,
            hover_at: None,
            settles_at: None,
            local: Local::new(&envelope, planners, obstacle_clearance_m),
            filter: FilterConfig {
                separation_m: envelope.separation_m,
                obstacle_clearance_m,
                max_speed_m_s: envelope.cruise_m_s,
                decel_m_s2: envelope.brake_m_s2,
                latency_s: envelope.latency_s,
                hull_radius_m: envelope.hull_m,
                ..FilterConfig::default()
            },
            escape: EscapeDetector::new(EscapeConfig::default()),
            evasion: Evasion::default(),
            routes: RouteSearch::new(planners.global),
            allowance: ALLOWANCE,
        }
    }

    /// Takes a `goto` as the waypoint to plan to.
    pub fn head_for(&mut self, goto: &Event) {
        let Some(Goto { leg, lands, x, y, z }) = Goto::read(goto) else { return };
        self.leg = Some(Leg { number: leg, target: Vector3::new(x, y, z), lands, arrived: false });
        self.following = None;
        self.routes.abandon();
    }

    /// Gives leave to move for one navigation cycle.
    pub fn grant_leave(&mut self, now: Duration) {
        self.leave_until = now + LEAVE_LASTS;
    }

    /// Where a vehicle that moves like this would come to a stop if it were told to now, metres ENU, at its height.
    #[must_use]
    pub fn stop(&self, motion: &Motion) -> Vector3<f64> {
        let unheld = motion.position + motion.velocity * self.envelope.latency_s;
        self.local.stop(&unheld, &motion.velocity).xy().push(motion.position.z)
    }

    /// Where the vehicle goes before it lands.
    #[must_use]
    pub fn settles_at(&self) -> Option<Vector3<f64>> {
        self.settles_at
    }

    /// Goes to a place to land there, metres ENU, and needs no leave for it; `None` to follow its path again.
    pub fn settle_at(&mut self, place: Option<Vector3<f64>>) {
        self.settles_at = place;
    }

    /// Somebody else moves the vehicle, or nobody: whatever place it hovered at is not its place any more.
    pub fn rest(&mut self) {
        self.hover_at = None;
        self.settles_at = None;
        self.local.rest();
    }

    /// Takes in the obstacle points of a scan of `rays` rays that was taken at `stamp` and `origin`; metres ENU.
    pub fn look(
        &mut self,
        stamp: Duration,
        origin: &Vector3<f64>,
        returns: &[Vector3<f64>],
        rays: usize,
        map: &ClearanceMap,
    ) {
        self.local.look(stamp, origin, returns, rays, map.keep_out());
    }

    /// The flight is over.
    pub fn forget(&mut self) {
        self.rest();
        self.leg = None;
        self.following = None;
        self.passage = None;
        self.routes.abandon();
    }

    /// The path ahead, from the vehicle's place on it to its end.
    pub fn path_ahead(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.following.iter().flat_map(|following| {
            let here = following.path.point_at(following.station_m);
            let mut station_m = 0.0;
            let points = following.path.points();
            let ahead = points.iter().enumerate().filter_map(move |(index, point)| {
                if let Some(before) = index.checked_sub(1).and_then(|before| points.get(before)) {
                    station_m += (point - before).norm();
                }
                (station_m > following.station_m).then_some(*point)
            });
            std::iter::once(here).chain(ahead)
        })
    }

    /// A place on the path so far ahead that a vehicle whose leave to move ends now stops well before it; none without a path.
    #[must_use]
    pub fn place_ahead(&self) -> Option<Vector3<f64>> {
        let following = self.following.as_ref()?;
        let Envelope { cruise_m_s, brake_m_s2, latency_s, .. } = self.envelope;
        let unheld_s = latency_s + LEAVE_LASTS.as_secs_f64();
        let reach_m = cruise_m_s * unheld_s + cruise_m_s.powi(2) / (2.0 * brake_m_s2) + ROOM_AHEAD_M;
        Some(following.path.point_at((following.station_m + reach_m).min(following.path.length_m())))
    }

    /// Begins to plan a path to the waypoint. If the vehicle is stuck, neighbours that stand around are
    /// then obstacles too. One that has fallen silent always is, as large as its ghost will be. The answer comes at once if
    /// this tick's allowance is enough for it, else from [`Guidance::go_on_planning`].
    pub fn plan(
        &mut self,
        why: PlanReason,
        motion: &Motion,
        map: &mut ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let Some(leg) = self.leg else {
            return Some(Report::Unplannable { leg: 0, why: "there is no waypoint".to_owned() });
        };
        let clamped = map.voxels().clamp(&leg.target);
        // Outside the map, as beyond the fence, the way begins where the map does.
        let target = self.open_goal(&leg, clamped, map);
        let is_inside = map.voxels().index_of(&motion.position).is_some();
        let start = if is_inside { motion.position } else { map.voxels().clamp(&motion.position) };
        if self.planners.without == Some(Layer::GlobalPath)
            && let Some(path) = Path::new(vec![start, target])
        {
            return Some(self.take_up(leg.number, Found { path, clearance_m: 0.0 }));
        }
        let standing: Vec<Vector3<f64>> = neighbours
            .iter()
            .filter(|neighbour| neighbour.armed && neighbour.track.cooperative)
            .filter(|neighbour| neighbour.track.velocity.norm() < 0.5)
            .map(Neighbour::position)
            .filter(|position| (position - motion.position).norm() < AROUND_NEIGHBOURS_M)
            .collect();
        let heading = if motion.velocity.norm() > 0.3 { motion.velocity } else { target - motion.position };
        let repellers: Vec<PotentialObstacle> = standing
            .iter()
            .map(|&centre| PotentialObstacle { centre, influence_m: 2.0 * self.envelope.separation_m })
            .collect();
        let potential = Potential::gated(&motion.position, &heading, &repellers, 2.0);
        let radius_m = self.envelope.separation_m;
        let in_the_way = |disc: &&Vector3<f64>| {
            why == PlanReason::Stuck
                && (*disc - target).xy().norm() > radius_m
                && (*disc - motion.position).xy().norm() > radius_m
        };
        let standing = standing.iter().filter(in_the_way).map(|&centre| Disc { centre, radius_m });
        let silent = neighbours.iter().filter(|neighbour| neighbour.armed && !neighbour.track.cooperative);
        let ghosts = silent.filter_map(|neighbour| {
            let grown = separation::Neighbour { age_s: f64::INFINITY, ..neighbour.track };
            let centre = neighbour.position();
            // The ends of the path are outside in any case: the filter leads out of a ghost.
            let ends = [start, target].map(|end| (end - centre).xy().norm() - GHOST_SLACK_M);
            let kept_m = separation::distance_kept_m(POSITION_SIGMA_M, &grown, &self.filter) + GHOST_SLACK_M;
            let radius_m = ends.into_iter().fold(kept_m, f64::min);
            (radius_m > 0.0).then_some(Disc { centre, radius_m })
        });
        let discs: Vec<Disc> = standing.chain(ghosts).collect();
        let Envelope { hull_m, margin_m, .. } = self.envelope;
        let task = Task { leg: leg.number, start, goal: target, potential, discs, hull_m, margin_m };
        self.routes.begin(task, map);
        self.search(map)
    }

    /// Where to plan to instead of a place that is closed, if that is on the way to a target beyond the map, or home: the
    /// nearest that is open; there the way home ends. Other waypoints are flown to as they are, or not at all.
    fn open_goal(&mut self, leg: &Leg, goal: Vector3<f64>, map: &ClearanceMap) -> Vector3<f64> {
        let is_target = (goal - leg.target).norm() < SAME_PLACE_M;
        let Some(keep_out) = map.keep_out().filter(|_| !is_target || leg.number == HOME_LEG) else {
            return goal;
        };
        let is_known = |place: &Vector3<f64>| {
            let voxel = map.voxels().index_of(place);
            voxel.is_some_and(|voxel| keep_out.room_m(&map.voxels().centre_of(voxel)) >= 0.0)
        };
        let open = keep_out.nearest_open(&goal, is_known).unwrap_or(goal);
        if let Some(leg) = self.leg.as_mut().filter(|_| is_target && open != goal) {
            leg.target = open;
        }
        open
    }

    /// Goes on with a plan that the ticks before were not enough for. Once in each tick, before anything else is planned.
    pub fn go_on_planning(&mut self, map: &mut ClearanceMap) -> Option<Report> {
        self.allowance = ALLOWANCE;
        self.search(map)
    }

    /// Whether a plan has been begun that has no answer yet.
    #[must_use]
    pub fn is_planning(&self) -> bool {
        self.routes.is_under_way()
    }

    fn search(&mut self, map: &mut ClearanceMap) -> Option<Report> {
        let (leg, found) = self.routes.advance(map, &mut self.allowance)?;
        Some(match found {
            Ok(found) => self.take_up(leg, found),
            Err(error) => {
                self.following = None;
                Report::Unplannable { leg, why: error.to_string() }
            }
        })
    }

    fn take_up(&mut self, leg: i64, Found { path, clearance_m }: Found) -> Report {
        let length_m = path.length_m();
        self.following = Some(Following { path, clearance_m, station_m: 0.0, blocked: false });
        self.escape.reset();
        Report::Planned { leg, length_m }
    }

    /// Looks along the path; once in each navigation cycle.
    pub fn look_ahead(
        &mut self,
        now: Duration,
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Vec<Report> {
        let mut reports = Vec::new();
        let has_leave = now <= self.leave_until;
        reports.extend(self.check_arrival(motion, neighbours));
        reports.extend(self.check_path(motion, map));
        reports.extend(self.check_passage(motion, map));
        reports.extend(self.check_progress(now, has_leave));
        reports
    }

    fn check_arrival(&mut self, motion: &Motion, neighbours: &[Neighbour]) -> Option<Report> {
        let leg = self.leg.as_mut()?;
        let offset = leg.target - motion.position;
        let room_m = 2.0 * self.envelope.separation_m;
        let is_taken = neighbours.iter().any(|neighbour| {
            neighbour.armed && (neighbour.position() - leg.target).norm() < self.envelope.separation_m
        });
        let within_m = match (leg.lands, is_taken) {
            (true, _) => ARRIVAL_M,
            (false, false) => PASSING_M,
            // A place in the air that another vehicle has is passed at a distance, not fought over.
            (false, true) => room_m,
        };
        let arrived = offset.xy().norm() < within_m && offset.z.abs() < 0.5;
        (arrived && !std::mem::replace(&mut leg.arrived, true)).then_some(Report::Arrived { leg: leg.number })
    }

    fn check_path(&mut self, motion: &Motion, map: &ClearanceMap) -> Option<Report> {
        let plans = self.planners.without != Some(Layer::GlobalPath);
        let following = self.following.as_mut().filter(|following| plans && !following.blocked)?;
        // Less than what was planned with, so that a voxel more or less does not make a new plan.
        let clearance_m = (following.clearance_m - REPLAN_SLACK_M).max(0.0);
        let here = following.path.point_at(following.station_m);
        let off_path = (here - motion.position).norm() > OFF_PATH_M;
        let end_m = (following.station_m + CHECK_AHEAD_M).min(following.path.length_m());
        let mut from = here;
        let mut station_m = following.station_m;
        let mut clear = true;
        while clear && station_m < end_m {
            station_m = (station_m + 1.0).min(end_m);
            let to = following.path.point_at(station_m);
            // The way out of a tight place counts as clear.
            clear = map.is_segment_clear(&from, &to, clearance_m.min(map.clearance(&from)));
            from = to;
        }
        following.blocked = !clear || off_path;
        following.blocked.then_some(Report::PathBlocked)
    }

    fn check_passage(&mut self, motion: &Motion, map: &ClearanceMap) -> Option<Report> {
        if self.planners.without == Some(Layer::RightOfWay) {
            return None;
        }
        if let Some(passage) = self.passage {
            let offset = motion.position - passage.centre;
            let is_past = offset.dot(&passage.direction) > PASSAGE_BEHIND_M;
            let turned_away = offset.norm() > PASSAGE_BEHIND_M && !self.leads_through(&passage);
            if is_past || turned_away || offset.norm() > PASSAGE_AHEAD_M + PASSAGE_BEHIND_M {
                self.passage = None;
                return Some(Report::PassageLeft);
            }
            return None;
        }
        let following = self.following.as_ref()?;
        let config = PassageConfig { look_m: PASSAGE_AHEAD_M, ..PassageConfig::default() };
        let passage = first_passage(map, &following.path, following.station_m, &config)?;
        self.passage = Some(passage);
        Some(Report::Passage(passage.centre))
    }

    /// Whether the path ahead leads through a passage, as far as there is a path.
    fn leads_through(&self, passage: &Passage) -> bool {
        self.following.as_ref().is_none_or(|following| {
            let end_m = following.path.length_m();
            following.path.project_within(&passage.centre, following.station_m, end_m).distance_m
                < passage.width_m
        })
    }

    fn check_progress(&mut self, now: Duration, has_leave: bool) -> Option<Report> {
        let waits = self.leg.is_none_or(|leg| leg.arrived) || self.planners.without == Some(Layer::Escape);
        let Some(following) = self.following.as_ref().filter(|_| has_leave && !waits) else {
            self.escape.reset();
            return None;
        };
        (self.escape.update(now, following.station_m) == Verdict::Stuck).then_some(Report::Stuck)
    }

    /// The set-point for now: along the path with leave, else at a place; kept apart from vehicles and obstacles either way.
    pub fn steer(&mut self, now: Duration, motion: &Motion, surroundings: &Surroundings<'_>) -> SetPoint {
        let wish = self
            .aside(motion)
            .or_else(|| self.along_path(now, motion, surroundings.map))
            .unwrap_or_else(|| self.keep_station(motion, surroundings.map));
        let unheard = self.local.moving(now, surroundings.map);
        let others: Vec<_> = surroundings.neighbours.iter().copied().chain(unheard).collect();
        let push = match self.planners.without {
            Some(Layer::Repulsion) => Vector3::zeros(),
            _ => repulsion(&motion.position, &wish.velocity, &others, &RepulsionConfig::default()),
        };
        let is_level = (wish.height_m - motion.position.z).abs() < PLANAR_BAND_M;
        let mut desired = apf::limited(wish.velocity + push, self.envelope.cruise_m_s);
        desired.z =
            if is_level { 0.0 } else { desired.z.clamp(-self.envelope.climb_m_s, self.envelope.climb_m_s) };
        let request = separation::Motion {
            position: motion.position,
            velocity: motion.velocity,
            sigma_m: POSITION_SIGMA_M,
            desired: self.local.ease(desired),
            planar: is_level,
        };
        let Kept { velocity, evades } = self.keep_apart(now, request, &others, surroundings);
        self.local.flew(&velocity);
        if is_level && !evades {
            SetPoint::Planar { vx: velocity.x, vy: velocity.y, z: wish.height_m, yaw: None }
        } else {
            SetPoint::Velocity { velocity, yaw: None }
        }
    }

    /// The velocity nearest to the one desired that keeps all distances, or the way out of where none does.
    fn keep_apart(
        &mut self,
        now: Duration,
        request: separation::Motion,
        others: &[separation::Neighbour],
        surroundings: &Surroundings<'_>,
    ) -> Kept {
        if self.planners.without == Some(Layer::SafetyFilter) {
            return Kept { velocity: request.desired, evades: false };
        }
        let mut obstacles: Vec<_> =
            surroundings.obstacles.iter().copied().chain(self.fence_ahead(request.position)).collect();
        let solid = obstacles.len();
        let walls = surroundings.map.keep_out().map(|keep_out| keep_out.walls(&request.position, WALLS_M));
        obstacles.extend(walls.unwrap_or_default());
        let mut filtered = filter(&request, others, &obstacles, &self.filter);
        if obstacles.len() > solid && matches!(filtered.outcome, Outcome::Infeasible { .. }) {
            // To touch somebody or something is worse than to enter a zone.
            obstacles.truncate(solid);
            filtered = filter(&request, others, &obstacles, &self.filter);
        }
        let clearance_m = self.filter.obstacle_clearance_m;
        let room = || room(request.position, surroundings.map, clearance_m);
        let Some(way) = self.evasion.decide(now, &filtered.outcome, surroundings.rank, room) else {
            return Kept { velocity: filtered.velocity, evades: false };
        };
        let mut desired = filtered.velocity;
        desired.z = way.sign() * self.envelope.climb_m_s;
        let request = separation::Motion { desired, planar: false, ..request };
        Kept { velocity: filter(&request, others, &obstacles, &self.filter).velocity, evades: true }
    }

    /// To where it will land; `None` if it is not to.
    fn aside(&mut self, motion: &Motion) -> Option<Wish> {
        let place = self.settles_at?;
        self.local.pause();
        self.hover_at = None;
        let velocity = apf::limited(place - motion.position, SETTLING_M_S);
        Some(Wish { velocity, height_m: place.z })
    }

    /// Along the path; `None` without path or leave.
    fn along_path(&mut self, now: Duration, motion: &Motion, map: &ClearanceMap) -> Option<Wish> {
        // Until there is a new path, a blocked one is not flown.
        let following =
            self.following.as_mut().filter(|following| now <= self.leave_until && !following.blocked)?;
        self.hover_at = None;
        let attraction = self.escape.attraction();
        let step = self.local.follow(&following.path, following.station_m, &motion.position, attraction, map);
        following.station_m = step.station_m;
        Some(Wish { velocity: step.velocity, height_m: step.carrot.z })
    }

    /// At the place where the vehicle came to a stop, or to where others have pushed it.
    fn keep_station(&mut self, motion: &Motion, map: &ClearanceMap) -> Wish {
        self.local.pause();
        let place = self
            .hover_at
            .filter(|place| {
                (place - motion.position).norm() < GIVES_WAY_M || leads_out(&motion.position, place, map)
            })
            .unwrap_or_else(|| {
                open_place(&self.local.stop(&motion.position, &motion.velocity), &motion.position, map)
            });
        self.hover_at = Some(place);
        let back = apf::limited(place - motion.position, STATION_KEEPING_M_S);
        Wish { velocity: back, height_m: place.z }
    }

    /// The nearest points of the fence's walls: the filter keeps clear of them as of obstacles. From outside they are open.
    fn fence_ahead(&self, position: Vector3<f64>) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let Fence { min, max } = self.fence;
        let walls =
            [0, 1].into_iter().flat_map(move |axis| [(axis, min[axis], 1.0), (axis, max[axis], -1.0)]);
        walls.filter(move |(axis, wall, inwards)| (position[*axis] - wall) * inwards > 0.0).map(
            move |(axis, wall, _)| {
                let mut point = position;
                point[axis] = wall;
                point
            },
        )
    }
}

/// Where to hover instead of at `place`, if that is closed: the nearest place that is open and to which the way is free.
fn open_place(place: &Vector3<f64>, from: &Vector3<f64>, map: &ClearanceMap) -> Vector3<f64> {
    let Some(keep_out) = map.keep_out() else { return *place };
    let is_reached = |there: &Vector3<f64>| map.is_segment_clear(from, there, 0.0);
    keep_out.nearest_open(place, is_reached).unwrap_or(*place)
}

/// Whether one place is closed and another is not.
fn leads_out(from: &Vector3<f64>, to: &Vector3<f64>, map: &ClearanceMap) -> bool {
    map.keep_out().is_some_and(|keep_out| keep_out.room_m(from) < 0.0 && keep_out.room_m(to) >= 0.0)
}

/// Whether a vehicle can leave its height, as far as the map reaches and tells.
fn room(position: Vector3<f64>, map: &ClearanceMap, clearance_m: f64) -> Room {
    let leads_free = |way: Way| {
        let there = position + Vector3::z() * (way.sign() * EVASION_M);
        map.voxels().index_of(&there).is_some()
            && map.is_segment_clear(&position, &there, clearance_m)
            && map.is_open(&position, &there)
    };
    Room { up: leads_free(Way::Up), down: leads_free(Way::Down) }
}

/// The velocity wanted before others are considered (ENU, m/s), and the height it leads to (m).
#[derive(Clone, Copy, Debug)]
struct Wish {
    velocity: Vector3<f64>,
    height_m: f64,
}

/// The velocity that is flown (ENU, m/s), and whether it leads off the height out of where no distance can be kept.
#[derive(Clone, Copy, Debug)]
struct Kept {
    velocity: Vector3<f64>,
    evades: bool,
}

/// What is around the vehicle now.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    pub map: &'a ClearanceMap,
    /// Obstacle points of the newest scan, metres ENU: more exact than the map.
    pub obstacles: &'a [Vector3<f64>],
    /// The other vehicles in the air.
    pub neighbours: &'a [separation::Neighbour],
    /// How many of them, and of those on the ground, have names that come before this vehicle's.
    pub rank: u32,
}
