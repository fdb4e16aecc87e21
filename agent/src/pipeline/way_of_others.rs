//! Whether the vehicle stands in the way of another where there is no room to pass.

use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::{
    Path,
    map::ClearanceMap,
    passage::{PassageConfig, is_narrow_around},
};
use skein_wire::event::Right;

use crate::{neighbours::Neighbour, positioning::Motion, rank::goes_before, report::Report};

/// A vehicle that has come no further than [`STANDING_M`] for so long stands.
const STANDS_AFTER: Duration = Duration::from_millis(1500);
const STANDING_M: f64 = 0.7;
/// Those who are to come later than this along their way need no way yet, m.
const COMING_M: f64 = 40.0;
/// Two pass one another where it is wider by so much than a narrow place, m.
const ROOM_TO_PASS_M: f64 = 0.6;
/// A narrow place so near makes it tight, m.
const NEAR_M: f64 = 1.5;
/// Cosine of the angle within which two go the same way.
const SAME_WAY_COS: f64 = 0.5;
/// Beyond the separation that is kept, a vehicle is out of the way only if it is this much further from it, m.
const CLEAR_M: f64 = 0.2;
/// Nobody is made way for longer than this, and not again for as long.
const MAKES_WAY_FOR: Duration = Duration::from_secs(30);

/// Watches the ways that the others mean to fly.
#[derive(Debug)]
pub struct WayOfOthers {
    /// Centre-to-centre distance that is kept between vehicles, m.
    separation_m: f64,
    width_m: f64,
    /// Since when the vehicle stands, and where.
    stands: Option<(Duration, Vector3<f64>)>,
    hindered: Option<Hindered>,
    /// Those who have been made way for long enough, and since when.
    done_with: Option<(NodeName, Duration)>,
}

/// A vehicle in whose way this one is.
#[derive(Clone, Debug, PartialEq)]
struct Hindered {
    who: NodeName,
    right: Right,
    /// Where this one stood in its way.
    place: Vector3<f64>,
    since: Duration,
}

impl WayOfOthers {
    /// Of a vehicle that keeps so far from others, m, where a narrow place is as configured.
    pub fn new(separation_m: f64, passages: &PassageConfig) -> Self {
        let width_m = passages.width_m + ROOM_TO_PASS_M;
        Self { separation_m, width_m, stands: None, hindered: None, done_with: None }
    }

    /// The flight is over.
    pub fn forget(&mut self) {
        (self.stands, self.hindered, self.done_with) = (None, None, None);
    }

    /// The vehicle in whose way this one is.
    pub fn hindered<'a>(&self, neighbours: &'a [Neighbour]) -> Option<&'a Neighbour> {
        let hindered = self.hindered.as_ref()?;
        neighbours.iter().find(|neighbour| neighbour.node == hindered.who)
    }

    /// Whether the vehicle has stood for long enough that something must hold it up.
    pub fn stands(&self, now: Duration) -> bool {
        self.stands.is_some_and(|(since, _)| now.saturating_sub(since) >= STANDS_AFTER)
    }

    /// From how near a way to how far the vehicle is out of it, m.
    pub fn kept_m(&self) -> f64 {
        self.separation_m + CLEAR_M
    }

    /// Looks at the ways of others; once in each navigation cycle. `ahead` is the direction of this vehicle's own way.
    pub fn look(
        &mut self,
        now: Duration,
        motion: &Motion,
        ahead: Option<Vector3<f64>>,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let position = motion.position;
        if self.stands.is_none_or(|(_, place)| (place - position).norm() > STANDING_M) {
            self.stands = Some((now, position));
        }
        if let Some(hindered) = &self.hindered {
            let is_over = now.saturating_sub(hindered.since) > MAKES_WAY_FOR;
            if is_over {
                self.done_with = Some((hindered.who.clone(), now));
            }
            if is_over || !self.still_hinders(hindered, &position, neighbours) {
                self.hindered = None;
                return Some(Report::OutOfTheWay);
            }
        }
        if !self.stands(now) {
            return None;
        }
        self.done_with.take_if(|(_, at)| now.saturating_sub(*at) > MAKES_WAY_FOR);
        let is_done_with =
            |neighbour: &Neighbour| self.done_with.as_ref().is_some_and(|(who, _)| *who == neighbour.node);
        let in_the_way = neighbours.iter().filter(|neighbour| {
            is_about(neighbour)
                && !is_done_with(neighbour)
                && self.is_in_the_way_of(neighbour, &position, ahead, map)
        });
        let first = in_the_way.reduce(|first, next| if goes_first(next, first) { next } else { first })?;
        let is_known = self.hindered.as_ref().is_some_and(|known| {
            !goes_before((first.node.as_str(), first.right), (known.who.as_str(), known.right))
        });
        if is_known {
            return None;
        }
        let (who, right) = (first.node.clone(), first.right);
        self.hindered = Some(Hindered { who: who.clone(), right, place: position, since: now });
        Some(Report::InTheWay { of: who, right })
    }

    /// Whether the other still wants to go where this vehicle is, or where it was.
    fn still_hinders(&self, hindered: &Hindered, position: &Vector3<f64>, neighbours: &[Neighbour]) -> bool {
        let Some(other) = neighbours.iter().find(|neighbour| neighbour.node == hindered.who) else {
            return false;
        };
        let goes_by = |way: &Path| {
            [position, &hindered.place].into_iter().any(|place| off_m(way, place).1 < self.kept_m())
        };
        is_about(other) && other.way.as_deref().is_some_and(goes_by)
    }

    fn is_in_the_way_of(
        &self,
        other: &Neighbour,
        position: &Vector3<f64>,
        ahead: Option<Vector3<f64>>,
        map: &ClearanceMap,
    ) -> bool {
        let Some(way) = other.way.as_deref() else { return false };
        let (station_m, distance_m) = off_m(way, position);
        if distance_m >= self.separation_m || !(0.3..COMING_M).contains(&station_m) {
            return false;
        }
        let goes_along = ahead.is_some_and(|ahead| ahead.dot(&way.direction_at(station_m)) > SAME_WAY_COS);
        !goes_along && is_narrow_around(map, way, station_m, NEAR_M, self.width_m)
    }
}

/// Whether one of two neighbours goes before the other.
pub fn goes_first(one: &Neighbour, other: &Neighbour) -> bool {
    goes_before((one.node.as_str(), one.right), (other.node.as_str(), other.right))
}

fn is_about(neighbour: &Neighbour) -> bool {
    neighbour.armed && neighbour.track.cooperative
}

/// Where along a way a place is, and how far off it, m; heights count for two thirds, as in separation.
fn off_m(way: &Path, place: &Vector3<f64>) -> (f64, f64) {
    let projected = way.project(place);
    let offset = (place - projected.point).component_mul(&Vector3::new(1.0, 1.0, 2.0 / 3.0));
    (projected.station_m, offset.norm())
}
