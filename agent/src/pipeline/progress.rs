//! Progress: whether the vehicle arrives, makes way, and can go on as planned.

use std::time::Duration;

use skein_dbp::NodeName;
use skein_planning::{
    local::escape::{EscapeConfig, EscapeDetector, Verdict},
    map::ClearanceMap,
    passage::{Passage, PassageConfig, first_passage},
};

use super::{allowed::Allowed, berth::Berth, course::Course, headroom::Headroom};
use crate::{
    bthreads::OPERATOR_LEG, config::Envelope, neighbours::Neighbour, positioning::Motion, report::Report,
};

/// The last waypoint is reached within this distance, m.
const ARRIVAL_M: f64 = 0.35;
/// Other waypoints are reached within this distance, m.
const PASSING_M: f64 = 0.7;
/// Waypoints are reached within this difference of height, m.
const ARRIVAL_HEIGHT_M: f64 = 0.5;
/// A home that is covered is reached within this distance, m.
const COVERED_M: f64 = 1.5;
/// A passage lies behind once the vehicle is this far past it, m.
const PASSAGE_BEHIND_M: f64 = 2.5;

/// Watches the vehicle on its course.
#[derive(Debug)]
pub struct Progress {
    envelope: Envelope,
    berth: Berth,
    passages: PassageConfig,
    /// The narrow passage that was announced last.
    passage: Option<Passage>,
    escape: EscapeDetector,
}

impl Progress {
    /// Watches a vehicle of this envelope. Passages and local minima are found as configured.
    pub fn new(envelope: Envelope, passages: PassageConfig, escape: EscapeConfig) -> Self {
        let (berth, escape) = (Berth::default(), EscapeDetector::new(escape));
        Self { envelope, berth, passages, passage: None, escape }
    }

    pub fn begin_path(&mut self) {
        self.escape.begin_path();
    }

    /// The flight is over.
    pub fn forget(&mut self) {
        self.passage = None;
        self.berth.forget();
    }

    /// The share of the attraction that is left: 1, and less while a local minimum is escaped from.
    pub fn attraction(&self) -> f64 {
        self.escape.attraction()
    }

    /// Looks along the path, once in each navigation cycle; `has_leave` tells whether there is leave to move
    /// now.
    pub fn look_ahead(
        &mut self,
        (now, has_leave): (Duration, bool),
        course: &mut Course,
        (allowed, headroom): (&Allowed, Headroom),
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Vec<Report> {
        let mut reports = Vec::new();
        reports.extend(self.berth.look(now, course, &motion.position, &self.envelope, neighbours));
        reports.extend(self.check_arrival(course, (allowed, headroom), motion, neighbours));
        reports.extend(check_path(course, allowed, motion, map));
        reports.extend(self.check_passage(course, motion, map));
        reports.extend(self.check_progress(has_leave.then_some(now), course, motion));
        reports
    }

    fn check_arrival(
        &self,
        course: &mut Course,
        (allowed, headroom): (&Allowed, Headroom),
        motion: &Motion,
        neighbours: &[Neighbour],
    ) -> Vec<Report> {
        let Some(waypoint) = course.waypoint.filter(|_| !course.has_arrived) else { return Vec::new() };
        // A place that is too high or too low to be flown to is reached over or under it.
        let offset = allowed.region.clamp_height(&waypoint.target) - motion.position;
        let separation_m = self.envelope.separation_m;
        let holder = neighbours.iter().find(|neighbour| {
            neighbour.armed && (neighbour.position() - waypoint.target).norm() < separation_m
        });
        // Who has landed where this one is to, or stays where it comes home, is not waited for.
        let is_down = |node: &NodeName| neighbours.iter().any(|other| other.node == *node && !other.armed);
        let lands_beside = course.taken_by.as_ref().is_some_and(|by| waypoint.is_home || is_down(by));
        let within_m = match (waypoint.lands, holder) {
            (true, _) if lands_beside => f64::INFINITY,
            (true, _) => ARRIVAL_M,
            (false, None) => PASSING_M,
            // A place in the air that another vehicle has is passed at a distance, not fought over.
            (false, Some(_)) => 2.0 * separation_m,
        };
        // Above or under what covers its home it is as near to it as it can come: where it lands, is seen then.
        let is_covered = waypoint.is_home && headroom.ends_before(offset.z);
        let arrives = offset.xy().norm() < within_m && (offset.z.abs() < ARRIVAL_HEIGHT_M || lands_beside)
            || is_covered && offset.xy().norm() < COVERED_M;
        if !arrives {
            return Vec::new();
        }
        course.has_arrived = true;
        let leg = waypoint.leg;
        let is_beside = leg == OPERATOR_LEG && offset.xy().norm() > PASSING_M;
        let beside =
            holder.filter(|_| is_beside).map(|other| Report::PlaceTaken { leg, by: other.node.clone() });
        beside.into_iter().chain([Report::Arrived { leg }]).collect()
    }

    fn check_passage(&mut self, course: &Course, motion: &Motion, map: &ClearanceMap) -> Option<Report> {
        if let Some(passage) = self.passage {
            let offset = motion.position - passage.centre;
            let is_past = offset.dot(&passage.direction) > PASSAGE_BEHIND_M;
            let turned_away = offset.norm() > PASSAGE_BEHIND_M && !course.leads_through(&passage);
            if is_past || turned_away || offset.norm() > self.passages.look_m + PASSAGE_BEHIND_M {
                self.passage = None;
                return Some(Report::PassageLeft);
            }
            return None;
        }
        let following = course.following.as_ref()?;
        let passage = first_passage(map, &following.path, following.station_m, &self.passages)?;
        self.passage = Some(passage);
        Some(Report::Passage(passage.centre))
    }

    fn check_progress(
        &mut self,
        moves_at: Option<Duration>,
        course: &Course,
        motion: &Motion,
    ) -> Option<Report> {
        if course.waypoint.is_none() || course.has_arrived {
            self.escape.reset();
            return None;
        }
        let (now, following) = moves_at.zip(course.following.as_ref())?;
        let verdict = self.escape.update(now, following.station_m, &motion.position);
        (verdict == Verdict::Stuck).then_some(Report::Stuck)
    }
}

fn check_path(course: &mut Course, allowed: &Allowed, motion: &Motion, map: &ClearanceMap) -> Option<Report> {
    let following = course.following.as_mut().filter(|following| !following.is_blocked)?;
    following.is_blocked = !following.can_be_flown(&motion.position, &allowed.region, map);
    following.is_blocked.then_some(Report::PathBlocked)
}
