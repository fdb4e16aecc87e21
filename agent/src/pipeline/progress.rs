//! Progress: whether the vehicle arrives, makes way, and can go on as planned.

use std::time::Duration;

use nalgebra::Vector3;
use skein_planning::{
    local::escape::{EscapeConfig, EscapeDetector, Forces, Verdict},
    map::ClearanceMap,
    passage::{Passage, PassageConfig, first_passage},
    separation,
};

use super::{allowed::Allowed, course::Course, headroom::Headroom, patience::Patience};
use crate::{neighbours::Neighbour, positioning::Motion, report::Report};

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

/// A local minimum is so far ahead of a vehicle that is held up by it, m.
const MINIMUM_AHEAD_M: f64 = 1.0;

/// What the vehicle feels on its way.
#[derive(Clone, Copy, Debug)]
pub struct Felt<'a> {
    pub forces: Forces,
    /// What moves and tells nobody.
    pub movers: &'a [separation::Neighbour],
}

/// Watches the vehicle on its course.
#[derive(Debug)]
pub struct Progress {
    /// Centre-to-centre distance that is kept between vehicles, m.
    separation_m: f64,
    passages: PassageConfig,
    /// The narrow passage that was announced last.
    passage: Option<Passage>,
    escape: EscapeDetector,
    /// The local minimum that the last path led into.
    minimum: Option<Vector3<f64>>,
    patience: Patience,
}

impl Progress {
    /// Watches a vehicle that keeps so far from others, m. Passages and local minima are found as configured.
    pub fn new(separation_m: f64, passages: PassageConfig, escape: EscapeConfig) -> Self {
        Self {
            separation_m,
            passages,
            passage: None,
            escape: EscapeDetector::new(escape),
            minimum: None,
            patience: Patience::new(separation_m),
        }
    }

    pub fn begin_path(&mut self) {
        self.escape.begin_path();
    }

    /// The flight is over.
    pub fn forget(&mut self) {
        self.passage = None;
        self.minimum = None;
        self.patience.forget();
    }

    /// The local minimum that the last path led into, m ENU, told once.
    pub fn take_minimum(&mut self) -> Option<Vector3<f64>> {
        self.minimum.take()
    }

    /// Whether the vehicle waits for something that moves to leave its way.
    pub fn waits(&self) -> bool {
        self.patience.waits()
    }

    /// The share of the attraction that is left: 1, and less while a local minimum is escaped from.
    pub fn attraction(&self) -> f64 {
        self.escape.attraction()
    }

    /// Looks along the path, once in each navigation cycle; `moves_at` is the time, if there is leave to move now.
    pub fn look_ahead(
        &mut self,
        moves_at: Option<Duration>,
        course: &mut Course,
        (allowed, headroom): (&Allowed, Headroom),
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
        felt: Felt<'_>,
    ) -> Vec<Report> {
        let mut reports = Vec::new();
        reports.extend(self.check_arrival(course, (allowed, headroom), motion, neighbours));
        reports.extend(check_path(course, allowed, motion, map));
        reports.extend(self.check_passage(course, motion, map));
        reports.extend(self.check_progress(moves_at, course, motion, felt));
        reports
    }

    fn check_arrival(
        &self,
        course: &mut Course,
        (allowed, headroom): (&Allowed, Headroom),
        motion: &Motion,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let waypoint = course.waypoint?;
        // A place that is too high or too low to be flown to is reached over or under it.
        let offset = allowed.region.clamp_height(&waypoint.target) - motion.position;
        let is_taken = neighbours.iter().any(|neighbour| {
            neighbour.armed && (neighbour.position() - waypoint.target).norm() < self.separation_m
        });
        let within_m = match (waypoint.lands, is_taken) {
            (true, _) => ARRIVAL_M,
            (false, false) => PASSING_M,
            // A place in the air that another vehicle has is passed at a distance, not fought over.
            (false, true) => 2.0 * self.separation_m,
        };
        // Above or under what covers its home it is as near to it as it can come: where it lands, is seen then.
        let is_covered = waypoint.is_home && headroom.ends_before(offset.z);
        let arrives = offset.xy().norm() < within_m && offset.z.abs() < ARRIVAL_HEIGHT_M
            || is_covered && offset.xy().norm() < COVERED_M;
        (arrives && !std::mem::replace(&mut course.has_arrived, true))
            .then_some(Report::Arrived { leg: waypoint.leg })
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
        felt: Felt<'_>,
    ) -> Option<Report> {
        if course.waypoint.is_none() || course.has_arrived {
            self.escape.reset();
            self.patience.forget();
            return None;
        }
        let (now, following) = moves_at.zip(course.following.as_ref())?;
        if let Some(is_over) = self.patience.wait(now, following, motion, felt.movers) {
            return is_over.then_some(Report::Stuck);
        }
        let verdict = self.escape.update(now, following.station_m, &motion.position, felt.forces);
        if verdict == Verdict::Trapped {
            let ahead = felt.forces.pull.try_normalize(1e-6).unwrap_or_else(Vector3::zeros);
            self.minimum = Some(motion.position + ahead * MINIMUM_AHEAD_M);
        }
        matches!(verdict, Verdict::Stuck | Verdict::Trapped).then_some(Report::Stuck)
    }
}

fn check_path(course: &mut Course, allowed: &Allowed, motion: &Motion, map: &ClearanceMap) -> Option<Report> {
    let following = course.following.as_mut().filter(|following| !following.is_blocked)?;
    following.is_blocked = !following.can_be_flown(&motion.position, &allowed.region, map);
    following.is_blocked.then_some(Report::PathBlocked)
}
