//! The repulsion of what the map knows, in one layer around a vehicle.

use nalgebra::Vector3;

use crate::map::{ClearanceMap, VoxelIndex};

/// Distance below which the field grows no more, metres: it would be infinite in the obstacle.
const CORE_M: f64 = 0.1;

/// `sum (1/rho - 1/r)^2` over the obstacles around, `rho` being the distance from an obstacle's skin and `r` its
/// influence. An obstacle is what hangs together in the layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MapField {
    /// Voxel of the lowest corner, and voxels along east and north.
    corner: [usize; 2],
    counts: [usize; 2],
    values: Vec<f64>,
    /// From the world to voxels, as in the map when it was made.
    origin: Vector3<f64>,
    resolution_m: f64,
}

impl MapField {
    /// The field within `reach_m` of `eye` in its layer, of those parts of the obstacles, with centres at an offset
    /// from `eye`, that `repel`. All lengths in metres.
    pub fn of(
        map: &ClearanceMap,
        eye: &Vector3<f64>,
        [reach_m, influence_m]: [f64; 2],
        repel: impl Fn(&Vector3<f64>) -> bool,
    ) -> MapField {
        let voxels = map.voxels();
        let Some(centre) = voxels.index_of(eye) else { return MapField::default() };
        let resolution_m = voxels.config().resolution_m;
        let span = (reach_m / resolution_m).ceil() as usize;
        let side = |at: usize, count: usize| (at.saturating_sub(span), (at + span + 1).min(count));
        let [(x0, x1), (y0, y1)] = [side(centre.x, voxels.counts()[0]), side(centre.y, voxels.counts()[1])];
        let mut field = MapField {
            corner: [x0, y0],
            counts: [x1 - x0, y1 - y0],
            values: vec![0.0; (x1 - x0) * (y1 - y0)],
            origin: voxels.centre_of(VoxelIndex { x: x0, y: y0, z: centre.z }),
            resolution_m,
        };
        let mut blocked: Vec<bool> =
            (y0..y1).flat_map(|y| voxels.row(y, centre.z)[x0..x1].iter().map(|row| *row > 0)).collect();
        let disc = Disc::new(influence_m, resolution_m);
        let mut nearest = vec![f64::INFINITY; field.values.len()];
        for cell in 0..blocked.len() {
            let obstacle = field.take_obstacle(cell, &mut blocked);
            let repelling = obstacle.into_iter().filter(|cell| {
                let offset = field.centre_of(*cell) - eye;
                repel(&Vector3::new(offset.x, offset.y, 0.0))
            });
            field.add(&repelling.collect::<Vec<_>>(), &disc, &mut nearest);
        }
        field
    }

    /// The field at a place, whatever its height.
    pub fn at(&self, place: &Vector3<f64>) -> f64 {
        let offset = (place - self.origin) / self.resolution_m.max(1e-9);
        let [x, y] = [offset.x.round(), offset.y.round()];
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.counts[0] as f64 && y < self.counts[1] as f64;
        if !is_inside {
            return 0.0;
        }
        self.values.get(y as usize * self.counts[0] + x as usize).copied().unwrap_or(0.0)
    }

    fn centre_of(&self, cell: usize) -> Vector3<f64> {
        let [x, y] = [cell % self.counts[0], cell / self.counts[0]];
        self.origin + Vector3::new(x as f64, y as f64, 0.0) * self.resolution_m
    }

    /// The cell at an offset from another, if there is one.
    fn moved(&self, cell: usize, [dx, dy]: [i32; 2]) -> Option<usize> {
        let [width, height] = self.counts;
        let x = (cell % width).checked_add_signed(dx as isize).filter(|x| *x < width)?;
        let y = (cell / width).checked_add_signed(dy as isize).filter(|y| *y < height)?;
        Some(y * width + x)
    }

    /// Takes all cells that hang together with one out of those that are blocked.
    fn take_obstacle(&self, cell: usize, blocked: &mut [bool]) -> Vec<usize> {
        let mut take = |cell: usize| blocked.get_mut(cell).is_some_and(std::mem::take);
        let mut taken = Vec::new();
        if take(cell) {
            taken.push(cell);
        }
        let mut next = 0;
        while let Some(cell) = taken.get(next).copied() {
            next += 1;
            for by in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [dx, dy])) {
                if let Some(there) = self.moved(cell, by).filter(|there| take(*there)) {
                    taken.push(there);
                }
            }
        }
        taken
    }

    /// Adds the field of one obstacle; `nearest` is infinite everywhere before and after.
    fn add(&mut self, obstacle: &[usize], disc: &Disc, nearest: &mut [f64]) {
        let mut touched = Vec::new();
        for cell in obstacle {
            for (by, distance_m) in &disc.cells {
                let Some(there) = self.moved(*cell, *by) else { continue };
                let Some(known_m) = nearest.get_mut(there) else { continue };
                if known_m.is_infinite() {
                    touched.push(there);
                }
                *known_m = known_m.min(*distance_m);
            }
        }
        for cell in touched {
            if let (Some(value), Some(distance_m)) = (self.values.get_mut(cell), nearest.get_mut(cell)) {
                let closeness = 1.0 / distance_m.max(CORE_M) - 1.0 / disc.radius_m;
                *value += closeness * closeness;
                *distance_m = f64::INFINITY;
            }
        }
    }
}

/// Offsets of the cells around one, with their distances from its side, metres.
struct Disc {
    radius_m: f64,
    cells: Vec<([i32; 2], f64)>,
}

impl Disc {
    fn new(radius_m: f64, resolution_m: f64) -> Disc {
        let span = (radius_m / resolution_m).ceil() as i32 + 1;
        let around = (-span..=span).flat_map(|dy| (-span..=span).map(move |dx| [dx, dy]));
        let distance_m = |[dx, dy]: [i32; 2]| {
            (f64::from(dx).hypot(f64::from(dy)) * resolution_m - resolution_m / 2.0).max(0.0)
        };
        let cells = around.map(|by| (by, distance_m(by))).filter(|(_, distance_m)| *distance_m < radius_m);
        Disc { radius_m, cells: cells.collect() }
    }
}
