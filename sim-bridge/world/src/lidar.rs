//! Planar laser scanner with range finders up and down, and a second, upright scanner.
//!
//! A scan of hundreds of rays against a hundred obstacles would be slow ray by ray. Here it goes
//! obstacle by obstacle, as a z-buffer does: the obstacle's angular span in the scan plane first,
//! then the exact test for the few rays inside of it.

use std::f64::consts::{PI, TAU};
use std::time::Duration;

use nalgebra::{Isometry3, Point3, Vector3};
use skein_wire::Scan;

use crate::noise::Noise;
use crate::obstacle::{Obstacle, Shape};
use crate::scene::{Scene, ground_range};
use crate::vehicle::LidarModel;

/// Rays on the rim of a vertical finder's cone, beside the one in its middle.
const RIM_RAYS: u32 = 8;
/// Below this cosine between an obstacle's own z axis and the scan plane's normal the obstacle's
/// outline is replaced by its bounding ball.
const LEAST_COSINE: f64 = 0.2;

/// A vehicle as other vehicles see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hull {
    /// Centre, world ENU, m.
    pub centre: Vector3<f64>,
    pub radius_m: f64,
}

/// All that a vehicle's rays can meet.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Obstacles and ground.
    pub scene: &'a Scene,
    pub hulls: &'a [Hull],
    /// Index of the vehicle that looks, which does not see itself.
    pub own: usize,
}

impl Surroundings<'_> {
    fn others(&self) -> impl Iterator<Item = &Hull> {
        let others = self.hulls.iter().enumerate();
        others.filter_map(|(index, hull)| (index != self.own).then_some(hull))
    }
}

/// Distance along the unit vector `direction` from `origin` to the first obstacle, vehicle or
/// ground within `max` metres.
pub fn cast_ray(
    surroundings: &Surroundings<'_>,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
    max: f64,
) -> Option<f64> {
    let fixed = surroundings.scene.cast_ray(origin, direction, max);
    surroundings
        .others()
        .filter_map(|hull| {
            let ball = Shape::Sphere { radius: hull.radius_m };
            ball.cast_ray(&(origin - hull.centre), direction)
        })
        .filter(|range| *range <= max)
        .chain(fixed)
        .reduce(f64::min)
}

/// The scanner of one vehicle.
#[derive(Debug, Clone)]
pub struct Lidar {
    model: LidarModel,
    level: Turn,
    upright: Turn,
    noise: Noise,
}

/// One turn of a scanner.
#[derive(Debug, Clone)]
struct Turn {
    /// Cosine and sine of each ray's angle, from -pi on.
    rays: Vec<(f64, f64)>,
    /// The first thing that each ray of the scan in work meets.
    met: Vec<Met>,
}

impl Lidar {
    /// A scanner whose noise is drawn from stream `stream` of `seed`.
    pub fn new(model: LidarModel, seed: u64, stream: u64) -> Self {
        let (level, upright) = (Turn::of(model.rays), Turn::of(model.upright_rays));
        Self { model, level, upright, noise: Noise::new(seed, stream) }
    }

    /// Turns a second.
    pub fn rate_hz(&self) -> f64 {
        self.model.rate_hz
    }

    /// Scans from a body at `pose` (body FLU to world ENU), `stamp` after the run began.
    pub fn scan(&mut self, stamp: Duration, pose: &Isometry3<f64>, surroundings: &Surroundings<'_>) -> Scan {
        self.level.trace(&ScanPlane::level(pose), &self.model, surroundings);
        self.upright.trace(&ScanPlane::upright(pose), &self.model, surroundings);
        let origin = Point3::from(pose.translation.vector);
        let up = pose.rotation * Vector3::z();
        let ranges_m = self.told(&self.level.met.clone());
        Scan {
            stamp,
            ranges_m,
            angle_min: -PI,
            angle_step: TAU / f64::from(self.model.rays),
            max_range_m: self.model.range_m,
            up_m: self.cone(&origin, &up, surroundings),
            down_m: self.cone(&origin, &-up, surroundings),
            upright_m: self.told_upright(),
        }
    }

    /// Ranges of the upright scanner, from the nose upwards.
    fn told_upright(&mut self) -> Vec<f32> {
        let mut met = self.upright.met.clone();
        met.rotate_left(self.upright.rays.len() / 2);
        self.told(&met)
    }

    /// Ranges as the instrument tells them: noisy, and none beyond its reach.
    fn told(&mut self, met: &[Met]) -> Vec<f32> {
        let (sigma, noise) = (self.model.sigma_m, &mut self.noise);
        let range = |met: &Met| match met.range_m <= met.reach_m {
            true => (met.range_m + noise.normal(sigma)).max(0.0) as f32,
            false => f32::INFINITY,
        };
        met.iter().map(range).collect()
    }

    /// Shortest range inside of the cone about the unit vector `axis`.
    fn cone(
        &mut self,
        origin: &Point3<f64>,
        axis: &Vector3<f64>,
        surroundings: &Surroundings<'_>,
    ) -> Option<f32> {
        // Any vector that is not parallel to the axis leads to two that are normal to it.
        let helper = if axis.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
        let side = axis.cross(&helper).normalize();
        let other_side = axis.cross(&side);
        let (sin_open, cos_open) = (self.model.vertical_cone_rad / 2.0).sin_cos();
        let rim = (0..RIM_RAYS).map(|ray| {
            let (sin, cos) = (TAU * f64::from(ray) / f64::from(RIM_RAYS)).sin_cos();
            axis * cos_open + (side * cos + other_side * sin) * sin_open
        });
        let shortest = std::iter::once(*axis)
            .chain(rim)
            .filter_map(|ray| cast_ray(surroundings, origin, &ray, self.model.vertical_range_m))
            .reduce(f64::min)?;
        Some((shortest + self.noise.normal(self.model.sigma_m)).max(0.0) as f32)
    }
}

impl Turn {
    fn of(rays: u32) -> Self {
        let step = TAU / f64::from(rays.max(1));
        let ray = |ray: u32| {
            let (sin, cos) = (f64::from(ray) * step - PI).sin_cos();
            (cos, sin)
        };
        Self { rays: (0..rays).map(ray).collect(), met: Vec::new() }
    }

    /// Fills in the exact ranges.
    fn trace(&mut self, plane: &ScanPlane, model: &LidarModel, surroundings: &Surroundings<'_>) {
        self.met.clear();
        if self.rays.is_empty() {
            return;
        }
        let (height, reach_m) = (plane.origin.z, model.range_m);
        self.met.extend(self.rays.iter().map(|(cos, sin)| {
            let slope = plane.forward.z * cos + plane.side.z * sin;
            Met { range_m: ground_range(height, slope).unwrap_or(f64::INFINITY), reach_m }
        }));
        for obstacle in surroundings.scene.obstacles() {
            self.trace_obstacle(plane, model, obstacle);
        }
        for hull in surroundings.others() {
            let place = Point3::from(plane.origin.coords - hull.centre);
            let ball = Shape::Sphere { radius: hull.radius_m };
            self.trace_shape(&plane.at(place), model, &ball, reach_m);
        }
    }

    fn trace_obstacle(&mut self, plane: &ScanPlane, model: &LidarModel, obstacle: &Obstacle) {
        let local = ScanPlane {
            origin: obstacle.pose.inverse_transform_point(&plane.origin),
            forward: obstacle.pose.inverse_transform_vector(&plane.forward),
            side: obstacle.pose.inverse_transform_vector(&plane.side),
        };
        self.trace_shape(&local, model, &obstacle.shape, model.range_to(obstacle.reflectivity));
    }

    /// Shortens the rays that meet `shape`, which can be seen from `reach_m`; `plane` is given in the shape's frame.
    fn trace_shape(&mut self, plane: &ScanPlane, model: &LidarModel, shape: &Shape, reach_m: f64) {
        let Some(span) = plane.span_of(shape, model.range_m) else {
            return;
        };
        for ray in span.rays(self.rays.len()) {
            let (Some(&(cos, sin)), Some(met)) = (self.rays.get(ray), self.met.get_mut(ray)) else {
                continue;
            };
            let direction = plane.forward * cos + plane.side * sin;
            let hit = shape.cast_ray(&plane.origin, &direction);
            if let Some(range_m) = hit.filter(|range_m| *range_m < met.range_m) {
                *met = Met { range_m, reach_m };
            }
        }
    }
}

/// The first thing that a ray meets.
#[derive(Debug, Clone, Copy)]
struct Met {
    range_m: f64,
    /// From so far it is seen; what stands behind it is not seen either way.
    reach_m: f64,
}

/// The plane in which the scanner turns, in the frame of whatever is looked at.
struct ScanPlane {
    origin: Point3<f64>,
    /// To the nose.
    forward: Vector3<f64>,
    /// The direction in which angles count up.
    side: Vector3<f64>,
}

impl ScanPlane {
    fn level(pose: &Isometry3<f64>) -> Self {
        Self::through_nose(pose, &Vector3::y())
    }

    fn upright(pose: &Isometry3<f64>) -> Self {
        Self::through_nose(pose, &Vector3::z())
    }

    fn through_nose(pose: &Isometry3<f64>, side: &Vector3<f64>) -> Self {
        Self {
            origin: pose.translation.vector.into(),
            forward: pose.rotation * Vector3::x(),
            side: pose.rotation * side,
        }
    }

    fn at(&self, origin: Point3<f64>) -> Self {
        Self { origin, ..*self }
    }

    /// Angles under which `shape` may be met within `reach` metres; `None` when it cannot be.
    fn span_of(&self, shape: &Shape, reach: f64) -> Option<Span> {
        match *shape {
            Shape::Plane { .. } => Some(Span::ALL),
            Shape::Sphere { radius } => self.span_of_ball(radius, reach),
            // A ray of the plane meets an upright body only where its projection along the body's
            // z axis meets the outline; the projection must not squeeze the plane to a line.
            _ if self.turn().abs() < LEAST_COSINE => self.span_of_ball(shape.bounding_radius(), reach),
            Shape::Cylinder { radius, .. } | Shape::Capsule { radius, .. } | Shape::Cone { radius, .. } => {
                self.span_of_disc(radius, reach)
            }
            Shape::Ellipsoid { radii } => self.span_of_rectangle(&radii, reach),
            Shape::Mesh(ref mesh) => self.span_of_ball(mesh.bounding_radius(), reach),
            Shape::Box { half_extents } => self.span_of_rectangle(&half_extents, reach),
        }
    }

    /// Cosine of the angle between the plane's normal and the shape's z axis: the determinant of
    /// the projection along z.
    fn turn(&self) -> f64 {
        self.forward.x * self.side.y - self.forward.y * self.side.x
    }

    /// Scan angle whose ray projects along z to the direction `(x, y)`.
    fn angle_to(&self, x: f64, y: f64) -> f64 {
        let sign = self.turn().signum();
        let along = sign * (self.side.y * x - self.side.x * y);
        let aside = sign * (self.forward.x * y - self.forward.y * x);
        aside.atan2(along)
    }

    fn span_of_ball(&self, radius: f64, reach: f64) -> Option<Span> {
        let to_centre = -self.origin.coords;
        let (along, aside) = (to_centre.dot(&self.forward), to_centre.dot(&self.side));
        let in_plane_2 = along * along + aside * aside;
        let section_2 = radius * radius - (to_centre.norm_squared() - in_plane_2);
        let limit = radius + reach;
        if section_2 < 0.0 || to_centre.norm_squared() > limit * limit {
            return None;
        }
        if in_plane_2 <= section_2 {
            return Some(Span::ALL);
        }
        let half = (section_2 / in_plane_2).sqrt().asin();
        Some(Span::about(aside.atan2(along), -half, half))
    }

    fn span_of_disc(&self, radius: f64, reach: f64) -> Option<Span> {
        let (x, y) = (-self.origin.x, -self.origin.y);
        let distance = (x * x + y * y).sqrt();
        if distance > reach + radius {
            return None;
        }
        if distance <= radius {
            return Some(Span::ALL);
        }
        let sin = radius / distance;
        let cos = (1.0 - sin * sin).sqrt();
        let tangents = [(x * cos - y * sin, y * cos + x * sin), (x * cos + y * sin, y * cos - x * sin)];
        Some(self.span_between((x, y), &tangents))
    }

    fn span_of_rectangle(&self, half: &Vector3<f64>, reach: f64) -> Option<Span> {
        let (x, y) = (-self.origin.x, -self.origin.y);
        let beyond = ((x.abs() - half.x).max(0.0), (y.abs() - half.y).max(0.0));
        if beyond.0.hypot(beyond.1) > reach {
            return None;
        }
        if beyond == (0.0, 0.0) {
            return Some(Span::ALL);
        }
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(east, north)| (x + east * half.x, y + north * half.y));
        Some(self.span_between((x, y), &corners))
    }

    /// The span of an outline seen from outside, less than half a turn, by its centre and corners.
    fn span_between(&self, centre: (f64, f64), corners: &[(f64, f64)]) -> Span {
        let middle = self.angle_to(centre.0, centre.1);
        let mut span = Span::about(middle, 0.0, 0.0);
        for &(x, y) in corners {
            let offset = wrapped(self.angle_to(x, y) - middle);
            span.from = span.from.min(offset);
            span.to = span.to.max(offset);
        }
        span
    }
}

/// A range of scan angles.
struct Span {
    middle: f64,
    from: f64,
    to: f64,
}

impl Span {
    const ALL: Self = Self::about(0.0, -PI, PI);

    /// From `middle + from` to `middle + to`, rad.
    const fn about(middle: f64, from: f64, to: f64) -> Self {
        Self { middle, from, to }
    }

    /// Indices of the rays inside, of `count` in a turn from -pi, with one to spare on each side.
    fn rays(&self, count: usize) -> impl Iterator<Item = usize> + use<> {
        let per_radian = count as f64 / TAU;
        let first = ((self.middle + self.from + PI) * per_radian).floor();
        let last = ((self.middle + self.to + PI) * per_radian).ceil();
        let start = first.rem_euclid(count as f64) as usize;
        let inside = ((last - first) as usize + 1).min(count);
        (start..start + inside).map(move |ray| ray % count)
    }
}

/// The same angle in [-pi, pi), for angles less than a turn outside of it.
fn wrapped(angle: f64) -> f64 {
    if angle >= PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}
