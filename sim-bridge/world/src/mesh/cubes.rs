//! Cubes that hold the points of a cloud.

use glamx::{DPose3, DVec3, I64Vec3};
use nalgebra::Vector3;
use parry3d_f64::shape::{SharedShape, Voxels};

use super::{Inside, LIMIT_M, Mesh, MeshError};

/// Parry keeps cubes in blocks of eight along each side; clouds that reach into more blocks are refused.
const MOST_BLOCKS: usize = 200_000;

impl Mesh {
    /// The cubes of a grid, of this length, that have a point in them; points that are not numbers are left
    /// out.
    pub fn cubes(points: impl Iterator<Item = Vector3<f64>>, side: f64) -> Result<Self, MeshError> {
        let is_sound = |point: &Vector3<f64>| point.iter().all(|part| part.abs() <= LIMIT_M);
        let cell = |point: Vector3<f64>| point.map(|part| (part / side).floor() as i64);
        let mut cells: Vec<_> =
            points.filter(is_sound).map(cell).map(|cell| [cell.x, cell.y, cell.z]).collect();
        cells.sort_unstable();
        cells.dedup();
        let mut blocks: Vec<_> = cells.iter().map(|cell| cell.map(|part| part.div_euclid(8))).collect();
        blocks.sort_unstable();
        blocks.dedup();
        match blocks.len() {
            0 => return Err(MeshError::NoPoint),
            1..=MOST_BLOCKS => {}
            _ => return Err(MeshError::Wide),
        }
        let cells: Vec<I64Vec3> = cells.into_iter().map(I64Vec3::from).collect();
        let shape = SharedShape::new(Voxels::new(DVec3::splat(side), &cells));
        Ok(Self::new(shape, DPose3::IDENTITY, Inside::Cubes))
    }
}
