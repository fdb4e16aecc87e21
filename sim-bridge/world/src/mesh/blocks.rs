//! Blocks: what a mesh is like where nobody can draw its faces.

use glamx::{DPose3, DVec3};
use nalgebra::Vector3;
use parry3d_f64::query::intersection_test;
use parry3d_f64::shape::Cuboid;

use super::Mesh;
use crate::aabb::Aabb;

/// Blocks along the longest side.
const ALONG: f64 = 24.0;
/// Blocks are at least this long, m.
const LEAST_M: f64 = 0.1;

impl Mesh {
    /// Boxes along the own axes that hold all faces, metres: pillars of cubes, 24 along the longest side.
    pub fn blocks(&self) -> &[Aabb] {
        self.blocks.get_or_init(|| self.find_blocks())
    }

    fn find_blocks(&self) -> Vec<Aabb> {
        let Aabb { min, max } = self.bounds;
        let side = ((max - min).max() / ALONG).max(LEAST_M);
        let counts = (max - min).map(|along| (along / side).ceil().max(1.0) as u32);
        let mut pillars = Vec::new();
        for x in 0..counts.x {
            for y in 0..counts.y {
                let corner = |z: u32| min + Vector3::new(f64::from(x), f64::from(y), f64::from(z)) * side;
                self.add_pillars(&mut pillars, counts.z, side, corner);
            }
        }
        pillars
    }

    /// The pillars over one place: from the first cube of each run that meets a face to the last.
    fn add_pillars(
        &self,
        pillars: &mut Vec<Aabb>,
        count: u32,
        side: f64,
        corner: impl Fn(u32) -> Vector3<f64>,
    ) {
        let mut from = None;
        for z in 0..=count {
            let meets = z < count && self.meets(&corner(z), side);
            match (meets, from) {
                (true, None) => from = Some(z),
                (false, Some(first)) => {
                    let top = corner(z) + Vector3::new(side, side, 0.0);
                    pillars.push(Aabb { min: corner(first), max: top });
                    from = None;
                }
                _ => {}
            }
        }
    }

    /// Whether a cube meets a face.
    fn meets(&self, corner: &Vector3<f64>, side: f64) -> bool {
        let middle = corner + Vector3::repeat(side / 2.0);
        let pose = DPose3::from_parts(DVec3::new(middle.x, middle.y, middle.z), glamx::DQuat::IDENTITY);
        let cube = Cuboid::new(DVec3::splat(side / 2.0));
        intersection_test(&pose, &cube, &self.pose, self.shape.as_ref()).is_ok_and(|met| met.intersecting)
    }
}
