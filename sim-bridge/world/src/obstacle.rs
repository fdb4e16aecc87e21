//! Solid bodies that stand in a world, or move through it.

use std::f64::consts::TAU;
use std::time::Duration;

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::aabb::Aabb;
use crate::mesh::Mesh;
use crate::round;
use crate::way::Way;

/// The form of an obstacle in its own frame, metres, centred on its origin; but a mesh is where its corners
/// are.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A cuboid.
    Box {
        /// Half of the length along each axis.
        half_extents: Vector3<f64>,
    },
    /// A solid cylinder whose axis is z.
    Cylinder {
        /// Radius of the round section.
        radius: f64,
        /// Half of the length along z.
        half_height: f64,
    },
    /// A ball.
    Sphere { radius: f64 },
    /// A cylinder about z with half a ball on each end.
    Capsule {
        /// Radius of the round section and of the balls.
        radius: f64,
        /// Half of the length along z without the balls.
        half_length: f64,
    },
    /// A ball, stretched along each axis.
    Ellipsoid { radii: Vector3<f64> },
    /// A solid cone about z whose point is up, half of it above the origin.
    Cone {
        /// Radius of the round face below.
        radius: f64,
        /// Half of the length along z.
        half_height: f64,
    },
    /// Many faces.
    Mesh(Mesh),
    /// Everything below an infinite plane through the origin.
    Plane {
        /// Points out of the solid half.
        normal: Unit<Vector3<f64>>,
    },
}

impl Shape {
    /// Radius of the smallest ball about the origin that holds the shape; infinite for a plane.
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Self::Capsule { radius, half_length } => radius + half_length,
            Self::Ellipsoid { radii } => radii.max(),
            Self::Cone { radius, half_height } => radius.hypot(half_height),
            Self::Mesh(ref mesh) => mesh.bounding_radius(),
            Self::Box { half_extents } => half_extents.norm(),
            Self::Cylinder { radius, half_height } => radius.hypot(half_height),
            Self::Sphere { radius } => radius,
            Self::Plane { .. } => f64::INFINITY,
        }
    }

    /// Length of the longest straight line inside along the unit vector `direction` (own frame), metres: that
    /// through the middle, for every shape is the same on both sides of it. Infinite for a plane; of a cone
    /// that of the cylinder around it, and of a mesh that of the box.
    pub fn thickness_m(&self, direction: &Vector3<f64>) -> f64 {
        let half = match *self {
            Self::Box { half_extents } => half_extents.component_div(&direction.abs()).min(),
            Self::Capsule { radius, half_length } => half_of_capsule(radius, half_length, direction),
            Self::Mesh(ref mesh) => {
                let bounds = mesh.bounds();
                ((bounds.max - bounds.min) / 2.0).component_div(&direction.abs()).min()
            }
            Self::Ellipsoid { radii } => 1.0 / direction.component_div(&radii).norm(),
            Self::Cylinder { radius, half_height } | Self::Cone { radius, half_height } => {
                (radius / direction.xy().norm()).min(half_height / direction.z.abs())
            }
            Self::Sphere { radius } => radius,
            Self::Plane { .. } => f64::INFINITY,
        };
        2.0 * half
    }

    /// Distance from `point` (own frame) to the surface, negative inside.
    pub fn signed_distance(&self, point: &Point3<f64>) -> f64 {
        match *self {
            Self::Box { half_extents } => {
                let beyond = point.coords.abs() - half_extents;
                let outside = beyond.sup(&Vector3::zeros()).norm();
                outside + beyond.max().min(0.0)
            }
            Self::Cylinder { radius, half_height } => {
                let beyond_side = point.x.hypot(point.y) - radius;
                let beyond_cap = point.z.abs() - half_height;
                let outside = beyond_side.max(0.0).hypot(beyond_cap.max(0.0));
                outside + beyond_side.max(beyond_cap).min(0.0)
            }
            Self::Sphere { radius } => point.coords.norm() - radius,
            Self::Capsule { radius, half_length } => {
                let beyond_end = (point.z.abs() - half_length).max(0.0);
                point.x.hypot(point.y).hypot(beyond_end) - radius
            }
            Self::Ellipsoid { radii } => round::distance_to_ellipsoid(&radii, point),
            Self::Cone { radius, half_height } => round::distance_to_cone(radius, half_height, point),
            Self::Mesh(ref mesh) => mesh.signed_distance(point),
            Self::Plane { normal } => point.coords.dot(&normal),
        }
    }

    /// Distance along the unit vector `direction` from `origin` (both in the own frame) to the
    /// first point of the solid: 0 when the ray starts inside, `None` when it misses.
    pub fn cast_ray(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let inside = match *self {
            Self::Box { half_extents } => {
                let mut inside = Interval::RAY;
                for axis in 0..3 {
                    inside = inside.within_slab(origin.coords[axis], direction[axis], half_extents[axis])?;
                }
                inside
            }
            // The side first: that is what most rays miss.
            Self::Cylinder { radius, half_height } => Interval::RAY
                .within_roots(
                    direction.x * direction.x + direction.y * direction.y,
                    origin.x * direction.x + origin.y * direction.y,
                    origin.x * origin.x + origin.y * origin.y - radius * radius,
                )?
                .within_slab(origin.z, direction.z, half_height)?,
            Self::Sphere { radius } => Interval::RAY.within_roots(
                direction.norm_squared(),
                origin.coords.dot(direction),
                origin.coords.norm_squared() - radius * radius,
            )?,
            Self::Capsule { radius, half_length } => {
                return cast_ray_on_capsule(radius, half_length, origin, direction);
            }
            // Stretched to a ball of radius 1, the ray has the same parameters.
            Self::Ellipsoid { radii } => {
                let (origin, direction) =
                    (origin.coords.component_div(&radii), direction.component_div(&radii));
                Interval::RAY.within_roots(
                    direction.norm_squared(),
                    origin.dot(&direction),
                    origin.norm_squared() - 1.0,
                )?
            }
            Self::Cone { radius, half_height } => {
                return round::cast_ray_on_cone(radius, half_height, origin, direction);
            }
            Self::Mesh(ref mesh) => return mesh.cast_ray(origin, direction),
            Self::Plane { normal } => {
                Interval::RAY.below(origin.coords.dot(&normal), direction.dot(&normal))?
            }
        };
        Some(inside.from)
    }
}

/// The distance from the middle of a capsule to its surface along a unit vector, metres.
fn half_of_capsule(radius: f64, half_length: f64, direction: &Vector3<f64>) -> f64 {
    let (aside, along) = (direction.xy().norm(), direction.z.abs());
    if radius * along <= half_length * aside {
        return radius / aside;
    }
    let off_axis = half_length * aside;
    half_length * along + (radius * radius - off_axis * off_axis).max(0.0).sqrt()
}

fn cast_ray_on_capsule(
    radius: f64,
    half_length: f64,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
) -> Option<f64> {
    let side = Shape::Cylinder { radius, half_height: half_length }.cast_ray(origin, direction);
    let end = |z: f64| Shape::Sphere { radius }.cast_ray(&(origin - Vector3::z() * z), direction);
    [side, end(half_length), end(-half_length)].into_iter().flatten().reduce(f64::min)
}

/// The part of a ray that lies inside the bodies intersected so far, as distances along it.
#[derive(Clone, Copy)]
struct Interval {
    from: f64,
    to: f64,
}

impl Interval {
    const RAY: Self = Self { from: 0.0, to: f64::INFINITY };

    /// `None` when nothing is left.
    fn intersect(self, from: f64, to: f64) -> Option<Self> {
        let left = Self { from: self.from.max(from), to: self.to.min(to) };
        (left.from <= left.to).then_some(left)
    }

    /// Keeps what lies between the planes at `-half` and `+half` of one axis.
    fn within_slab(self, origin: f64, direction: f64, half: f64) -> Option<Self> {
        if direction == 0.0 {
            return (origin.abs() <= half).then_some(self);
        }
        let a = (-half - origin) / direction;
        let b = (half - origin) / direction;
        self.intersect(a.min(b), a.max(b))
    }

    /// Keeps where `a t^2 + 2 b t + c <= 0`, of which `a` is not negative.
    fn within_roots(self, a: f64, b: f64, c: f64) -> Option<Self> {
        if a == 0.0 {
            return (c <= 0.0).then_some(self);
        }
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        self.intersect((-b - root) / a, (-b + root) / a)
    }

    /// Keeps where a height that begins as `height` and rises by `slope` is not above 0.
    fn below(self, height: f64, slope: f64) -> Option<Self> {
        if slope == 0.0 {
            return (height <= 0.0).then_some(self);
        }
        let crossing = -height / slope;
        if slope < 0.0 {
            self.intersect(crossing, f64::INFINITY)
        } else {
            self.intersect(f64::NEG_INFINITY, crossing)
        }
    }
}

/// A solid body in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// Its name in the world file; for messages, not unique.
    pub name: String,
    /// Its form in its own frame.
    pub shape: Shape,
    /// Own frame to world ENU, metres; of one that moves, where it is now.
    pub pose: Isometry3<f64>,
    /// Share of light that it sends back, 0 (black) to 1 (white): how far a lidar sees it.
    pub reflectivity: f64,
    /// The way of one that moves, without turning; `None` of one that stands.
    pub way: Option<Way>,
}

impl Obstacle {
    /// A white obstacle that stands.
    pub fn new(name: impl Into<String>, shape: Shape, pose: Isometry3<f64>) -> Self {
        Self { name: name.into(), shape, pose, reflectivity: 1.0, way: None }
    }

    /// An upright cylinder that stands on the ground (z = 0) at `(x, y)`: a tree trunk, a pole.
    pub fn trunk(name: impl Into<String>, x: f64, y: f64, radius: f64, height: f64) -> Self {
        let shape = Shape::Cylinder { radius, half_height: height / 2.0 };
        Self::new(name, shape, Isometry3::translation(x, y, height / 2.0))
    }

    /// A box with edges along the world axes, by its centre and whole size.
    pub fn block(name: impl Into<String>, centre: Vector3<f64>, size: Vector3<f64>) -> Self {
        let shape = Shape::Box { half_extents: size / 2.0 };
        Self::new(name, shape, Isometry3::translation(centre.x, centre.y, centre.z))
    }

    /// The same on its way, as it is at the beginning of a run.
    #[must_use]
    pub fn on(mut self, way: Way) -> Self {
        self.pose.translation.vector = way.at(Duration::ZERO);
        Self { way: Some(way), ..self }
    }

    /// Moves it to where it is so long after the run began.
    pub(crate) fn move_on(&mut self, now: Duration) {
        if let Some(way) = &self.way {
            self.pose.translation.vector = way.at(now);
        }
    }

    /// Distance from `point` (world) to the surface, negative inside.
    pub fn signed_distance(&self, point: &Point3<f64>) -> f64 {
        self.shape.signed_distance(&self.pose.inverse_transform_point(point))
    }

    /// Distance along the unit vector `direction` from `origin` (both world) to the solid: 0 when
    /// the ray starts inside, `None` when it misses.
    pub fn cast_ray(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        self.shape.cast_ray(
            &self.pose.inverse_transform_point(origin),
            &self.pose.inverse_transform_vector(direction),
        )
    }

    /// Height of the solid over the place of the ground above which it is highest, metres; infinite for a
    /// plane.
    pub fn thickness_m(&self) -> f64 {
        self.shape.thickness_m(&self.pose.inverse_transform_vector(&Vector3::z()))
    }

    /// Corners of the smallest box along the world axes that holds the obstacle; `None` for a
    /// plane, which has no end.
    pub fn aabb(&self) -> Option<Aabb> {
        let centre = self.pose.translation.vector;
        let rotation = self.pose.rotation.to_rotation_matrix();
        let reach: Vector3<f64> = match self.shape {
            Shape::Capsule { radius, half_length } => {
                (rotation * Vector3::z()).map(|part| half_length * part.abs() + radius)
            }
            Shape::Ellipsoid { radii } => {
                let axes = rotation.matrix() * nalgebra::Matrix3::from_diagonal(&radii);
                Vector3::from_iterator(axes.row_iter().map(|row| row.norm()))
            }
            Shape::Mesh(ref mesh) => return Some(mesh.bounds().moved(&self.pose)),
            Shape::Box { half_extents } => rotation.matrix().abs() * half_extents,
            Shape::Cylinder { radius, half_height } | Shape::Cone { radius, half_height } => {
                let axis = rotation * Vector3::z();
                axis.map(|part| half_height * part.abs() + radius * (1.0 - part * part).max(0.0).sqrt())
            }
            Shape::Sphere { radius } => Vector3::repeat(radius),
            Shape::Plane { .. } => return None,
        };
        Some(Aabb { min: centre - reach, max: centre + reach })
    }

    /// Outline of the upright projection on the ground, counter-clockwise, for maps and pictures;
    /// round shapes are drawn with 16 corners. Empty for a plane.
    pub fn footprint(&self) -> Vec<[f64; 2]> {
        let round = |along_x: f64, along_y: f64| {
            let corner = |corner: u32| {
                let (sin, cos) = (TAU * f64::from(corner) / 16.0).sin_cos();
                Vector3::new(along_x * cos, along_y * sin, 0.0)
            };
            (0..16).map(corner).collect()
        };
        let outline: Vec<Vector3<f64>> = match self.shape {
            Shape::Mesh(ref mesh) => {
                let Aabb { min, max } = mesh.bounds();
                [(max.x, max.y), (min.x, max.y), (min.x, min.y), (max.x, min.y)]
                    .map(|(x, y)| Vector3::new(x, y, 0.0))
                    .to_vec()
            }
            Shape::Box { half_extents: h } => [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
                .iter()
                .map(|(x, y)| Vector3::new(x * h.x, y * h.y, 0.0))
                .collect(),
            Shape::Cylinder { radius, .. }
            | Shape::Sphere { radius }
            | Shape::Capsule { radius, .. }
            | Shape::Cone { radius, .. } => round(radius, radius),
            Shape::Ellipsoid { radii } => round(radii.x, radii.y),
            Shape::Plane { .. } => Vec::new(),
        };
        outline
            .into_iter()
            .map(|corner| {
                let world = self.pose * Point3::from(corner);
                [world.x, world.y]
            })
            .collect()
    }
}
