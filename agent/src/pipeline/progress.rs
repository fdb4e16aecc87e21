//! Progress: whether the vehicle arrives, makes way, and can go on as planned.

use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::{
    Path,
    local::escape::{EscapeConfig, EscapeDetector, Forces, Verdict},
    map::ClearanceMap,
    passage::{PIECE_M, PassageConfig, Piece, is_narrow_around, narrow_stretch},
    separation,
};

use super::{
    allowed::Allowed,
    berth::Berth,
    course::{Course, Following},
    headroom::Headroom,
    patience::Patience,
};
use crate::{
    bthreads::OPERATOR_LEG, config::Envelope, neighbours::Neighbour, positioning::Motion, report::Report,
    stretch::Stretch,
};

/// The last waypoint is reached within this distance, m.
const ARRIVAL_M: f64 = 0.35;
/// Other waypoints are reached within this distance, m.
const PASSING_M: f64 = 0.7;
/// Waypoints are reached within this difference of height, m.
const ARRIVAL_HEIGHT_M: f64 = 0.5;
/// A home that is covered is reached within this distance, m.
const COVERED_M: f64 = 1.5;
/// A place of a narrow stretch lies behind once the vehicle is this far from it, m: who has made way for others, who
/// keep further from it, is in none.
const PASSAGE_BEHIND_M: f64 = 1.5;
/// The vehicle is in a narrow stretch if there is no more room where it is, and a place of it is so near, m, and until
/// none is as near as that. Where it is, is told where it stands, slower than so, m/s, so far from where it was.
const HERE_M: f64 = 1.0;
const GONE_M: f64 = 1.3;
const STANDS_M_S: f64 = 0.3;
const ELSEWHERE_M: f64 = 0.5;
/// A vehicle as near to a narrow place as this, m, is not kept from it by those who come after it.
const AT_PASSAGE_M: f64 = 3.0;
/// So many places more or less of a stretch are worth a word, or a new one that is as near as that, m.
const PASSAGE_CHANGES_PIECES: usize = 3;
const PASSAGE_CHANGES_M: f64 = 5.0;
/// Who comes out of a narrow stretch needs so much of the way straight on, m.
const WAY_OUT_M: f64 = 4.0;
/// A vehicle that is less than this ahead in a narrow place is waited for, m, and no longer than so.
const QUEUES_M: f64 = 3.0;
const QUEUES_FOR: Duration = Duration::from_secs(60);

/// A local minimum is so far ahead of a vehicle that is held up by it, m.
const MINIMUM_AHEAD_M: f64 = 1.0;

/// The vehicle's own measurements on its way.
#[derive(Clone, Copy, Debug)]
pub struct Felt<'a> {
    pub forces: Forces,
    /// Moving things that tell nobody.
    pub movers: &'a [separation::Neighbour],
}

/// Whether the vehicle has leave to move, and where to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leave {
    None,
    /// Along its path.
    ToMove,
    /// Out of the way of another.
    ToMakeWay,
}

/// The surroundings of the vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Around<'a> {
    pub map: &'a ClearanceMap,
    pub neighbours: &'a [Neighbour],
    pub felt: Felt<'a>,
}

/// Watches the vehicle on its course.
#[derive(Debug)]
pub struct Progress {
    envelope: Envelope,
    berth: Berth,
    passages: PassageConfig,
    /// The narrow stretch that was announced last, and where the vehicle was then, if in it.
    announced: Vec<Piece>,
    here: Option<Piece>,
    /// Since when another vehicle is in front of this one in a narrow place.
    queues_since: Option<Duration>,
    escape: EscapeDetector,
    /// The local minimum that the last path led into.
    minimum: Option<Vector3<f64>>,
    patience: Patience,
}

impl Progress {
    /// Watches a vehicle of this envelope. Passages and local minima are found as configured.
    pub fn new(envelope: Envelope, passages: PassageConfig, escape: EscapeConfig) -> Self {
        Self {
            envelope,
            berth: Berth::default(),
            passages,
            announced: Vec::new(),
            here: None,
            queues_since: None,
            escape: EscapeDetector::new(escape),
            minimum: None,
            patience: Patience::new(envelope.separation_m),
        }
    }

    pub fn begin_path(&mut self) {
        self.escape.begin_path();
    }

    /// The flight is over.
    pub fn forget(&mut self) {
        self.announced.clear();
        self.here = None;
        self.berth.forget();
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

    /// Looks along the path, once in each navigation cycle. A vehicle that makes way does not follow it.
    pub fn look_ahead(
        &mut self,
        now: Duration,
        leave: Leave,
        course: &mut Course,
        (allowed, headroom): (&Allowed, Headroom),
        motion: &Motion,
        &Around { map, neighbours, felt }: &Around<'_>,
    ) -> Vec<Report> {
        let mut reports = Vec::new();
        reports.extend(self.berth.look(now, course, &motion.position, &self.envelope, neighbours));
        reports.extend(self.check_arrival(course, (allowed, headroom), motion, neighbours));
        if leave != Leave::ToMakeWay {
            reports.extend(check_path(course, allowed, motion, map));
        }
        let following = course.following.as_ref().filter(|following| following.back_into.is_none());
        reports.extend(self.check_passage(following, leave == Leave::ToMakeWay, motion, map));
        let moves_at = Some(now).filter(|_| leave == Leave::ToMove);
        let moves_at = moves_at.filter(|now| !self.queues(*now, course, motion, map, neighbours));
        reports.extend(self.check_progress(moves_at, course, motion, felt));
        reports
    }

    /// Whether a narrow stretch is as near as others are felt.
    pub fn is_at_passage(&self, position: &Vector3<f64>) -> bool {
        self.announced.iter().any(|piece| (piece.centre - position).norm() < AT_PASSAGE_M)
    }

    /// Where whoever comes out of the narrow stretch that the vehicle is at will be, if there is one.
    pub fn way_out(&self) -> Option<Path> {
        let Piece { centre, direction } = self.announced.first()?;
        Path::new(vec![*centre, centre - direction * WAY_OUT_M])
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
        let beside = holder.filter(|_| is_beside).map(|other| Report::PlaceTaken {
            leg,
            by: other.node.clone(),
            leaves: false,
        });
        beside.into_iter().chain([Report::Arrived { leg }]).collect()
    }

    /// Announces what is narrow ahead, with what the vehicle is in; nothing of what is ahead while it makes way.
    fn check_passage(
        &mut self,
        following: Option<&Following>,
        makes_way: bool,
        motion: &Motion,
        map: &ClearanceMap,
    ) -> Option<Report> {
        let ahead = match following {
            _ if makes_way => Vec::new(),
            Some(following) => narrow_stretch(map, &following.path, following.station_m, &self.passages),
            None => return None,
        };
        let is_ahead =
            |piece: &Piece| ahead.iter().any(|other| (piece.centre - other.centre).norm() < PIECE_M);
        let off_m = |piece: &Piece| (piece.centre - motion.position).xy().norm();
        let is_behind = |piece: &&Piece| off_m(piece) < PASSAGE_BEHIND_M && !is_ahead(piece);
        let behind: Vec<_> = self.announced.iter().filter(is_behind).copied().collect();
        let pieces = [behind, ahead].concat();
        let (stretch, announced) = (Stretch::of(&pieces), Stretch::of(&self.announced));
        let is_less = self.announced.len() >= pieces.len() + PASSAGE_CHANGES_PIECES;
        let is_new = |piece: &&Piece| !Stretch::of(&[**piece]).is_part_of(&announced);
        let new: Vec<&Piece> = pieces.iter().filter(is_new).collect();
        let is_more = new.len() >= PASSAGE_CHANGES_PIECES
            || new.first().is_some_and(|piece| (piece.centre - motion.position).norm() < PASSAGE_CHANGES_M);
        let nearest = pieces.iter().min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
        let near_m = if self.here.is_some() { GONE_M } else { HERE_M };
        let is_narrow = map.clearance(&motion.position) < self.passages.width_m / 2.0;
        let here = nearest.filter(|piece| is_narrow && off_m(piece) < near_m);
        let here = here.map(|piece| Piece { centre: motion.position, ..*piece });
        let is_elsewhere = match (&self.here, &here) {
            _ if motion.velocity.norm() > STANDS_M_S => false,
            (Some(was), Some(is)) => (was.centre - is.centre).norm() > ELSEWHERE_M,
            (was, is) => was.is_some() != is.is_some(),
        };
        if !(is_less || is_more || is_elsewhere || pieces.is_empty() && !self.announced.is_empty()) {
            return None;
        }
        (self.announced, self.here) = (pieces, here);
        Some(match stretch.is_empty() {
            true => Report::PassageLeft,
            false => Report::Passage(stretch.from(here.as_ref())),
        })
    }

    /// Whether the vehicle waits for one in front of it, where there is no room to pass.
    fn queues(
        &mut self,
        now: Duration,
        course: &Course,
        motion: &Motion,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> bool {
        let is_ahead = |following: &Following| {
            let Following { path, station_m, .. } = following;
            let around = neighbours.iter().filter(|neighbour| neighbour.armed && neighbour.track.cooperative);
            let mut near = around
                .map(Neighbour::position)
                .filter(|place| (place - motion.position).norm() < QUEUES_M)
                .map(|place| path.project_within(&place, *station_m, station_m + QUEUES_M))
                .filter(|on_path| {
                    on_path.distance_m < self.envelope.separation_m && on_path.station_m > *station_m
                });
            near.any(|on_path| {
                let width_m = self.passages.width_m;
                is_narrow_around(map, path, on_path.station_m, self.envelope.separation_m, width_m)
            })
        };
        if !course.following.as_ref().is_some_and(is_ahead) {
            self.queues_since = None;
            return false;
        }
        now.saturating_sub(*self.queues_since.get_or_insert(now)) < QUEUES_FOR
    }

    fn check_progress(
        &mut self,
        moves_at: Option<Duration>,
        course: &Course,
        motion: &Motion,
        felt: Felt<'_>,
    ) -> Option<Report> {
        // What holds it up on its way back no plan leads around.
        let goes_back = course.following.as_ref().is_some_and(|following| following.back_into.is_some());
        if course.waypoint.is_none() || course.has_arrived || goes_back {
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
