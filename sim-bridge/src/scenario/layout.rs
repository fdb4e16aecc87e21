//! The product of a generator: obstacles, bounds and one route for each vehicle.

use std::f64::consts::PI;

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use skein_world::{Aabb, Obstacle};

/// Least distance between any two starts, and between any two goals, in metres.
pub const SPACING_M: f64 = 3.0;

/// Most by which goals are above or below the nominal height, in metres.
pub const HEIGHT_SPREAD_M: f64 = 0.5;

/// A vehicle's way through a generated world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Route {
    /// ENU, metres, on the ground.
    pub start: Vector3<f64>,
    /// The place of its last hover: ENU, metres.
    pub goal: Vector3<f64>,
}

impl Route {
    /// Heading from start to goal: radians counter-clockwise from east.
    pub fn yaw(&self) -> f64 {
        let way = self.goal - self.start;
        way.y.atan2(way.x)
    }
}

/// A generated world with a route for each vehicle.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Everything a vehicle can hit but the ground and its peers.
    pub obstacles: Vec<Obstacle>,
    /// Flight volume; leaving it counts as a collision.
    pub bounds: Aabb,
    pub routes: Vec<Route>,
    /// Notes for the user, such as on a parameter that had to give way.
    pub notes: Vec<String>,
}

/// Uniform in `[from, to)`; `from` where the interval is empty.
pub fn uniform(rng: &mut ChaCha8Rng, from: f64, to: f64) -> f64 {
    if to > from { rng.random_range(from..to) } else { from }
}

/// A goal height within [`HEIGHT_SPREAD_M`] of `height_m`.
pub fn spread_height(rng: &mut ChaCha8Rng, height_m: f64) -> f64 {
    uniform(rng, height_m - HEIGHT_SPREAD_M, height_m + HEIGHT_SPREAD_M)
}

/// A random order of `0..count` (Fisher and Yates).
pub fn permutation(rng: &mut ChaCha8Rng, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        // A remainder is as good as a rejection here: its bias is below 2^-50 for any swarm.
        let other = (rng.next_u64() % (last as u64 + 1)) as usize;
        order.swap(last, other);
    }
    order
}

/// The point at `angle` (radians counter-clockwise from east) on a circle about the origin, at height 0.
pub fn on_circle(radius: f64, angle: f64) -> Vector3<f64> {
    Vector3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
}

/// Least radius on which `count` points stand `spacing` metres apart, chord by chord.
pub fn circle_radius(count: usize, spacing: f64) -> f64 {
    if count < 2 { 0.0 } else { spacing / 2.0 / (PI / count as f64).sin() }
}

/// The straight lines of two routes cross, seen from above.
pub fn cross(a: &Route, b: &Route) -> bool {
    let side = |p: &Vector3<f64>, q: &Vector3<f64>, r: &Vector3<f64>| {
        (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x)
    };
    side(&a.start, &a.goal, &b.start) * side(&a.start, &a.goal, &b.goal) < 0.0
        && side(&b.start, &b.goal, &a.start) * side(&b.start, &b.goal, &a.goal) < 0.0
}

pub fn crossing_pairs(routes: &[Route]) -> usize {
    let mut pairs = 0;
    for (i, a) in routes.iter().enumerate() {
        pairs += routes.iter().skip(i + 1).filter(|b| cross(a, b)).count();
    }
    pairs
}
