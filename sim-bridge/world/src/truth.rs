//! The truth about a run: collisions, separation, clearance.
//!
//! The referee measures with parry, not with the formulas behind the lidar, so that a mistake in
//! those cannot hide a collision.

use glamx::{DPose3, DVec3};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Compound, SharedShape};

use crate::aabb::Aabb;
use crate::lidar::Hull;
use crate::obstacle::{Obstacle, Shape};
use crate::scene::Scene;

/// The record of a run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Times a hull met an obstacle, the ground broke the legs, or a vehicle left the bounds.
    pub collisions_obstacle: u32,
    /// Times two hulls met while either flew.
    pub collisions_vehicle: u32,
    /// Least distance between two centres while either flew, m; `None` if there never were two.
    pub min_separation_m: Option<f64>,
    /// Least distance from a flying hull to an obstacle, m, 0 in contact; `None` if nobody flew
    /// or there is no obstacle.
    pub min_clearance_m: Option<f64>,
}

/// One vehicle at one moment, as the referee sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Player {
    pub(crate) hull: Hull,
    pub(crate) airborne: bool,
    pub(crate) wrecked: bool,
}

/// Watches every step of a run.
#[derive(Clone)]
pub(crate) struct Referee {
    truth: Truth,
    /// Those that stand.
    solids: Solids,
    bounds: Aabb,
    watches: Vec<Watch>,
    /// Whether vehicles `i < j` touch, at `j (j - 1) / 2 + i`: a contact counts once.
    touching: Vec<bool>,
}

/// The referee's memory of one vehicle.
#[derive(Debug, Clone, Copy)]
struct Watch {
    centre: Vector3<f64>,
    /// The clearance of the centre is not less than this.
    clearance_at_least_m: f64,
    out_of_bounds: bool,
}

impl Referee {
    pub(crate) fn new(scene: &Scene, players: &[Player]) -> Self {
        let watches = players
            .iter()
            .map(|player| Watch {
                centre: player.hull.centre,
                clearance_at_least_m: f64::NEG_INFINITY,
                out_of_bounds: false,
            })
            .collect();
        Self {
            truth: Truth::default(),
            solids: Solids::new(scene.obstacles().iter().filter(|obstacle| obstacle.way.is_none())),
            bounds: *scene.bounds(),
            watches,
            touching: vec![false; players.len() * players.len().saturating_sub(1) / 2],
        }
    }

    pub(crate) fn truth(&self) -> Truth {
        self.truth
    }

    /// Counts a collision with the ground.
    pub(crate) fn count_hard_landing(&mut self) {
        self.truth.collisions_obstacle += 1;
    }

    /// Judges one moment and names the vehicles that crashed in it.
    pub(crate) fn judge(&mut self, players: &[Player], scene: &Scene) -> Vec<usize> {
        let mut crashed = Vec::new();
        let moving = Solids::new(scene.moving());
        for (index, player) in players.iter().enumerate() {
            let hits_moving = self.judge_moving(&moving, player);
            if self.judge_obstacles(index, player) || hits_moving {
                crashed.push(index);
            }
        }
        let mut pair = 0;
        for (j, second) in players.iter().enumerate() {
            for (i, first) in players.iter().enumerate().take(j) {
                if self.judge_pair(pair, first, second) {
                    crashed.extend([i, j]);
                }
                pair += 1;
            }
        }
        crashed
    }

    /// Whether the vehicle and something that moves have just met.
    fn judge_moving(&mut self, moving: &Solids, player: &Player) -> bool {
        if !player.airborne || player.wrecked {
            return false;
        }
        let distance_m = moving.distance(&player.hull.centre);
        distance_m.is_some_and(|distance_m| self.note_clearance(distance_m - player.hull.radius_m))
    }

    /// Takes in the clearance of a hull, m; tells whether that is a collision.
    fn note_clearance(&mut self, clearance_m: f64) -> bool {
        let clearance_m = clearance_m.max(0.0);
        let known_m = self.truth.min_clearance_m.unwrap_or(f64::INFINITY);
        self.truth.min_clearance_m = Some(known_m.min(clearance_m));
        let hit = clearance_m == 0.0;
        self.truth.collisions_obstacle += u32::from(hit);
        hit
    }

    /// Whether the vehicle has just run into an obstacle that stands.
    fn judge_obstacles(&mut self, index: usize, player: &Player) -> bool {
        let Some(watch) = self.watches.get_mut(index) else {
            return false;
        };
        let Hull { centre, radius_m } = player.hull;
        // The distance to a fixed thing shrinks by no more than the way flown, so most steps need
        // no look at the obstacles.
        watch.clearance_at_least_m -= (centre - watch.centre).norm();
        watch.centre = centre;
        if !player.airborne || player.wrecked {
            return false;
        }
        let out = !self.bounds.contains(&centre);
        if out && !watch.out_of_bounds {
            self.truth.collisions_obstacle += 1;
        }
        watch.out_of_bounds = out;

        let known_m = self.truth.min_clearance_m.unwrap_or(f64::INFINITY);
        if watch.clearance_at_least_m - radius_m > known_m.max(0.0) {
            return false;
        }
        let Some(clearance_m) = self.solids.distance(&centre) else {
            watch.clearance_at_least_m = f64::INFINITY;
            return false;
        };
        watch.clearance_at_least_m = clearance_m;
        self.note_clearance(clearance_m - radius_m)
    }

    /// Whether the two vehicles have just run into each other.
    fn judge_pair(&mut self, pair: usize, first: &Player, second: &Player) -> bool {
        let Some(touching) = self.touching.get_mut(pair) else {
            return false;
        };
        let flies = |player: &Player| player.airborne && !player.wrecked;
        if !flies(first) && !flies(second) {
            return false;
        }
        let separation_m = (first.hull.centre - second.hull.centre).norm();
        let least_m = self.truth.min_separation_m.unwrap_or(f64::INFINITY);
        self.truth.min_separation_m = Some(least_m.min(separation_m));
        let touch = separation_m <= first.hull.radius_m + second.hull.radius_m;
        let hit = touch && !*touching;
        *touching = touch;
        self.truth.collisions_vehicle += u32::from(hit);
        hit
    }
}

/// The obstacles as parry shapes.
#[derive(Clone)]
struct Solids {
    /// All simple ones that have an end, under one bounding volume hierarchy.
    bodies: Option<Compound>,
    /// Planes; and meshes, which have hierarchies of their own.
    others: Vec<Other>,
}

/// A solid that parry does not let into a compound.
#[derive(Clone)]
enum Other {
    Plane(DPose3, SharedShape),
    /// A mesh, or a shape that parry lacks, which measures itself.
    Own(Isometry3<f64>, Shape),
}

impl Other {
    fn distance(&self, point: DVec3) -> f64 {
        match self {
            Self::Plane(pose, plane) => plane.distance_to_point(pose, point, true),
            Self::Own(pose, shape) => {
                let own = pose.inverse_transform_point(&Point3::new(point.x, point.y, point.z));
                shape.signed_distance(&own).max(0.0)
            }
        }
    }
}

impl Solids {
    fn new<'a>(obstacles: impl Iterator<Item = &'a Obstacle>) -> Self {
        let (mut bodies, mut others) = (Vec::new(), Vec::new());
        for obstacle in obstacles {
            match &obstacle.shape {
                Shape::Plane { normal } => {
                    let plane = SharedShape::halfspace(DVec3::new(normal.x, normal.y, normal.z));
                    others.push(Other::Plane(obstacle.pose.into(), plane));
                }
                shape => match parry_shape(obstacle) {
                    Some(body) => bodies.push(body),
                    None => others.push(Other::Own(obstacle.pose, shape.clone())),
                },
            }
        }
        Self { bodies: (!bodies.is_empty()).then(|| Compound::new(bodies)), others }
    }

    /// Distance from a point to the nearest obstacle, 0 inside; `None` without obstacles.
    fn distance(&self, point: &Vector3<f64>) -> Option<f64> {
        let point = DVec3::new(point.x, point.y, point.z);
        let bodies = self.bodies.iter().map(|compound| compound.distance_to_local_point(point, true));
        let others = self.others.iter().map(|other| other.distance(point));
        bodies.chain(others).reduce(f64::min)
    }
}

/// An obstacle as a parry shape and its pose; `None` of one that is no simple shape of parry's.
fn parry_shape(obstacle: &Obstacle) -> Option<(DPose3, SharedShape)> {
    let mut pose = obstacle.pose;
    // Parry's cylinders and cones stand along y.
    let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    let shape = match obstacle.shape {
        Shape::Box { half_extents } => SharedShape::cuboid(half_extents.x, half_extents.y, half_extents.z),
        Shape::Cylinder { radius, half_height } => {
            pose *= upright;
            SharedShape::cylinder(half_height, radius)
        }
        Shape::Cone { radius, half_height } => {
            pose *= upright;
            SharedShape::cone(half_height, radius)
        }
        Shape::Sphere { radius } => SharedShape::ball(radius),
        Shape::Capsule { radius, half_length } => SharedShape::capsule_z(half_length, radius),
        Shape::Ellipsoid { .. } | Shape::Mesh(_) | Shape::Plane { .. } => return None,
    };
    Some((pose.into(), shape))
}
