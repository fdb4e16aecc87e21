//! Places that an instrument has measured: point clouds, and meshes of them, as worlds.

mod lzf;
mod pcd;
mod ply;

use nalgebra::{Isometry3, Vector3};

use crate::mesh::{self, Faces, Mesh, MeshError};
use crate::obstacle::{Obstacle, Shape};
use crate::scene::Scene;

/// Length of the cubes that hold the points of a cloud, m.
pub const CUBE_M: f64 = 0.2;
/// Points no higher than this are ground, m.
pub const GROUND_M: f64 = 0.1;
/// Clouds of more points are refused.
pub const MOST_POINTS: usize = 20_000_000;

/// Why a measured world was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{source_name}: {message}")]
pub struct CloudError {
    pub source_name: String,
    pub message: String,
}

/// The content of a file of points.
#[derive(Debug, Clone, Default, PartialEq)]
struct Cloud {
    points: Vec<[f64; 3]>,
    /// Three numbers of points each.
    triangles: Vec<[u32; 3]>,
}

impl Scene {
    /// Reads a whole world, metres, z up, from a mesh (`.obj`) or from a point cloud (`.pcd`, `.ply`; the
    /// latter may have faces instead); `source_name` ends in the kind. The points of a cloud become cubes of
    /// 0.2 m; those no higher than 0.1 m are ground.
    ///
    /// # Errors
    /// The fault in the file.
    pub fn from_measured(bytes: &[u8], source_name: &str) -> Result<Self, CloudError> {
        let refuse = |message: String| CloudError { source_name: source_name.to_owned(), message };
        let mesh = match source_name.rsplit('.').next().unwrap_or_default().to_lowercase().as_str() {
            "pcd" => pcd::read(bytes).and_then(mesh_of),
            "ply" => ply::read(bytes).and_then(mesh_of),
            _ => {
                mesh::read(source_name, bytes, None).and_then(Mesh::hollow).map_err(|error| error.to_string())
            }
        };
        let name = source_name.rsplit(['/', '\\']).next().unwrap_or(source_name);
        let solid = Obstacle::new(name, Shape::Mesh(mesh.map_err(refuse)?), Isometry3::identity());
        Ok(Self::new(source_name, vec![solid]))
    }
}

fn mesh_of(cloud: Cloud) -> Result<Mesh, String> {
    let told = |error: MeshError| error.to_string();
    if !cloud.triangles.is_empty() {
        let faces = Faces { corners: cloud.points, triangles: cloud.triangles };
        return Mesh::hollow(faces).map_err(told);
    }
    let measured = cloud.points.into_iter().map(Vector3::from);
    // Instruments write NaN where they saw nothing.
    Mesh::cubes(measured.filter(|point| point.z > GROUND_M), CUBE_M).map_err(told)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    const PCD: &str = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\n\
        WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n";

    fn scene(name: &str, bytes: &[u8]) -> Scene {
        Scene::from_measured(bytes, name).unwrap_or_else(|error| panic!("{error}"))
    }

    /// A point at (5.1, 0.1, 2.1) is in the cube from (5, 0, 2) on; ground and what was not seen count for
    /// nothing.
    fn has_one_cube(scene: &Scene) {
        let met = |y: f64, z: f64| scene.cast_ray(&Point3::new(0.0, y, z), &Vector3::x(), 50.0);
        assert!(met(0.1, 2.1).is_some_and(|range| (range - 5.0).abs() < 1e-6), "{:?}", met(0.1, 2.1));
        assert_eq!((met(0.1, 2.3), met(-0.1, 2.1)), (None, None));
        assert!(scene.clearance(&Vector3::new(5.1, 0.1, 2.1)) <= 0.0);
        assert!((scene.clearance(&Vector3::new(5.1, 0.1, 3.2)) - 1.0).abs() < 1e-6);
        assert!(scene.clearance(&Vector3::new(9.0, 9.0, 0.0)) > 5.0);
    }

    #[test]
    fn a_cloud_of_text_becomes_cubes() {
        has_one_cube(&scene("a.pcd", format!("{PCD}5.1 0.1 2.1 7\n9 9 0.02 7\nnan nan nan 7\n").as_bytes()));
        let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty double z\n\
            property uchar red\nend_header\n5.1 0.1 2.1 255\n9 9 0.02 0\n";
        has_one_cube(&scene("a.ply", ply.as_bytes()));
    }

    #[test]
    fn a_cloud_of_bytes_becomes_cubes_packed_or_not() {
        let points: [[f32; 3]; 3] = [[5.1, 0.1, 2.1], [9.0, 9.0, 0.02], [f32::NAN; 3]];
        let row = |point: &[f32; 3]| {
            point.iter().flat_map(|part| part.to_le_bytes()).chain([0; 4]).collect::<Vec<u8>>()
        };
        let head = PCD.replace("ascii", "binary");
        let bytes: Vec<u8> = head.bytes().chain(points.iter().flat_map(row)).collect();
        has_one_cube(&scene("a.pcd", &bytes));
        // Packed: field by field, here as one run of 32 plain bytes and one of 16.
        let fields = (0..3).flat_map(|axis| points.iter().flat_map(move |point| point[axis].to_le_bytes()));
        let plain: Vec<u8> = fields.chain([0; 12]).collect();
        let mut packed = vec![31];
        packed.extend(&plain[..32]);
        packed.push(15);
        packed.extend(&plain[32..]);
        let sizes = [packed.len() as u32, plain.len() as u32].into_iter().flat_map(u32::to_le_bytes);
        let head = PCD.replace("ascii", "binary_compressed");
        has_one_cube(&scene("a.pcd", &head.bytes().chain(sizes).chain(packed).collect::<Vec<_>>()));
    }

    #[test]
    fn a_mesh_is_met_at_its_faces() {
        let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n5 -1 0\n5 1 0\n5 1 4\n5 -1 4\n4 0 1 2 3\n";
        let obj = "v 5 -1 0\nv 5 1 0\nv 5 1 4\nv 5 -1 4\nf 1 2 3 4\n";
        for scene in [scene("a.ply", ply.as_bytes()), scene("a.obj", obj.as_bytes())] {
            let met = scene.cast_ray(&Point3::new(0.0, 0.5, 2.0), &Vector3::x(), 50.0);
            assert!(met.is_some_and(|range| (range - 5.0).abs() < 1e-9), "{met:?}");
        }
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (name, text, expected) in [
            ("a.pcd", "VERSION 0.7\n".to_owned(), "DATA"),
            ("a.pcd", PCD.replace("x y z", "a b c"), "FIELDS"),
            ("a.pcd", format!("{PCD}1 2\n"), "line 12"),
            ("a.pcd", PCD.replace("POINTS 3", "POINTS 99999999999"), "POINTS"),
            ("a.pcd", PCD.replace("ascii", "binary"), "cut off"),
            ("a.pcd", format!("{PCD}0 0 0 0\n0 0 0 0\n0 0 0 0\n"), "no point above the ground"),
            ("a.ply", "ply\nformat ascii 1.0\nend_header\n".to_owned(), "vertex"),
            ("a.obj", "v 1 2\n".to_owned(), ""),
        ] {
            let error = Scene::from_measured(text.as_bytes(), name).expect_err(name).to_string();
            assert!(error.starts_with(name) && error.contains(expected), "{error}");
        }
    }
}
