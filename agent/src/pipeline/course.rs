//! The course: the waypoint that a vehicle flies to, and the path that leads there.

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::{Path, Region, map::ClearanceMap, passage::Passage};

use super::global::Found;
use crate::instruction::Waypoint;

/// A path is kept while its clearance is less by no more than this, m.
const REPLAN_SLACK_M: f64 = 0.15;
/// The path is checked against the map this far ahead, m.
const CHECK_AHEAD_M: f64 = 15.0;
/// A path further away than this is planned anew, m.
const OFF_PATH_M: f64 = 2.0;

/// Where the vehicle flies.
#[derive(Clone, Debug, Default)]
pub struct Course {
    pub waypoint: Option<Waypoint>,
    pub has_arrived: bool,
    /// Who stays where the waypoint is, nearer than this vehicle may come.
    pub taken_by: Option<NodeName>,
    pub following: Option<Following>,
}

/// A path and how far along it the vehicle is.
#[derive(Clone, Debug)]
pub struct Following {
    pub path: Path,
    /// The clearance to keep, m; as in [`Found::clearance_m`].
    clearance_m: Option<f64>,
    /// The region that it was planned to stay in.
    within: Region,
    pub station_m: f64,
    /// It runs into something, and is not flown any more.
    pub is_blocked: bool,
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

    /// The path ahead, from the vehicle's place on it to its end; empty without one.
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

    /// Whether the path ahead leads through a passage, as far as there is a path.
    pub fn leads_through(&self, passage: &Passage) -> bool {
        self.following.as_ref().is_none_or(|following| {
            let end_m = following.path.length_m();
            following.path.project_within(&passage.centre, following.station_m, end_m).distance_m
                < passage.width_m
        })
    }
}

impl Following {
    /// A path from its beginning, planned to stay within a region.
    pub fn new(Found { path, clearance_m }: Found, within: Region) -> Self {
        Self { path, clearance_m, within, station_m: 0.0, is_blocked: false }
    }

    /// The place so far ahead of the vehicle, or the path's end.
    pub fn place_ahead(&self, reach_m: f64) -> Vector3<f64> {
        self.path.point_at((self.station_m + reach_m).min(self.path.length_m()))
    }

    /// Whether a vehicle at `position` that is to stay `within` a region can fly on along the path, as far as the map
    /// tells.
    pub fn can_be_flown(&self, position: &Vector3<f64>, within: &Region, map: &ClearanceMap) -> bool {
        if *within != self.within {
            return false;
        }
        let Some(planned_m) = self.clearance_m else { return true };
        // Less than what was planned with, so that a voxel more or less does not make a new plan.
        let clearance_m = (planned_m - REPLAN_SLACK_M).max(0.0);
        let here = self.path.point_at(self.station_m);
        let end_m = (self.station_m + CHECK_AHEAD_M).min(self.path.length_m());
        let (mut from, mut station_m) = (here, self.station_m);
        while station_m < end_m {
            station_m = (station_m + 1.0).min(end_m);
            let to = self.path.point_at(station_m);
            // The way out of a tight place counts as clear.
            if !map.is_segment_clear(&from, &to, clearance_m.min(map.clearance(&from))) {
                return false;
            }
            from = to;
        }
        (here - within.clamp_height(position)).norm() <= OFF_PATH_M
    }
}
