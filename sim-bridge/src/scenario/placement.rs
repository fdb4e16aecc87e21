//! Clear places in a world that was not made for the swarm: room to take off from and to land on.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use skein_world::Scene;

use super::layout::{SPACING_M, on_circle};

/// Least distance from a chosen start or goal to any obstacle, in metres.
pub const CLEARANCE_M: f64 = 1.5;
/// Reach of [`clear_place`], in metres.
pub const REACH_M: f64 = 40.0;

/// Step between the rings of the search and along probed lines, in metres.
const STEP_M: f64 = 0.5;
/// From a chosen place to the sides of the world, in metres.
const BOUNDS_MARGIN_M: f64 = 1.0;

/// A vehicle can climb from the ground under `place` to its height (at least `height_m`), or land there.
pub fn is_clear(scene: &Scene, place: &Vector3<f64>, height_m: f64) -> bool {
    let foot = Vector3::new(place.x, place.y, 0.0);
    let top = Vector3::new(place.x, place.y, place.z.max(height_m));
    scene.bounds().grown(Vector3::new(-BOUNDS_MARGIN_M, -BOUNDS_MARGIN_M, 0.0)).contains(place)
        && way_is_clear(scene, &foot, &top, CLEARANCE_M)
}

/// Every point between two places is `clearance_m` from all obstacles.
pub fn way_is_clear(scene: &Scene, from: &Vector3<f64>, to: &Vector3<f64>, clearance_m: f64) -> bool {
    let steps = ((to - from).norm() / STEP_M).ceil().max(1.0) as usize;
    (0..=steps).all(|i| {
        let probe = from.lerp(to, i as f64 / steps as f64);
        scene.clearance(&probe) >= clearance_m
    })
}

/// The place nearest to `wanted`, at its height, that `accept` likes and that is 3 m from all that are `taken`.
pub fn clear_place(
    wanted: &Vector3<f64>,
    taken: &[Vector3<f64>],
    accept: impl Fn(&Vector3<f64>) -> bool,
) -> Option<Vector3<f64>> {
    let apart = |p: &Vector3<f64>| taken.iter().all(|t| (t - p).xy().norm() >= SPACING_M - 1e-9);
    let rings = (REACH_M / STEP_M) as usize;
    for ring in 0..=rings {
        let radius = ring as f64 * STEP_M;
        let points = (TAU * radius / STEP_M).ceil().max(1.0) as usize;
        let candidates = (0..points).map(|i| wanted + on_circle(radius, TAU * i as f64 / points as f64));
        if let Some(place) = candidates.into_iter().find(|p| apart(p) && accept(p)) {
            return Some(place);
        }
    }
    None
}
