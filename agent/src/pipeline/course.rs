//! The course: the waypoint that a vehicle flies to, and the path that leads there.

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::{Path, Region, map::ClearanceMap};

use super::{global::Found, way_back::Space};
use crate::instruction::Waypoint;

/// A path is kept while its clearance is less by no more than this, m.
const REPLAN_SLACK_M: f64 = 0.15;
/// The path is checked against the map this far ahead, m.
const CHECK_AHEAD_M: f64 = 15.0;
/// A path that is planned around what is closed leads through no more of its margin than this, m.
const CUTS_CORNERS_M: f64 = 0.4;
/// A path further away than this is planned anew, m.
const OFF_PATH_M: f64 = 2.0;
/// A path that does not lead to the waypoint is not planned on before the vehicle has come so far along it, m.
const LEAST_FLOWN_M: f64 = 2.0;

/// Where the vehicle flies.
#[derive(Clone, Debug, Default)]
pub struct Course {
    pub waypoint: Option<Waypoint>,
    pub has_arrived: bool,
    /// The vehicle that stays where the waypoint is, nearer than this one may come.
    pub taken_by: Option<NodeName>,
    pub following: Option<Following>,
}

/// A path and how far along it the vehicle is.
#[derive(Clone, Debug)]
pub struct Following {
    pub path: Path,
    /// The clearance to keep, m; as in [`Found::clearance_m`].
    clearance_m: Option<f64>,
    /// As [`Found::is_level`].
    is_level: bool,
    /// The region that it was planned to stay in.
    within: Region,
    pub station_m: f64,
    /// It runs into something, and is not flown any more.
    pub is_blocked: bool,
    /// The length for which it was searched, if that does not reach the waypoint, m; what follows is a guess.
    searched_m: Option<f64>,
    /// It leads straight back into this space, and is not known to the map.
    pub back_into: Option<Space>,
}

impl Course {
    /// The course to a waypoint, without a path yet.
    pub fn to(waypoint: Waypoint) -> Self {
        Self { waypoint: Some(waypoint), ..Self::default() }
    }

    /// The waypoint, if the vehicle has arrived there to land, or as near as it could.
    pub fn landing_place(&self) -> Option<Vector3<f64>> {
        let is_there = self.has_arrived || self.taken_by.is_some();
        self.waypoint.filter(|waypoint| waypoint.lands && is_there).map(|waypoint| waypoint.target)
    }
}

impl Following {
    /// A path to the waypoint from its beginning, planned to stay within a region.
    pub fn new(Found { path, clearance_m, is_level }: Found, within: Region) -> Self {
        Self {
            path,
            clearance_m,
            is_level,
            within,
            station_m: 0.0,
            is_blocked: false,
            searched_m: None,
            back_into: None,
        }
    }

    /// The way back into the space that paths lead through.
    pub fn back(path: Path, space: Space, within: Region) -> Self {
        let found = Found { path, clearance_m: None, is_level: false };
        Self { back_into: Some(space), ..Self::new(found, within) }
    }

    /// A path that ends short of the waypoint; from there it goes straight on to the place `beyond`, as far as is
    /// known.
    pub fn part_of_the_way(found: Found, beyond: Option<Vector3<f64>>, within: Region) -> Self {
        let part = Self::new(found, within);
        let searched_m = Some(part.path.length_m());
        let points = part.path.points().iter().copied().chain(beyond).collect();
        Self { path: Path::new(points).unwrap_or(part.path), searched_m, ..part }
    }

    /// Whether so much of it lies behind that it is to be planned on, before the vehicle slows down for its end.
    pub fn needs_more(&self) -> bool {
        let is_half_flown = |searched_m: f64| self.station_m >= LEAST_FLOWN_M.max(searched_m / 2.0);
        !self.is_blocked && self.searched_m.is_some_and(is_half_flown)
    }

    /// It is not planned on, and ends where it was searched for.
    pub fn end_where_searched(&mut self) {
        let Some(searched_m) = self.searched_m.take() else { return };
        let places = self.path.points().iter().zip(self.path.stations());
        let searched = places.filter(|(_, station_m)| **station_m <= searched_m).map(|(place, _)| *place);
        if let Some(path) = Path::new(searched.collect()) {
            self.path = path;
        }
    }

    /// The place so far ahead of the vehicle, or the path's end.
    pub fn place_ahead(&self, reach_m: f64) -> Vector3<f64> {
        self.path.point_at((self.station_m + reach_m).min(self.path.length_m()))
    }

    /// The path ahead, from the vehicle's place on it to its end.
    pub fn ahead(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let stations = self.path.points().iter().zip(self.path.stations());
        let ahead = stations.filter(|(_, station_m)| **station_m > self.station_m).map(|(point, _)| *point);
        std::iter::once(self.path.point_at(self.station_m)).chain(ahead)
    }

    /// Whether the path leads this near to a place within a distance ahead, m.
    pub fn leads_near(&self, place: &Vector3<f64>, near_m: f64, ahead_m: f64) -> bool {
        let until_m = (self.station_m + ahead_m).min(self.path.length_m());
        self.path.project_within(place, self.station_m, until_m).distance_m < near_m
    }

    /// Whether a vehicle at `position` that is to stay `within` a region can fly on along the path, as far as the map
    /// tells.
    pub fn can_be_flown(&self, position: &Vector3<f64>, within: &Region, map: &ClearanceMap) -> bool {
        if self.back_into.is_some() {
            return true;
        }
        if *within != self.within {
            return false;
        }
        let Some(planned_m) = self.clearance_m else { return true };
        // Less than what was planned with, so that a voxel more or less does not make a new plan.
        let clearance_m = (planned_m - REPLAN_SLACK_M).max(0.0);
        // What was searched for at the vehicle's height is looked at there.
        let height_m = within.clamp_height(position).z;
        let place_at = |station_m: f64| {
            let place = self.path.point_at(station_m);
            if self.is_level { place.xy().push(height_m) } else { place }
        };
        let here = place_at(self.station_m);
        let end_m = (self.station_m + CHECK_AHEAD_M).min(self.path.length_m());
        let (mut from, mut station_m) = (here, self.station_m);
        while station_m < end_m {
            station_m = (station_m + 1.0).min(end_m);
            let to = place_at(station_m);
            if leads_into_closed(&from, &to, map) {
                return false;
            }
            // The way out of a tight place counts as clear.
            if !map.is_segment_clear(&from, &to, clearance_m.min(map.clearance(&from))) {
                return false;
            }
            from = to;
        }
        (here - within.clamp_height(position)).norm() <= OFF_PATH_M
    }
}

/// Whether a piece of the way, a metre long, leads into what is closed, or further in: more than where a path that was
/// searched for in voxels may cut a corner.
fn leads_into_closed(from: &Vector3<f64>, to: &Vector3<f64>, map: &ClearanceMap) -> bool {
    map.keep_out().is_some_and(|keep_out| {
        let room_m = keep_out.room_m(to);
        room_m < -CUTS_CORNERS_M && room_m < keep_out.room_m(from)
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use skein_planning::map::VoxelMapConfig;

    use super::*;

    #[test]
    fn a_path_is_looked_at_where_it_was_searched_for() {
        let mut map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 6.0), 2.5).unwrap();
        // It blocks heights from 3.2 m: the way rises past that, the vehicle is lower yet.
        map.insert(&Vector3::new(5.1, 0.1, 3.9));
        let start = Vector3::new(0.1, 0.1, 3.1);
        let path = Path::new(vec![start, Vector3::new(9.1, 0.1, 3.5)]).unwrap();
        let can_be_flown = |is_level: bool| {
            let found = Found { path: path.clone(), clearance_m: Some(0.5), is_level };
            Following::new(found, Region::EVERYWHERE).can_be_flown(&start, &Region::EVERYWHERE, &map)
        };
        assert!(can_be_flown(true));
        assert!(!can_be_flown(false));
    }

    #[test]
    fn a_part_of_the_way_goes_on_straight_and_ends_early_if_nothing_more_is_found() {
        let corners = [0.0, 20.0].map(|x| Vector3::new(x, 0.0, 3.0));
        let beyond = Vector3::new(20.0, 30.0, 3.0);
        let path = Path::new(corners.to_vec()).unwrap();
        let found = Found { path, clearance_m: Some(0.5), is_level: true };
        let mut part = Following::part_of_the_way(found, Some(beyond), Region::EVERYWHERE);
        assert_eq!((part.path.end(), part.needs_more()), (beyond, false));
        part.station_m = 10.0;
        assert!(part.needs_more());
        part.end_where_searched();
        assert_eq!((part.path.end(), part.needs_more()), (corners[1], false));
    }
}
