//! A world without its vehicles: obstacles, ground, bounds, datum.

use std::time::Duration;

use nalgebra::{Point3, Vector3};
use skein_mav::Datum;

use crate::aabb::Aabb;
use crate::floor_camera::MarkerFloor;
use crate::obstacle::Obstacle;

/// Distance of the derived bounds from the outermost obstacle, m.
const MARGIN_M: f64 = 20.0;
/// The derived bounds hold at least this much in every horizontal direction of the origin, m.
const LEAST_REACH_M: f64 = 50.0;
/// The derived bounds are at least this high, m.
const LEAST_CEILING_M: f64 = 20.0;
/// The derived bounds begin this far below the ground, m.
const CELLAR_M: f64 = 1.0;

/// A place to fly in: obstacles over flat ground at z = 0, inside of bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    name: String,
    obstacles: Vec<Obstacle>,
    /// Radius of the ball about each obstacle, kept because it needs a square root.
    reaches: Vec<f64>,
    bounds: Aabb,
    datum: Datum,
    wind: Vector3<f64>,
    markers: Option<MarkerFloor>,
}

/// The obstacle next to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest<'a> {
    pub obstacle: &'a Obstacle,
    /// Distance to its surface, m, negative inside.
    pub distance_m: f64,
}

impl Scene {
    /// A scene with derived bounds (20 m around all obstacles and 50 m around the origin; from
    /// 1 m below the ground to 20 m above it or 10 m above the highest obstacle, whichever is
    /// higher) and the datum that PX4's simulations use.
    pub fn new(name: impl Into<String>, obstacles: Vec<Obstacle>) -> Self {
        Self {
            name: name.into(),
            bounds: derive_bounds(&obstacles),
            reaches: obstacles.iter().map(|obstacle| obstacle.shape.bounding_radius()).collect(),
            obstacles,
            datum: Datum::from_degrees(47.397_742, 8.545_594, 488.0),
            wind: Vector3::zeros(),
            markers: None,
        }
    }

    /// The same scene with markers on the ground.
    pub fn with_markers(mut self, markers: MarkerFloor) -> Self {
        self.markers = Some(markers);
        self
    }

    /// The markers on the ground, if there are any.
    pub fn markers(&self) -> Option<&MarkerFloor> {
        self.markers.as_ref()
    }

    /// The same scene in other bounds.
    pub fn with_bounds(mut self, bounds: Aabb) -> Self {
        self.bounds = bounds;
        self
    }

    /// The same scene with more obstacles, in the same bounds.
    pub fn with_more(mut self, obstacles: impl IntoIterator<Item = Obstacle>) -> Self {
        self.obstacles.extend(obstacles);
        self.reaches = self.obstacles.iter().map(|obstacle| obstacle.shape.bounding_radius()).collect();
        self
    }

    /// The same scene at another place on Earth.
    pub fn with_datum(mut self, datum: Datum) -> Self {
        self.datum = datum;
        self
    }

    /// The same scene in a steady wind: ENU, m/s.
    pub fn with_wind(mut self, wind: Vector3<f64>) -> Self {
        self.wind = wind;
        self
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// All obstacles, in the order of the file they came from.
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Those that move.
    pub fn moving(&self) -> impl Iterator<Item = &Obstacle> {
        self.obstacles.iter().filter(|obstacle| obstacle.way.is_some())
    }

    /// Moves what moves to where it is so long after the run began.
    pub fn move_on(&mut self, now: Duration) {
        self.obstacles.iter_mut().for_each(|obstacle| obstacle.move_on(now));
    }

    /// The space for flights; leaving it counts as a collision.
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// The world's origin on Earth.
    pub fn datum(&self) -> &Datum {
        &self.datum
    }

    /// The wind that the world states: ENU, m/s.
    pub fn wind(&self) -> Vector3<f64> {
        self.wind
    }

    /// Distance from `point` to the nearest obstacle, m: negative inside of one, infinite where
    /// there is none. The ground does not count.
    pub fn clearance(&self, point: &Vector3<f64>) -> f64 {
        self.nearest(point).map_or(f64::INFINITY, |nearest| nearest.distance_m)
    }

    /// The obstacle nearest to `point`; the ground does not count.
    pub fn nearest(&self, point: &Vector3<f64>) -> Option<Nearest<'_>> {
        let point = Point3::from(*point);
        let mut best: Option<Nearest<'_>> = None;
        for (obstacle, reach) in self.obstacles.iter().zip(&self.reaches) {
            if let Some(best) = best {
                let centre = obstacle.pose.translation.vector;
                let limit = best.distance_m.max(0.0) + reach;
                if (point.coords - centre).norm_squared() > limit * limit {
                    continue;
                }
            }
            let distance_m = obstacle.signed_distance(&point);
            if best.is_none_or(|best| distance_m < best.distance_m) {
                best = Some(Nearest { obstacle, distance_m });
            }
        }
        best
    }

    /// Distance along the unit vector `direction` from `origin` to the first obstacle or the
    /// ground, if that is within `max` metres; 0 inside of an obstacle.
    pub fn cast_ray(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<f64> {
        let mut nearest = ground_range(origin.z, direction.z).unwrap_or(f64::INFINITY);
        for (obstacle, reach) in self.obstacles.iter().zip(&self.reaches) {
            let to_centre = obstacle.pose.translation.vector - origin.coords;
            let along = to_centre.dot(direction);
            let aside = to_centre.norm_squared() - along * along;
            let limit = nearest.min(max) + reach;
            if along < -reach || along > limit || aside > reach * reach {
                continue;
            }
            if let Some(range) = obstacle.cast_ray(origin, direction) {
                nearest = nearest.min(range);
            }
        }
        (nearest <= max).then_some(nearest)
    }
}

/// Distance to the ground along a ray that starts at height `z` and rises by `slope` per metre.
pub(crate) fn ground_range(z: f64, slope: f64) -> Option<f64> {
    (slope < 0.0).then(|| z.max(0.0) / -slope)
}

fn derive_bounds(obstacles: &[Obstacle]) -> Aabb {
    let least = Aabb {
        min: Vector3::new(-LEAST_REACH_M, -LEAST_REACH_M, -CELLAR_M),
        max: Vector3::new(LEAST_REACH_M, LEAST_REACH_M, LEAST_CEILING_M),
    };
    let around = obstacles
        .iter()
        .filter_map(Obstacle::aabb)
        .reduce(|all, one| all.union(&one))
        .map(|all| all.grown(Vector3::new(MARGIN_M, MARGIN_M, MARGIN_M / 2.0)));
    let Some(around) = around else {
        return least;
    };
    let mut bounds = least.union(&around);
    bounds.min.z = -CELLAR_M;
    bounds
}
