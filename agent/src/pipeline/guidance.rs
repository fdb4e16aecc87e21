//! Guidance: from waypoints, and leave to fly to them, to set-points.
//!
//! [`Planning`] finds a path, [`Progress`] watches how the vehicle gets on along it, [`Steering`] makes the
//! set-points. What they share is the [`Course`].

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::SetPoint;
use skein_planning::{
    Path,
    global::{RefugeRequest, astar::Disc, refuge, simplify},
    map::ClearanceMap,
};

use super::{
    allowed::Allowed,
    course::{Course, Following},
    global::Found,
    headroom::Headroom,
    layers::Layers,
    planning::{InTheWay, Planning},
    progress::{Around, Felt, Leave, Progress},
    steering::{Lead, Steering},
    surroundings::Surroundings,
    way_back::WayBackNews,
    way_of_others::{WayOfOthers, goes_first},
};
use crate::{
    config::Envelope, instruction::Waypoint, neighbours::Neighbour, positioning::Motion, report::Report,
};

/// Leave to move lasts for so long after an `advance`: a little more than two navigation cycles.
const LEAVE_LASTS: Duration = Duration::from_millis(250);
/// From where a vehicle that is held stops to the place that it was held from, at least, m.
const ROOM_AHEAD_M: f64 = 1.5;
/// Places looked at for a refuge, at most: those of a room of 40 m by 40 m.
const REFUGE_BUDGET: usize = 10_000;
/// A refuge is reached within this distance, m.
const REFUGE_REACHED_M: f64 = 0.8;
/// A refuge is not looked for again before so long.
const REFUGE_PAUSE: Duration = Duration::from_secs(1);

/// Follows paths with leave, hovers without.
#[derive(Debug)]
pub struct Guidance {
    envelope: Envelope,
    leave_until: Duration,
    /// An operator or a b-thread has told it to hover, and since then nobody to move.
    is_held: bool,
    allowed: Allowed,
    /// The speed to arrive with others at, m/s; infinite without any.
    pub arrival_m_s: f64,
    /// The room above and below, as it is seen now.
    pub headroom: Headroom,
    pub course: Course,
    pub planning: Planning,
    progress: Progress,
    way_of_others: WayOfOthers,
    /// The way to a refuge, and when it was found, while the vehicle makes way.
    aside: Option<(Following, Duration)>,
    pub steering: Steering,
    back: WayBackNews,
}

impl Guidance {
    /// Guidance for a vehicle of this envelope.
    pub fn new(envelope: Envelope, layers: Layers) -> Self {
        let Layers { fence, finder, potential, follower, repulsion, filter, escape, passages } = layers;
        Self {
            envelope,
            leave_until: Duration::ZERO,
            is_held: false,
            allowed: Allowed::ANYTHING,
            arrival_m_s: f64::INFINITY,
            headroom: Headroom::OPEN,
            course: Course::default(),
            planning: Planning::new(envelope, fence, finder, potential),
            progress: Progress::new(envelope, passages, escape),
            way_of_others: WayOfOthers::new(envelope.separation_m, &passages),
            aside: None,
            steering: Steering::new(envelope, follower, repulsion, filter),
            back: WayBackNews::default(),
        }
    }

    /// The vehicle is of this envelope from now on.
    pub fn handle(&mut self, envelope: Envelope) {
        self.envelope = envelope;
        self.steering.handle(envelope);
    }

    pub fn envelope(&self) -> &Envelope {
        &self.envelope
    }

    /// Takes a waypoint to plan to.
    pub fn head_for(&mut self, waypoint: Waypoint) {
        self.course = Course::to(waypoint);
        self.planning.abandon();
    }

    /// Gives leave to move for one navigation cycle, from when that was decided.
    pub fn grant_leave(&mut self, at: Duration) {
        self.leave_until = at + LEAVE_LASTS;
        self.is_held = false;
    }

    /// Hovers where it is, until there is leave to move.
    pub fn hold(&mut self) {
        self.is_held = true;
    }

    /// Keeps to these limits from now on.
    pub fn limit(&mut self, allowed: Allowed) {
        self.allowed = allowed;
    }

    /// The limits that count now: none on the way home, nor for a vehicle that is held.
    fn allowed(&self) -> Allowed {
        let goes_home = self.goes_home();
        match goes_home || self.is_held {
            true => Allowed::ANYTHING,
            false => Allowed { speed_m_s: self.allowed.speed_m_s.min(self.arrival_m_s), ..self.allowed },
        }
    }

    /// Whether the way leads to where a return ends.
    pub fn goes_home(&self) -> bool {
        self.course.waypoint.is_some_and(|waypoint| waypoint.is_home)
    }

    /// Whether the limits leave a place to fly.
    pub fn has_somewhere_to_fly(&self) -> bool {
        !self.allowed.nowhere
    }

    /// The height above home to take off to, where `wanted_m` is, m.
    pub fn takeoff_height_m(&self, wanted_m: f64, home_z_m: f64) -> f64 {
        self.allowed.takeoff_height_m(wanted_m, home_z_m)
    }

    fn has_leave(&self, now: Duration) -> bool {
        let allowed = self.allowed();
        now <= self.leave_until && !allowed.nowhere && allowed.speed_m_s > 0.0
    }

    /// Where a vehicle that moves like this would come to a stop if it were told to now, metres ENU, at its height.
    pub fn stop(&self, motion: &Motion) -> Vector3<f64> {
        let unheld = motion.position + motion.velocity * self.envelope.latency_s;
        self.steering.stop(&unheld, &motion.velocity).xy().push(motion.position.z)
    }

    /// The flight is over.
    pub fn forget(&mut self) {
        self.steering.rest();
        self.is_held = false;
        self.course = Course::default();
        self.progress.forget();
        self.way_of_others.forget();
        self.aside = None;
        self.back.forget();
        self.planning.abandon();
    }

    /// The way ahead: to a refuge while the vehicle makes way, else along its path; empty without one.
    pub fn way_ahead(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let aside = self.aside.as_ref().map(|(following, _)| following);
        aside.or(self.course.following.as_ref()).into_iter().flat_map(Following::ahead)
    }

    /// Leave to move leads out of the way of who was said to need it, from now on.
    pub fn make_way(
        &mut self,
        now: Duration,
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let Some(other) = self.way_of_others.hindered(neighbours) else { return Some(Report::OutOfTheWay) };
        match self.refuge_from(other, motion, map, neighbours) {
            Some(path) => {
                let clearance_m = Some(self.envelope.obstacle_clearance_m());
                let following =
                    Following::new(Found { path, clearance_m, is_level: true }, self.allowed().region);
                self.aside = Some((following, now));
                None
            }
            None => {
                self.aside = None;
                Some(Report::Cornered { by: other.node.clone() })
            }
        }
    }

    fn refuge_from(
        &self,
        other: &Neighbour,
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Path> {
        let way = other.way.as_deref()?;
        // The other comes along there, or whoever comes behind it, as far as it cannot see yet.
        let own = self.course.following.as_ref().and_then(|path| Path::new(path.ahead().collect()));
        let out = self.progress.way_out();
        let ways: Vec<&Path> = std::iter::once(way).chain(&own).chain(&out).collect();
        let of_others = || neighbours.iter().filter(|neighbour| neighbour.armed);
        let standing: Vec<_> = of_others().map(Neighbour::position).collect();
        // Nobody else in the way of the other one stays there, but who goes before it.
        let stays = |neighbour: &&Neighbour| neighbour.node == other.node || goes_first(neighbour, other);
        let radius_m = self.envelope.separation_m;
        let discs: Vec<_> = of_others()
            .filter(stays)
            .map(|neighbour| Disc { centre: neighbour.position(), radius_m })
            .collect();
        let request = RefugeRequest {
            from: motion.position,
            ways: &ways,
            keep_m: self.way_of_others.kept_m(),
            standing: &standing,
            discs: &discs,
            clearance_m: self.envelope.obstacle_clearance_m(),
            within: self.allowed().region,
            budget: REFUGE_BUDGET,
        };
        let path = refuge(map, &request)?;
        Some(simplify(map, &path, request.clearance_m))
    }

    /// Goes on with making way: no longer than another needs it, and by another way if this one is blocked, by whoever
    /// stands in it too, or ends where the other wants to go by now.
    fn keep_aside(
        &mut self,
        now: Duration,
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let ahead = self.course.following.as_ref().map(|path| path.path.direction_at(path.station_m));
        let report = self.way_of_others.look(now, motion, ahead, map, neighbours);
        if report == Some(Report::OutOfTheWay) {
            self.aside = None;
        }
        let Some((following, found_at)) = &self.aside else { return report };
        let is_held_up = self.way_of_others.stands(now)
            && (following.path.end() - motion.position).norm() > REFUGE_REACHED_M;
        let is_blocked = is_held_up || !following.can_be_flown(&motion.position, &self.allowed().region, map);
        let ends_in_the_way = || {
            let other = self.way_of_others.hindered(neighbours)?;
            let end = following.path.end();
            Some(other.way.as_deref()?.project(&end).distance_m < self.envelope.separation_m)
        };
        if now.saturating_sub(*found_at) < REFUGE_PAUSE || !(is_blocked || ends_in_the_way() == Some(true)) {
            return report;
        }
        report.or(self.make_way(now, motion, map, neighbours))
    }

    /// A place on the path so far ahead that a vehicle whose leave to move ends now stops well before it; none
    /// without a path.
    pub fn place_ahead(&self) -> Option<Vector3<f64>> {
        let following = self.course.following.as_ref()?;
        let Envelope { cruise_m_s, brake_m_s2, latency_s, .. } = self.envelope;
        let unheld_s = latency_s + LEAVE_LASTS.as_secs_f64();
        let stop_m = cruise_m_s * unheld_s + cruise_m_s.powi(2) / (2.0 * brake_m_s2);
        Some(following.place_ahead(stop_m + ROOM_AHEAD_M))
    }

    /// Begins to plan a path to the waypoint; see [`Planning::begin`].
    pub fn plan(
        &mut self,
        is_stuck: bool,
        motion: &Motion,
        map: &mut ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let within = self.allowed().region;
        let (minimum, movers) = (self.progress.take_minimum(), self.steering.movers());
        let in_the_way = InTheWay { is_stuck, minimum, neighbours, movers };
        let report = self.planning.begin(in_the_way, &mut self.course, within, motion, map);
        self.note(report)
    }

    /// Goes on with a plan that the ticks before were not enough for. Once in each tick, before anything else is
    /// planned.
    pub fn go_on_planning(&mut self, map: &mut ClearanceMap) -> Option<Report> {
        let report = self.planning.go_on(&mut self.course, map);
        self.note(report)
    }

    fn note(&mut self, report: Option<Report>) -> Option<Report> {
        if let Some(Report::Planned { .. }) = report {
            self.progress.begin_path();
        }
        report
    }

    /// Looks along the path; once in each navigation cycle.
    pub fn look_ahead(
        &mut self,
        now: Duration,
        motion: &Motion,
        map: &mut ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Vec<Report> {
        let back = self.look_back(now, motion, map, neighbours);
        let aside = self.keep_aside(now, motion, map, neighbours);
        let (has_leave, allowed, makes_way) = (self.has_leave(now), self.allowed(), self.aside.is_some());
        let leave = match (has_leave, makes_way) {
            (_, true) => Leave::ToMakeWay,
            (true, false) => Leave::ToMove,
            (false, false) => Leave::None,
        };
        let room = (&allowed, self.headroom);
        let felt = Felt { forces: self.steering.forces(), movers: self.steering.movers() };
        let around = Around { map, neighbours, felt };
        let along = self.progress.look_ahead(now, leave, &mut self.course, room, motion, &around);
        if has_leave && !makes_way {
            let movers = self.steering.movers();
            let in_the_way = InTheWay { is_stuck: false, minimum: None, neighbours, movers };
            self.planning.extend(in_the_way, &mut self.course, allowed.region, motion, map);
        }
        back.into_iter().chain(aside).chain(along).collect()
    }

    /// On the way back into the space that paths lead through: tells of it, and plans on once it is there.
    fn look_back(
        &mut self,
        now: Duration,
        motion: &Motion,
        map: &mut ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let following = self.course.following.as_ref();
        let Some((space, end)) = following.and_then(|way| Some((way.back_into?, way.path.end()))) else {
            self.back.forget();
            return None;
        };
        if space.is_entered_at(&motion.position) && !self.planning.is_under_way() {
            return self.plan(false, motion, map, neighbours);
        }
        let moves = (&motion.position, motion.velocity.norm());
        self.back.look(now, moves, end, &space, self.has_leave(now))
    }

    /// For what the vehicle waits though it has leave to move.
    pub fn waits_for(&self) -> Option<&'static str> {
        if self.back.is_held_up() {
            return Some("something to leave its way back inside");
        }
        let waits = self.progress.waits().then_some("something that moves to leave its way");
        let dawdles = self.arrival_m_s < 0.5 * self.envelope.cruise_m_s;
        waits.or(dawdles.then_some("those together with which it is to arrive"))
    }

    /// The set-point for now: along the path with leave, else at a place; kept apart from vehicles and obstacles
    /// either way.
    pub fn steer(&mut self, now: Duration, motion: &Motion, surroundings: &Surroundings<'_>) -> SetPoint {
        let (has_leave, allowed) = (self.has_leave(now), self.allowed());
        // Until there is a new path, a blocked one is not flown.
        let makes_way = self.aside.is_some();
        let aside = self.aside.as_mut().map(|(following, _)| following);
        let following = aside.or(self.course.following.as_mut()).filter(|path| has_leave && !path.is_blocked);
        let attraction = self.progress.attraction();
        // Who has entered a narrow place is not pushed out of its mouth by those who come after it.
        let repelled_by = match self.progress.is_at_passage(&motion.position) {
            true => surroundings.first,
            false => surroundings.neighbours,
        };
        let end = match (&following, self.course.waypoint) {
            (Some(following), _) if makes_way => Some(following.path.end()),
            (_, waypoint) => waypoint.map(|waypoint| waypoint.target),
        };
        let to_go_m = end.map_or(f64::INFINITY, |end| (end - motion.position).norm());
        let lead = following.map(|following| Lead { following, attraction, repelled_by, to_go_m });
        let set_point = self.steering.steer(now, motion, lead, &allowed, surroundings);
        self.headroom.keep(set_point, &motion.position)
    }
}
