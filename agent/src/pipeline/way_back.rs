//! The way back: from outside the space that paths lead through, where a pilot, a station or the wind has brought the
//! vehicle, straight to it. No map reaches there: the vehicle goes slowly, at its own height to inside the fence, where
//! the lidar sees what comes, and then straight down, or up, as its range finders see it free.

use std::time::Duration;

use nalgebra::{Rotation3, Vector3};
use skein_planning::{Path, Region, map::ClearanceMap};

use super::perception::FAR_CORNER;
use crate::{config::Fence, report::Report};

/// Further outside than this, m, a vehicle goes back before anything else: no path is followed from so far away.
const LEFT_M: f64 = 2.0;
/// Less outside than this, m, it is back.
const BACK_M: f64 = 0.3;
/// The turns from the straight way at which another way in is looked for, degrees to both sides.
const TURNS_DEG: [f64; 5] = [15.0, 30.0, 45.0, 60.0, 75.0];
/// A vehicle with leave that is slower than this for so long is held up by something, m/s.
const STANDS_M_S: f64 = 0.15;
const HELD_UP_AFTER: Duration = Duration::from_secs(3);

/// The space that paths lead through: inside the fence, at the heights of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Space {
    all: Region,
    /// The same as far from its upright sides as vehicles keep.
    inner: Region,
}

impl Space {
    /// The space of this fence and map, for a vehicle that keeps so far from walls, m.
    pub fn of(fence: &Fence, map: &ClearanceMap, kept_m: f64) -> Self {
        let [low, high] = [-FAR_CORNER, FAR_CORNER].map(|corner| map.voxels().clamp(&corner).z);
        let [mut min, mut max] = [Vector3::from(fence.min), Vector3::from(fence.max)];
        (min.z, max.z) = (low, high);
        let inset = ((max - min) / 2.0).map(|half| half.clamp(0.0, kept_m)).xy().push(0.0);
        Self { all: Region { min, max }, inner: Region { min: min + inset, max: max - inset } }
    }

    /// From the space to a place outside, m; 0 inside.
    fn off(&self, place: &Vector3<f64>) -> Vector3<f64> {
        place - self.all.clamp(place)
    }

    /// Whether whoever is there goes back before anything else.
    pub fn is_left_at(&self, place: &Vector3<f64>) -> bool {
        self.off(place).norm() > LEFT_M
    }

    /// Whether whoever was outside is back.
    pub fn is_entered_at(&self, place: &Vector3<f64>) -> bool {
        self.off(place).norm() < BACK_M
    }

    /// Whether a place is beside the fence, at whatever height.
    pub fn is_beside(&self, place: &Vector3<f64>) -> bool {
        self.all.level_room_m(place) < 0.0
    }

    /// Where a vehicle is that is outside, for people.
    pub fn describe(&self, place: &Vector3<f64>) -> String {
        let off = self.off(place);
        let beside =
            (off.xy().norm() > BACK_M).then(|| format!("{:.0} m outside its fence", off.xy().norm()));
        let over = (off.z > BACK_M).then(|| format!("{:.0} m above its map", off.z));
        let under = (off.z < -BACK_M).then(|| format!("{:.0} m below its map", -off.z));
        let parts: Vec<_> = beside.into_iter().chain(over).chain(under).collect();
        if parts.is_empty() { "back inside".to_owned() } else { parts.join(" and ") }
    }

    /// The way from `place`: level to the nearest place inside the fence that is open, then straight down or up.
    pub fn way_from(&self, place: &Vector3<f64>, map: &ClearanceMap) -> Option<Path> {
        let nearest = self.inner.clamp(place);
        let is_inside = |there: &Vector3<f64>| self.inner.level_room_m(there) >= 0.0;
        let open = map.keep_out().and_then(|keep_out| keep_out.nearest_open(&nearest, is_inside));
        Self::way_to(place, open.unwrap_or(nearest))
    }

    fn way_to(place: &Vector3<f64>, end: Vector3<f64>) -> Option<Path> {
        Path::new(vec![*place, end.xy().push(place.z), end])
    }

    /// Another way in than the straight one, at the least turn from it, that `is_free` in its direction for so many
    /// metres.
    pub fn way_around(
        &self,
        place: &Vector3<f64>,
        map: &ClearanceMap,
        is_free: impl Fn(&Vector3<f64>, f64) -> bool,
    ) -> Option<Path> {
        let straight = (self.inner.clamp(place) - place).xy().push(0.0).try_normalize(1e-6)?;
        TURNS_DEG.iter().flat_map(|turn| [*turn, -turn]).find_map(|turn: f64| {
            let ahead = Rotation3::from_axis_angle(&Vector3::z_axis(), turn.to_radians()) * straight;
            let end = place + ahead * self.entered_after_m(place, &ahead)?;
            let is_open = map.is_open(place, &end);
            let is_free = is_open && is_free(&ahead, (end - place).norm());
            is_free.then(|| Self::way_to(place, self.inner.clamp(&end))).flatten()
        })
    }

    /// After how much way in a level direction the fence is inside, m.
    fn entered_after_m(&self, place: &Vector3<f64>, ahead: &Vector3<f64>) -> Option<f64> {
        let Region { min, max } = self.inner;
        let (mut from_m, mut until_m) = (0.0_f64, f64::INFINITY);
        for axis in 0..2 {
            let sides = [min[axis], max[axis]].map(|side| side - place[axis]);
            if ahead[axis].abs() < 1e-9 {
                if sides[0] > 0.0 || sides[1] < 0.0 {
                    return None;
                }
                continue;
            }
            let [a, b] = sides.map(|side| side / ahead[axis]);
            (from_m, until_m) = (from_m.max(a.min(b)), until_m.min(a.max(b)));
        }
        (from_m <= until_m).then_some(from_m)
    }
}

/// News of a vehicle on its way back, told where they change.
#[derive(Debug, Default)]
pub struct WayBackNews {
    /// Where it goes, as was told last, and whether it is held up.
    told: Option<(Vector3<f64>, bool)>,
    stands_since: Option<Duration>,
}

impl WayBackNews {
    /// There is nothing more to tell.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Whether something is in the way back.
    pub fn is_held_up(&self) -> bool {
        self.told.is_some_and(|(_, is_held_up)| is_held_up)
    }

    /// A vehicle at `place`, of this speed, that goes back to `end`, with leave to move or without.
    pub fn look(
        &mut self,
        now: Duration,
        (place, speed_m_s): (&Vector3<f64>, f64),
        end: Vector3<f64>,
        space: &Space,
        has_leave: bool,
    ) -> Option<Report> {
        if !has_leave || speed_m_s > STANDS_M_S {
            self.stands_since = None;
        } else {
            self.stands_since.get_or_insert(now);
        }
        let stands = self.stands_since.is_some_and(|since| now >= since + HELD_UP_AFTER);
        // It goes on once it moves, not when it is told to hold.
        let is_held_up = stands || self.is_held_up() && speed_m_s <= STANDS_M_S;
        if self.told == Some((end, is_held_up)) {
            return None;
        }
        self.told = Some((end, is_held_up));
        let held_up = if is_held_up { ", held up by what is in the way" } else { "" };
        Some(Report::WayBack { to: end, why: format!("{}{held_up}", space.describe(place)) })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use skein_planning::map::VoxelMapConfig;

    use super::*;

    /// From -12 to 12 m, and 1.1 to 6.9 m high; 0.5 m are kept from its walls.
    fn space() -> (Space, ClearanceMap) {
        let config = VoxelMapConfig { size_m: [24.0, 24.0, 6.0], ..VoxelMapConfig::default() };
        let map = ClearanceMap::new(config, Vector3::new(0.0, 0.0, 4.0), 2.5).unwrap();
        let fence = Fence { min: [-12.0, -12.0, -1.0], max: [12.0, 12.0, 60.0] };
        (Space::of(&fence, &map, 0.5), map)
    }

    #[test]
    fn from_above_the_way_leads_straight_down() {
        let (space, map) = space();
        let above = Vector3::new(3.0, -4.0, 37.0);
        assert!(space.is_left_at(&above) && space.describe(&above).contains("30 m above its map"));
        let end = space.way_from(&above, &map).unwrap().end();
        assert_eq!(end.xy(), above.xy());
        assert!((6.5..7.0).contains(&end.z), "{end}");
        assert!(space.is_entered_at(&end) && !space.is_left_at(&Vector3::new(3.0, -4.0, 8.0)));
    }

    #[test]
    fn from_beside_and_above_it_leads_level_into_the_fence_first() {
        let (space, map) = space();
        let outside = Vector3::new(32.0, 0.0, 20.0);
        let way = space.way_from(&outside, &map).unwrap();
        let corners: Vec<_> = way.points().iter().map(|place| place.xy()).collect();
        assert_eq!(way.points()[1].z, 20.0);
        assert!((corners[1].x - 11.5).abs() < 1e-9 && corners[1] == corners[2], "{corners:?}");
    }

    #[test]
    fn another_way_in_is_the_one_of_least_turn_that_is_free() {
        let (space, map) = space();
        let outside = Vector3::new(22.0, 0.0, 4.0);
        let turned = |ahead: &Vector3<f64>| ahead.y.atan2(-ahead.x).abs().to_degrees();
        let way = space.way_around(&outside, &map, |ahead, _| turned(ahead) > 20.0).unwrap();
        assert!((turned(&(way.end() - outside)) - 30.0).abs() < 1e-6, "{}", way.end());
        assert_eq!(space.way_around(&outside, &map, |_, _| false), None);
    }

    #[test]
    fn it_is_told_once_where_it_goes_and_again_when_it_is_held_up() {
        let (space, _) = space();
        let mut news = WayBackNews::default();
        let (place, end) = (Vector3::new(20.0, 0.0, 4.0), Vector3::new(11.5, 0.0, 4.0));
        let mut look = |ms, speed_m_s| {
            let report = news.look(Duration::from_millis(ms), (&place, speed_m_s), end, &space, true)?;
            let Report::WayBack { why, .. } = report else { return None };
            Some(why)
        };
        assert_eq!(look(0, 1.0).as_deref(), Some("8 m outside its fence"));
        assert_eq!((look(100, 1.0), look(200, 0.0), look(3000, 0.0)), (None, None, None));
        assert!(look(3300, 0.0).unwrap().contains("held up"));
        assert_eq!(look(3400, 0.0), None);
        assert_eq!(look(3500, 1.0).as_deref(), Some("8 m outside its fence"));
    }
}
