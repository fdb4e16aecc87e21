//! Rooms with obstacles.

use std::sync::Arc;

use nalgebra::{Vector2, Vector3};
use skein_planning::traffic::{Lattice, Roads};

/// Radius of a vehicle, m.
pub const RADIUS_M: f64 = 0.15;
/// Distance of a vehicle's hull from obstacles, m.
const MARGIN_M: f64 = 0.07;
/// Cells, m.
const CELL_M: f64 = 0.5;

/// Boxes as high as the room: middle and size, m.
pub type Boxes = Vec<(Vector2<f64>, Vector2<f64>)>;

/// The roads between bounds (least and greatest corner, m) at heights from `low_m` to `high_m`.
pub fn roads(
    bounds: [Vector2<f64>; 2],
    heights: [f64; 2],
    through: Vector3<f64>,
    boxes: Boxes,
) -> Arc<Roads> {
    let [least, greatest] = bounds;
    let inside = Vector2::repeat(RADIUS_M);
    let [low_m, high_m] = heights;
    let lattice =
        Lattice::new((least + inside).push(low_m), (greatest - inside).push(high_m), through, CELL_M);
    let clearance = move |point: &Vector3<f64>| {
        let to_box = |(middle, size): &(Vector2<f64>, Vector2<f64>)| {
            ((point.xy() - middle).abs() - size / 2.0).map(|d| d.max(0.0)).norm()
        };
        boxes.iter().map(to_box).fold(f64::INFINITY, f64::min)
    };
    Arc::new(Roads::new(lattice, clearance, RADIUS_M + MARGIN_M))
}
