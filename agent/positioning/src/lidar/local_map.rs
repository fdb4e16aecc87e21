//! Surfaces near the vehicle, gathered from key frames, that scans are matched against.

use nalgebra::{Isometry2, Vector2};

use super::level::Return;

/// Edge of a cell, m.
pub const CELL_M: f64 = 0.2;
/// Cells along an edge of the map: 102 m, so that all that a scanner of 40 m sees is on it.
pub const SIDE: usize = 512;
/// A surface is one with another in its cell when the cosine between both is above this.
const SAME_FACING: f64 = 0.7;
/// Returns are compared with surfaces when the cosine between both is above this.
const LIKE_FACING: f64 = 0.5;
/// Directions of one scan are told by shared returns; so much a further one counts.
const SHARED: f64 = 0.3;
/// No surface.
const NONE: u32 = u32::MAX;

/// A piece of a surface, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Its middle, m.
    pub point: Vector2<f64>,
    /// Unit vector to the side from which it was seen.
    pub normal: Vector2<f64>,
    /// Of the direction of `normal`, rad².
    pub normal_variance: f64,
    /// Of the point along `normal`, m².
    pub variance: f64,
    /// The next in the same cell.
    next: u32,
}

/// Surfaces by place, in a square about a centre. Its memory is one megabyte and what the surfaces take.
#[derive(Clone, Debug)]
pub struct LocalMap {
    /// World place of the corner with the least coordinates, m.
    corner: Vector2<f64>,
    first: Vec<u32>,
    surfaces: Vec<Surface>,
}

impl LocalMap {
    /// An empty map about `centre`, m.
    pub fn new(centre: &Vector2<f64>) -> Self {
        let mut map = Self { corner: *centre, first: Vec::new(), surfaces: Vec::new() };
        map.clear(centre);
        map
    }

    /// Forgets all, and moves to `centre`, m.
    pub fn clear(&mut self, centre: &Vector2<f64>) {
        let half = CELL_M * SIDE as f64 / 2.0;
        self.corner = centre - Vector2::new(half, half);
        self.first.clear();
        self.first.resize(SIDE * SIDE, NONE);
        self.surfaces.clear();
    }

    /// Memory it takes, bytes.
    pub fn bytes(&self) -> usize {
        self.first.capacity() * size_of::<u32>() + self.surfaces.capacity() * size_of::<Surface>()
    }

    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Column and row of the cell of a place; they can lie outside of the map.
    pub fn cell(&self, point: &Vector2<f64>) -> [i64; 2] {
        let from_corner = (point - self.corner) / CELL_M;
        [from_corner.x.floor() as i64, from_corner.y.floor() as i64]
    }

    fn index([column, row]: [i64; 2]) -> Option<usize> {
        let inside = 0..SIDE as i64;
        (inside.contains(&column) && inside.contains(&row)).then(|| row as usize * SIDE + column as usize)
    }

    /// Adds returns that were seen from `pose`; those beyond the map's edge are left out.
    pub fn add(&mut self, pose: &Isometry2<f64>, returns: &[Return]) {
        for one in returns {
            let point = pose.rotation * one.point + pose.translation.vector;
            let normal = pose.rotation * one.normal;
            let Some(cell) = Self::index(self.cell(&point)) else { continue };
            let (normal_variance, variance) = (one.normal_variance, one.variance);
            let surface = Surface { point, normal, normal_variance, variance, next: self.first[cell] };
            let mut chain = Chain { map: &self.surfaces, at: self.first[cell] };
            let same = chain.find(|(_, other)| other.normal.dot(&normal) > SAME_FACING);
            match same.map(|(at, _)| at) {
                Some(at) => self.surfaces[at].gather(&surface),
                None => {
                    self.first[cell] = self.surfaces.len() as u32;
                    self.surfaces.push(surface);
                }
            }
        }
    }

    /// The surface nearest to `point` within `reach_m` that faces about as `normal` does.
    pub fn nearest(&self, point: &Vector2<f64>, normal: &Vector2<f64>, reach_m: f64) -> Option<&Surface> {
        let around = (reach_m / CELL_M).ceil() as i64;
        let [column, row] = self.cell(point);
        let mut nearest = (reach_m * reach_m, None);
        for row in row - around..=row + around {
            for column in column - around..=column + around {
                let Some(cell) = Self::index([column, row]) else { continue };
                for (_, surface) in (Chain { map: &self.surfaces, at: self.first[cell] }) {
                    let off_2 = (surface.point - point).norm_squared();
                    if off_2 < nearest.0 && surface.normal.dot(normal) > LIKE_FACING {
                        nearest = (off_2, Some(surface));
                    }
                }
            }
        }
        nearest.1
    }
}

impl Surface {
    /// Becomes the mean of itself and `other`.
    fn gather(&mut self, other: &Surface) {
        let (own, new) = (1.0 / self.variance, 1.0 / other.variance);
        self.point = (self.point * own + other.point * new) / (own + new);
        self.variance = 1.0 / (own + new);
        let (own, new) = (1.0 / self.normal_variance, SHARED / other.normal_variance);
        self.normal = (self.normal * own + other.normal * new).normalize();
        self.normal_variance = 1.0 / (own + new);
    }
}

/// The surfaces of one cell.
struct Chain<'a> {
    map: &'a [Surface],
    at: u32,
}

impl<'a> Iterator for Chain<'a> {
    type Item = (usize, &'a Surface);

    fn next(&mut self) -> Option<Self::Item> {
        let at = self.at as usize;
        let surface = self.map.get(at)?;
        self.at = surface.next;
        Some((at, surface))
    }
}
