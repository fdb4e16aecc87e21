//! One turn of a lidar as points on the level, with the directions of the surfaces they lie on.

use std::f64::consts::TAU;
use std::time::Duration;

use nalgebra::{Isometry2, Matrix2, Matrix3, SymmetricEigen, UnitQuaternion, Vector2, Vector3};

/// Returns nearer than this are the vehicle's own frame, m.
const OWN_FRAME_M: f64 = 0.2;
/// Returns lower than this above the ground are the ground, m, and lower than `GROUND_SLOPE` of their range.
const GROUND_M: f64 = 0.4;
/// Standard deviation of tilt and slope of the ground, rad.
const GROUND_SLOPE: f64 = 0.02;
/// A surface's direction is taken from returns this near, m, where they are not further apart.
const SURFACE_M: f64 = 0.25;
/// Returns on either side that tell a surface's direction, at most.
const MOST_ON_A_SIDE: usize = 6;
/// Variance of the direction of a surface that is a ray or two wide, rad²: it looks at the lidar, more or less. No
/// direction is worse known.
const LONE_RAD2: f64 = 0.05;
/// Returns nearer to one another than this are one, m.
const FINEST_M: f64 = 0.04;
/// From a ray to the next, ranges along a wall grow by up to so many times the distance between both rays.
const ALONG_A_WALL: f64 = 12.0;
/// Cosine between the directions of two returns of one surface, at least.
const ONE_SURFACE: f64 = 0.7;
/// No scan has more returns than this; of more rays every second, third ... is used.
const MOST_RETURNS: usize = 1440;

/// One turn of a scanner as the instrument tells it.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The moment to which the returns are moved: that of the prediction.
    pub stamp: Duration,
    /// A range for each ray, m; infinite, NaN or beyond the greatest where nothing came back.
    pub ranges_m: &'a [f32],
    /// Direction of the first ray, counter-clockwise from the nose, rad.
    pub angle_min: f64,
    /// From a ray to the next, rad.
    pub angle_step: f64,
    pub max_range_m: f64,
    /// When the first ray was measured, counted from `stamp`, s; negative before it.
    pub first_ray_s: f64,
    /// From a ray to the next, s; 0 when all are measured at once.
    pub ray_step_s: f64,
    /// Noise of a range, m.
    pub sigma_m: f64,
}

/// Where the vehicle is believed to be when the scan was taken, from all but the scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// World ENU, m.
    pub position: Vector3<f64>,
    pub body_to_world: UnitQuaternion<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
    /// About the body's axes, rad/s.
    pub turn_rate: Vector3<f64>,
    /// Covariance of east, north (m²) and heading (rad²).
    pub covariance: Matrix3<f64>,
    /// Height of the ground below the vehicle in the world, m.
    pub ground_m: f64,
}

impl Prediction {
    /// The pose on the level: where, and where the nose points.
    pub fn planar(&self) -> Isometry2<f64> {
        let nose = self.body_to_world * Vector3::x();
        Isometry2::new(self.position.xy(), nose.y.atan2(nose.x))
    }
}

/// A point of a surface, in the level frame of the vehicle: x to the nose, y to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// m.
    pub point: Vector2<f64>,
    /// Unit vector away from the surface, to the side of the lidar.
    pub normal: Vector2<f64>,
    /// Of the direction of `normal`, rad².
    pub normal_variance: f64,
    /// Of the point along `normal`, m².
    pub variance: f64,
}

/// The returns of one turn, moved to one moment and levelled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelScan {
    pub stamp: Duration,
    /// In the order of the rays.
    pub returns: Vec<Return>,
}

/// A ray that met something.
struct Hit {
    ray: usize,
    range_m: f64,
    point: Vector2<f64>,
}

impl LevelScan {
    /// Levels `sweep` by the attitude of `prediction` and takes the vehicle's own motion out. Returns of the ground and
    /// those for which `leave_out` holds (a point in the world, m) are not taken.
    pub fn new(
        sweep: &Sweep<'_>,
        prediction: &Prediction,
        leave_out: impl Fn(&Vector3<f64>) -> bool,
    ) -> Self {
        let hits = hits(sweep, prediction, leave_out);
        let stride = sweep.ranges_m.len().div_ceil(MOST_RETURNS).max(1);
        let step = sweep.angle_step.abs() * stride as f64;
        let rays = sweep.ranges_m.len().div_ceil(stride);
        let surfaces = Surfaces {
            hits: &hits,
            step,
            sigma_m: sweep.sigma_m.max(1e-3),
            rays: (step * (rays as f64 + 1.0) > TAU).then_some(rays),
        };
        let returns: Vec<Return> = (0..hits.len()).filter_map(|at| surfaces.at(at)).collect();
        Self { stamp: sweep.stamp, returns: gathered(&returns, FINEST_M) }
    }
}

/// Neighbours within `spacing_m` become one, their mean. None is left out: whether a return is so far from the one before
/// depends on its error, so that those that are would lean the same way all along a wall.
pub fn gathered(returns: &[Return], spacing_m: f64) -> Vec<Return> {
    let mut all: Vec<Return> = Vec::new();
    let mut from = 0;
    for to in 1..=returns.len() {
        let first = &returns[from];
        let is_one = |one: &Return| {
            (one.point - first.point).norm() < spacing_m && one.normal.dot(&first.normal) > ONE_SURFACE
        };
        if !returns.get(to).is_some_and(is_one) {
            all.push(mean(&returns[from..to]));
            from = to;
        }
    }
    all
}

fn mean(returns: &[Return]) -> Return {
    let count = returns.len() as f64;
    let sum = |of: fn(&Return) -> f64| returns.iter().map(of).sum::<f64>();
    let vector = |of: fn(&Return) -> Vector2<f64>| returns.iter().map(of).sum::<Vector2<f64>>();
    Return {
        point: vector(|one| one.point) / count,
        normal: vector(|one| one.normal).normalize(),
        // Neighbours share the returns that tell their directions.
        normal_variance: sum(|one| one.normal_variance) / count,
        variance: sum(|one| one.variance) / (count * count),
    }
}

fn hits(sweep: &Sweep<'_>, prediction: &Prediction, leave_out: impl Fn(&Vector3<f64>) -> bool) -> Vec<Hit> {
    let stride = sweep.ranges_m.len().div_ceil(MOST_RETURNS).max(1);
    let to_level = prediction.planar().rotation.inverse();
    let at_once = sweep.first_ray_s == 0.0 && sweep.ray_step_s == 0.0;
    let place = |(index, &range): (usize, &f32)| {
        let range_m = f64::from(range);
        if !(OWN_FRAME_M..sweep.max_range_m).contains(&range_m) {
            return None;
        }
        let ray = (index * stride) as f64;
        let (sin, cos) = (sweep.angle_min + ray * sweep.angle_step).sin_cos();
        let mut offset = Vector3::new(range_m * cos, range_m * sin, 0.0);
        if !at_once {
            let after_s = sweep.first_ray_s + ray * sweep.ray_step_s;
            let turned = UnitQuaternion::from_scaled_axis(prediction.turn_rate * after_s);
            offset = prediction.body_to_world * (turned * offset) + prediction.velocity * after_s;
        } else {
            offset = prediction.body_to_world * offset;
        }
        let point = prediction.position + offset;
        let ground_m = prediction.ground_m + GROUND_M + GROUND_SLOPE * range_m;
        let is_ground = offset.z < 0.0 && point.z < ground_m;
        let is_told = offset.iter().all(|value| value.is_finite()) && !is_ground && !leave_out(&point);
        is_told.then(|| Hit { ray: index, range_m, point: to_level * offset.xy() })
    };
    sweep.ranges_m.iter().step_by(stride).enumerate().filter_map(place).collect()
}

/// Tells the directions of surfaces from neighbouring rays.
struct Surfaces<'a> {
    hits: &'a [Hit],
    /// From a ray to the next, rad.
    step: f64,
    sigma_m: f64,
    /// Rays of a whole turn, where the last is neighbour to the first.
    rays: Option<usize>,
}

impl Surfaces<'_> {
    /// `None` where the direction cannot be told, as far along a wall.
    fn at(&self, at: usize) -> Option<Return> {
        let hit = &self.hits[at];
        let sides = [self.side(at, true), self.side(at, false)];
        let least = sides[0].len().min(sides[1].len());
        // As many on both sides: so the direction is true on a round surface too.
        let is_balanced = least >= 2;
        let used = if is_balanced { least } else { MOST_ON_A_SIDE };
        let near: Vec<Vector2<f64>> = sides.iter().flat_map(|side| side.iter().take(used)).copied().collect();
        let to_lidar = -hit.point.normalize();
        let (normal, normal_variance) = match near.len() >= 2 {
            true => self.direction(&hit.point, &near, &to_lidar, is_balanced),
            false if self.stands_out(at) => (to_lidar, LONE_RAD2),
            false => return None,
        };
        let facing = normal.dot(&to_lidar).powi(2).max(0.1);
        let variance = self.sigma_m.powi(2) * facing;
        let normal_variance = normal_variance.min(LONE_RAD2);
        Some(Return { point: hit.point, normal, normal_variance, variance })
    }

    /// Whether what stands beside it is far behind it on both sides, so that it is narrow, and no wall seen along it.
    fn stands_out(&self, at: usize) -> bool {
        let range_m = self.hits[at].range_m;
        let behind_m = range_m + f64::max(1.0, ALONG_A_WALL * self.step * range_m);
        [true, false].into_iter().all(|up| {
            let beyond = (0..=self.side(at, up).len()).try_fold(at, |last, _| self.neighbour(last, up));
            beyond.is_none_or(|beyond| self.hits[beyond].range_m > behind_m)
        })
    }

    /// Returns of the same surface, nearest first, up or down the rays.
    fn side(&self, at: usize, up: bool) -> Vec<Vector2<f64>> {
        let hit = &self.hits[at];
        let gap_m = 4.0 * self.step * hit.range_m + 0.05 + 3.0 * self.sigma_m;
        let reach_m = SURFACE_M.max(2.5 * self.step * hit.range_m);
        let mut side: Vec<Vector2<f64>> = Vec::with_capacity(MOST_ON_A_SIDE);
        let mut last = at;
        while side.len() < MOST_ON_A_SIDE {
            let Some(next) = self.neighbour(last, up).filter(|next| *next != at) else { break };
            let point = self.hits[next].point;
            let is_one = (point - self.hits[last].point).norm() <= gap_m;
            if !is_one || (point - hit.point).norm() > reach_m {
                break;
            }
            side.push(point);
            last = next;
        }
        side
    }

    fn neighbour(&self, at: usize, up: bool) -> Option<usize> {
        let count = self.hits.len();
        let next = match (up, self.rays) {
            (true, _) if at + 1 < count => at + 1,
            (true, Some(_)) => 0,
            (false, _) if at > 0 => at - 1,
            (false, Some(_)) => count - 1,
            _ => return None,
        };
        let (ray, other) = (self.hits[at].ray, self.hits[next].ray);
        let apart = ray.abs_diff(other);
        let apart = self.rays.map_or(apart, |rays| apart.min(rays - apart));
        (apart <= 2).then_some(next)
    }

    fn direction(
        &self,
        point: &Vector2<f64>,
        near: &[Vector2<f64>],
        to_lidar: &Vector2<f64>,
        is_balanced: bool,
    ) -> (Vector2<f64>, f64) {
        let count = near.len() as f64 + 1.0;
        let mean = near.iter().fold(*point, |sum, other| sum + other) / count;
        let spread = |point: &Vector2<f64>| (point - mean) * (point - mean).transpose();
        let scatter: Matrix2<f64> = near.iter().fold(spread(point), |sum, other| sum + spread(other));
        let eigen = SymmetricEigen::new(scatter);
        let least = usize::from(eigen.eigenvalues[1] < eigen.eigenvalues[0]);
        let normal = eigen.eigenvectors.column(least).into_owned();
        let (across, along) = (eigen.eigenvalues[least].max(0.0), eigen.eigenvalues[1 - least]);
        // What a round surface bends away turns nothing where there is as much on both sides.
        let bent = if is_balanced { 0.0 } else { across / (count - 1.0).max(1.0) };
        let noise = bent.max(self.sigma_m.powi(2));
        let variance = noise / along.max(1e-9);
        (if normal.dot(to_lidar) < 0.0 { -normal } else { normal }, variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::synthetic::{World, flat};

    #[test]
    fn returns_of_a_tilted_scanner_lie_where_the_wall_stands_and_the_ground_is_left_out() {
        // A wall 6 m ahead, to the left alone, looked at with the nose 15 degrees down from 2.5 m.
        let attitude = UnitQuaternion::from_euler_angles(0.0, 0.26, 0.0);
        let prediction = Prediction {
            position: Vector3::new(0.0, 0.0, 2.5),
            body_to_world: attitude,
            ..flat(Isometry2::identity(), 1e-4)
        };
        let step = TAU / 720.0;
        let ranges: Vec<f32> = (0..720_u32)
            .map(|ray| {
                let (sin, cos) = (f64::from(ray) * step).sin_cos();
                let direction = attitude * Vector3::new(cos, sin, 0.0);
                let wall =
                    if direction.x > 0.0 && direction.y > 0.0 { 6.0 / direction.x } else { f64::INFINITY };
                let ground = if direction.z < 0.0 { 2.5 / -direction.z } else { f64::INFINITY };
                wall.min(ground) as f32
            })
            .collect();
        let sweep = Sweep { angle_min: 0.0, ranges_m: &ranges, ..World::default().sweep(step) };
        let seen = |prediction: &Prediction| LevelScan::new(&sweep, prediction, |_| false).returns;
        let is_wall = |one: &Return| (one.point.x - 6.0).abs() < 1e-4;
        let returns = seen(&prediction);
        assert!(returns.len() > 20 && returns.iter().all(is_wall));
        assert!(
            !seen(&Prediction { ground_m: -9.0, ..prediction }).iter().all(is_wall),
            "told to be no ground"
        );
    }

    #[test]
    fn a_scan_that_takes_time_is_moved_to_one_moment() {
        // A square room, flown through at 5 m/s while turning at 1 rad/s; a turn takes 0.1 s.
        let room = World::room(10.0, 8.0);
        let step = TAU / 720.0;
        let turn_rate = Vector3::new(0.0, 0.0, 1.0);
        let prediction = Prediction {
            velocity: Vector3::new(5.0, 0.0, 0.0),
            turn_rate,
            ..flat(Isometry2::new(Vector2::new(1.0, 0.5), 0.3), 1e-4)
        };
        let ranges: Vec<f32> = (0..720_u32)
            .map(|ray| {
                let after_s = -0.1 + f64::from(ray) * 0.1 / 720.0;
                let place = Vector2::new(1.0 + 5.0 * after_s, 0.5);
                room.range(&place, 0.3 + after_s + f64::from(ray) * step) as f32
            })
            .collect();
        let sweep = Sweep {
            angle_min: 0.0,
            ranges_m: &ranges,
            first_ray_s: -0.1,
            ray_step_s: 0.1 / 720.0,
            ..room.sweep(step)
        };
        let off_m = |scan: &LevelScan| {
            let off = |one: &Return| {
                let point = prediction.planar() * nalgebra::Point2::from(one.point);
                (point.x.abs() - 5.0).abs().min((point.y.abs() - 4.0).abs())
            };
            scan.returns.iter().map(off).fold(0.0, f64::max)
        };
        assert!(off_m(&LevelScan::new(&sweep, &prediction, |_| false)) < 1e-3);
        let as_if = Prediction { velocity: Vector3::zeros(), turn_rate: Vector3::zeros(), ..prediction };
        assert!(off_m(&LevelScan::new(&sweep, &as_if, |_| false)) > 0.3, "and would be bent otherwise");
    }

    #[test]
    fn surfaces_face_the_lidar_and_tell_how_well_they_are_known() {
        let room = World::room(10.0, 8.0);
        let pose = Isometry2::identity();
        let scan = LevelScan::new(&room.scan(&pose, 1).sweep(), &flat(pose, 1e-4), |_| false);
        assert!(scan.returns.len() > 400);
        let mut beyond = 0;
        for one in &scan.returns {
            assert!(one.normal.dot(&one.point) < 0.0);
            let to_wall = one.point.abs();
            if (to_wall - Vector2::new(5.0, 4.0)).abs().min() > 0.1 || to_wall.x > 4.5 && to_wall.y > 3.5 {
                continue;
            }
            let off = one.normal.abs().min().asin();
            beyond += usize::from(off > 3.0 * one.normal_variance.sqrt());
        }
        assert!(beyond < scan.returns.len() / 50, "{beyond}");
    }

    #[test]
    fn nothing_from_an_instrument_makes_it_fall() {
        let pose = flat(Isometry2::identity(), 1e-4);
        for ranges in [&[][..], &[f32::NAN; 9], &[-1.0; 5], &[f32::INFINITY; 3], &[3.0], &[3.0, 3.0]] {
            let sweep = Sweep { ranges_m: ranges, ..World::default().sweep(0.01) };
            assert!(LevelScan::new(&sweep, &pose, |_| false).returns.len() <= ranges.len());
        }
        let many = vec![5.0; 100_000];
        let sweep = Sweep { ranges_m: &many, ..World::default().sweep(TAU / 1e5) };
        assert!(LevelScan::new(&sweep, &pose, |_| false).returns.len() <= MOST_RETURNS);
    }
}
