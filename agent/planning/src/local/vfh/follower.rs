//! Follows a path by the vector field histogram.

use nalgebra::Vector3;

use super::{Vfh, VfhConfig, bearing, direction, wrapped};
use crate::local::apf::{ApfConfig, carrot};
use crate::local::speed::{self, SpeedConfig, run_up, speed_to_stop, trapezoid, unhindered_speed};
use crate::map::{ClearanceMap, Sectors};
use crate::path::Path;

/// Slower than this the vehicle has no heading of its own, m/s.
const AT_REST_M_S: f64 = 0.3;

/// The path ahead is looked at so far, metres: as far as it takes to slow down from any speed that is flown among
/// obstacles.
const PREVIEW_M: f64 = 8.0;
/// Between two places on the path that are looked at, metres.
const PREVIEW_STEP_M: f64 = 0.5;
/// The straight way ahead of a velocity is looked at so far, metres.
const STRAIGHT_M: f64 = 3.0;
/// Between two bearings of a turn that are looked along, radians.
const SWEEP_STEP: f64 = 0.15;

/// The velocity to fly now, and the place on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Velocity wanted (ENU, m/s).
    pub velocity: Vector3<f64>,
    /// The point of the path that it leads to (ENU, metres).
    pub carrot: Vector3<f64>,
    /// The vehicle's place along the path, metres.
    pub station_m: f64,
    /// The part of the velocity that pulls along the path, without what repels (ENU, m/s).
    pub pull: Vector3<f64>,
}

/// The histogram, the speed planner, and the set-point that they last made.
#[derive(Clone, Debug)]
pub struct Follower {
    vfh: Vfh,
    speed: SpeedConfig,
    aim: ApfConfig,
    /// The nearest returns of the newest scan, in each direction (ENU, metres).
    obstacles: Vec<Vector3<f64>>,
    /// The last set-point, which the next one is near to (ENU, m/s).
    set_point: Vector3<f64>,
    /// The way since the vehicle stood, on however many paths, metres.
    flown_m: f64,
    /// Where that was counted last.
    counted_at: Option<Vector3<f64>>,
}

impl Follower {
    /// A follower at rest that has seen nothing.
    pub fn new(vfh: VfhConfig, speed: SpeedConfig) -> Follower {
        let aim = ApfConfig { look_ahead_m: 3.0, ..ApfConfig::default() };
        Follower {
            vfh: Vfh::new(vfh),
            speed,
            aim,
            obstacles: Vec::new(),
            set_point: Vector3::zeros(),
            flown_m: 0.0,
            counted_at: None,
        }
    }

    /// Takes in the returns of a scan; see [`Histogram::of`](super::Histogram::of).
    pub fn look(&mut self, origin: &Vector3<f64>, points: &[Vector3<f64>], rays: usize) {
        self.vfh.look(origin, points, rays);
        let mut nearest = Sectors::new(*origin);
        points.iter().for_each(|point| nearest.add(*point));
        self.obstacles = nearest.points().collect();
    }

    /// The velocity that follows `path` from about `station_m` (where the last call was), no faster than `cap_m_s`.
    ///
    /// It leads through the opening that is best for reaching the path ahead, at the speed that the phase of the leg,
    /// the scene and the cap allow. Without an opening it is zero.
    pub fn follow(
        &mut self,
        path: &Path,
        station_m: f64,
        position: &Vector3<f64>,
        cap_m_s: f64,
        map: &ClearanceMap,
    ) -> Step {
        let reach_m = 2.0 * self.aim.look_ahead_m;
        let station_m = path.project_within(position, station_m - reach_m, station_m + reach_m).station_m;
        let carrot = carrot(map, path, station_m, position, &self.aim);
        let offset = carrot - position;
        self.count(position);
        let phase_m_s = trapezoid(self.flown_m, path.length_m() - station_m, &self.speed);
        let speed_m_s = cap_m_s.min(phase_m_s.max(self.speed.start_share * cap_m_s));
        let speed_m_s = speed_m_s.min(self.speed_ahead(path, station_m));
        let share = offset.try_normalize(1e-6).unwrap_or_default();
        let level = self.level(&offset, speed_m_s * share.xy().norm(), position);
        let velocity = Vector3::new(level.x, level.y, speed_m_s * share.z);
        Step { velocity, carrot, station_m, pull: velocity }
    }

    /// Counts the way flown: a new path is no new start.
    fn count(&mut self, position: &Vector3<f64>) {
        let before = self.counted_at.replace(*position).unwrap_or(*position);
        self.flown_m += (position - before).norm();
    }

    /// The speed from which every place of the path ahead is reached, gently, as slowly as it has to be flown through.
    fn speed_ahead(&self, path: &Path, station_m: f64) -> f64 {
        let at = |way_m: f64| (path.point_at(station_m + way_m), path.direction_at(station_m + way_m));
        self.previewed(PREVIEW_M.min(path.length_m() - station_m), at)
    }

    /// The same straight on from `position`, where besides one stops before what stands in the way.
    fn speed_straight(&self, position: &Vector3<f64>, bearing: f64) -> f64 {
        let ahead = direction(bearing);
        let passing = self.previewed(STRAIGHT_M, |way_m| (position + ahead * way_m, ahead));
        let corridor_m = self.speed.corridor_m.min(self.vfh.kept_m());
        let to_stop = SpeedConfig { corridor_m, ..self.speed };
        passing.min(speed_to_stop(position, &ahead, &self.obstacles, &to_stop))
    }

    /// The speed from which each place is flown through as slowly as it has to be, over the next `way_m`.
    fn previewed(&self, way_m: f64, at: impl Fn(f64) -> (Vector3<f64>, Vector3<f64>)) -> f64 {
        let places = (way_m / PREVIEW_STEP_M).floor().max(0.0) as u32;
        let allowed = |step: u32| {
            let way_m = f64::from(step) * PREVIEW_STEP_M;
            let (place, ahead) = at(way_m);
            run_up(unhindered_speed(&place, &ahead, &self.obstacles, &self.speed), way_m, &self.speed)
        };
        (0..=places).map(allowed).fold(f64::INFINITY, f64::min)
    }

    /// The horizontal part, of at most `speed_m_s`.
    fn level(&mut self, offset: &Vector3<f64>, speed_m_s: f64, position: &Vector3<f64>) -> Vector3<f64> {
        let heading = (self.set_point.xy().norm() > AT_REST_M_S).then(|| bearing(&self.set_point));
        let Some(chosen) = self.vfh.steer(bearing(offset), heading) else { return Vector3::zeros() };
        // A turn takes its way: what it sweeps over is not yet behind.
        let turn = wrapped(chosen - heading.unwrap_or(chosen));
        let steps = (turn.abs() / SWEEP_STEP).ceil().max(1.0);
        let swept = (0..=steps as u32).map(|step| chosen - turn * (f64::from(step) / steps));
        let free_m_s =
            swept.map(|bearing| self.speed_straight(position, bearing)).fold(f64::INFINITY, f64::min);
        direction(chosen) * speed_m_s.min(free_m_s)
    }

    /// The set-point after `step_s`, on its way to `wanted`: never a step, but for what keeps a distance, for which see
    /// [`Follower::flew`].
    pub fn ease(&self, wanted: &Vector3<f64>, step_s: f64) -> Vector3<f64> {
        speed::step(&self.set_point, wanted, step_s, self.speed.gentle_m_s2)
    }

    /// The set-point that was sent in the end.
    pub fn flew(&mut self, set_point: &Vector3<f64>) {
        self.set_point = *set_point;
        if set_point.norm() < AT_REST_M_S {
            self.stand();
        }
    }

    fn stand(&mut self) {
        (self.flown_m, self.counted_at) = (0.0, None);
    }

    /// Somebody else moves the vehicle, or nobody.
    pub fn rest(&mut self) {
        self.vfh.rest();
        self.set_point = Vector3::zeros();
        self.stand();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local::braking::stopping_speed;
    use crate::map::VoxelMapConfig;

    /// A point mass that flies ten metres eastward past `trunks`, with what it sees of them.
    fn fly(trunks: &[(f64, f64)], radius_m: f64) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(5.0, 0.0, 5.0), 2.5).unwrap();
        let path = Path::new(vec![Vector3::new(0.0, 0.1, 3.1), Vector3::new(10.0, 0.1, 3.1)]).unwrap();
        let mut follower = Follower::new(VfhConfig::default(), SpeedConfig::default());
        let (mut position, mut station_m) = (path.start(), 0.0);
        let mut flown = Vec::new();
        for tick in 0..2000 {
            let bark = |&(x, y): &(f64, f64)| {
                (0..72).map(move |k| Vector3::new(x, y, 3.1) + direction(f64::from(k) * 0.087_266) * radius_m)
            };
            let points: Vec<_> = trunks.iter().flat_map(bark).collect();
            if tick % 5 == 0 {
                follower.look(&position, &points, 72);
            }
            let step = follower.follow(&path, station_m, &position, 2.0, &map);
            station_m = step.station_m;
            let set_point = follower.ease(&step.velocity, 0.02);
            follower.flew(&set_point);
            position += set_point * 0.02;
            flown.push((position, set_point));
        }
        flown
    }

    #[test]
    fn a_free_path_is_followed_to_its_end() {
        let flown = fly(&[], 0.3);
        assert!(flown.iter().all(|(position, _)| (position.y - 0.1).abs() < 0.05));
        assert!(flown.last().unwrap().0.x > 9.0);
    }

    #[test]
    fn an_obstacle_on_the_path_is_passed_without_a_step_of_the_set_point() {
        let flown = fly(&[(5.0, 0.2)], 0.3);
        let nearest = |(position, _): &(Vector3<f64>, Vector3<f64>)| {
            (position.xy() - nalgebra::Vector2::new(5.0, 0.2)).norm() - 0.3
        };
        let closest_m = flown.iter().map(nearest).fold(f64::INFINITY, f64::min);
        assert!(closest_m > SpeedConfig::default().clearance_m, "{closest_m}");
        assert!(flown.last().unwrap().0.x > 9.0, "{:?}", flown.last());
        for pair in flown.windows(2) {
            let change = (pair[1].1 - pair[0].1).norm();
            assert!(change <= SpeedConfig::default().gentle_m_s2 * 0.02 + 1e-9, "{change}");
        }
    }

    #[test]
    fn what_a_turn_sweeps_over_is_stopped_for() {
        let bark = (0..72).map(|k| Vector3::new(1.7, -0.6, 3.0) + direction(f64::from(k) * 0.087_266) * 0.25);
        let mut follower = Follower::new(VfhConfig::default(), SpeedConfig::default());
        let position = Vector3::new(0.0, 0.0, 3.0);
        follower.look(&position, &bark.collect::<Vec<_>>(), 72);
        // Left past the trunk, and wanted is right past it.
        follower.flew(&(direction(0.13) * 1.5));
        let wanted = follower.level(&(direction(-1.0) * 3.0), 1.5, &position);
        assert!((bearing(&wanted) + 1.0).abs() < 0.3, "{wanted:?}");
        let before_it = stopping_speed(1.8 - 0.25 - 0.45, 0.35, 0.3);
        assert!(wanted.norm() < 1.05 * before_it, "{wanted:?}");
        follower.rest();
        assert!(
            follower.level(&(direction(-1.0) * 3.0), 1.5, &position).norm() > 1.2,
            "with nothing to turn from"
        );
    }

    #[test]
    fn walled_in_it_stays() {
        let wall: Vec<_> =
            (0..40).map(|k| direction(f64::from(k) * 0.157) * 1.5).map(|p| (p.x, p.y)).collect();
        assert!(fly(&wall, 0.15).iter().all(|(position, _)| position.xy().norm() < 0.8));
    }
}
