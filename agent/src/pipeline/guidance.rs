//! Guidance: from waypoints, and leave to fly to them, to set-points.
//!
//! [`Planning`] finds a path, [`Progress`] watches how the vehicle gets on along it, [`Steering`] makes the
//! set-points. What they share is the [`Course`].

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::SetPoint;
use skein_planning::map::ClearanceMap;

use super::{
    allowed::Allowed,
    course::Course,
    headroom::Headroom,
    layers::Layers,
    planning::Planning,
    progress::Progress,
    steering::{Lead, Steering},
    surroundings::Surroundings,
};
use crate::{
    config::Envelope, instruction::Waypoint, neighbours::Neighbour, positioning::Motion, report::Report,
};

/// Leave to move lasts for so long after an `advance`: a little more than two navigation cycles.
const LEAVE_LASTS: Duration = Duration::from_millis(250);
/// From where a vehicle that is held stops to the place that it was held from, at least, m.
const ROOM_AHEAD_M: f64 = 1.5;

/// Follows paths with leave, hovers without.
#[derive(Debug)]
pub struct Guidance {
    envelope: Envelope,
    leave_until: Duration,
    /// An operator or a b-thread has told it to hover, and since then nobody to move.
    is_held: bool,
    allowed: Allowed,
    /// The room above and below, as it is seen now.
    pub headroom: Headroom,
    pub course: Course,
    pub planning: Planning,
    progress: Progress,
    pub steering: Steering,
}

impl Guidance {
    /// Guidance for a vehicle of this envelope.
    pub fn new(envelope: Envelope, layers: Layers) -> Self {
        let Layers { finder, follower, repulsion, filter, escape, passages } = layers;
        Self {
            envelope,
            leave_until: Duration::ZERO,
            is_held: false,
            allowed: Allowed::ANYTHING,
            headroom: Headroom::OPEN,
            course: Course::default(),
            planning: Planning::new(envelope, finder),
            progress: Progress::new(envelope, passages, escape),
            steering: Steering::new(envelope, follower, repulsion, filter),
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
        let goes_home = self.course.waypoint.is_some_and(|waypoint| waypoint.is_home);
        if goes_home || self.is_held { Allowed::ANYTHING } else { self.allowed }
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
        now <= self.leave_until && !self.allowed().nowhere
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
        self.planning.abandon();
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
        let report = self.planning.begin(is_stuck, &mut self.course, within, motion, map, neighbours);
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
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Vec<Report> {
        let (has_leave, allowed) = (self.has_leave(now), self.allowed());
        let room = (&allowed, self.headroom);
        self.progress.look_ahead((now, has_leave), &mut self.course, room, motion, map, neighbours)
    }

    /// The set-point for now: along the path with leave, else at a place; kept apart from vehicles and obstacles
    /// either way.
    pub fn steer(&mut self, now: Duration, motion: &Motion, surroundings: &Surroundings<'_>) -> SetPoint {
        let (has_leave, allowed) = (self.has_leave(now), self.allowed());
        // Until there is a new path, a blocked one is not flown.
        let following = self.course.following.as_mut().filter(|path| has_leave && !path.is_blocked);
        let attraction = self.progress.attraction();
        let lead = following.map(|following| Lead { following, attraction });
        let set_point = self.steering.steer(now, motion, lead, &allowed, surroundings);
        self.headroom.keep(set_point, &motion.position)
    }
}
