//! Meshes, heights and point clouds: what others have drawn or measured. The first line of an input is its
//! kind.

use nalgebra::{Point3, Vector3};
use skein_world::mesh::terrain::Heights;
use skein_world::{Mesh, Obstacle, Scene, Shape, mesh};

use crate::target::{Allowed, Reached, Target};

/// A few bytes of a packed picture may stand for 4097 x 4097 heights, and one point for a block of 512 cubes.
pub const TARGET: Target =
    Target { name: "measured", allowed: Allowed { bytes: 1 << 30, per_byte: 2000 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Some(end) = input.iter().position(|byte| *byte == b'\n') else { return Reached::Refused };
    let (kind, bytes) = (String::from_utf8_lossy(&input[..end]), &input[end + 1..]);
    let name = format!("fuzzed.{kind}");
    let scene = match kind.as_ref() {
        "stl" | "dae" => mesh::read(&name, bytes, None).and_then(Mesh::hollow).ok().map(scene_of),
        "raw" | "png" => Heights::read(&name, bytes)
            .and_then(|heights| Mesh::terrain(&heights, &Vector3::new(9.0, 9.0, 3.0)))
            .ok()
            .map(scene_of),
        "obj" | "ply" | "pcd" => Scene::from_measured(bytes, &name).ok(),
        _ => None,
    };
    let Some(scene) = scene else { return Reached::Refused };
    let clearance = scene.clearance(&Vector3::new(1.0, 2.0, 3.0));
    assert!(!clearance.is_nan());
    let met = scene.cast_ray(&Point3::new(1.0, 2.0, 3.0), &Vector3::new(0.6, 0.0, -0.8), 100.0);
    assert!(met.is_none_or(|range| (0.0..=100.0).contains(&range)));
    Reached::read(scene.bounds().max.z > 777.0)
}

fn scene_of(mesh: Mesh) -> Scene {
    Scene::new("fuzzed", vec![Obstacle::new("fuzzed", Shape::Mesh(mesh), nalgebra::Isometry3::identity())])
}

const STL: &str = "stl\nsolid r\nfacet normal 0 0 1\nouter loop\nvertex 0 0 2\nvertex 1 0 2\nvertex 0 1 2\nendloop\n\
    endfacet\nendsolid r\n";
const OBJ: &str = "obj\no a\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 2\nvn 0 0 1\nf 1//1 2//1 3//1\nf 2 3 4\n";
const PLY: &str = "ply\nply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n";
const PCD: &str = "pcd\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n\
    DATA ascii\n5.1 0.1 2.1\n5.1 0.1 2.3\n";
const DAE: &str = "dae\n<COLLADA><asset><unit meter='0.5'/></asset><library_geometries><geometry id='g'><mesh>\
    <source id='p'><float_array>0 0 1 1 0 1 1 1 1 0 1 1</float_array></source><vertices id='v'><input \
    semantic='POSITION' source='#p'/></vertices><polylist><input semantic='VERTEX' source='#v' offset='0'/>\
    <vcount>4</vcount><p>0 1 2 3</p></polylist></mesh></geometry></library_geometries><library_visual_scenes>\
    <visual_scene id='s'><node><translate>0 0 1</translate><rotate>0 0 1 90</rotate><instance_geometry url='#g'/>\
    </node></visual_scene></library_visual_scenes><scene><instance_visual_scene url='#s'/></scene></COLLADA>";
/// A picture of 3 x 3 grey dots, the middle one white.
const PNG: [u8; 74] = [
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 3, 0, 0, 0, 3, 8, 0, 0, 0, 0, 115,
    67, 234, 99, 0, 0, 0, 17, 73, 68, 65, 84, 120, 156, 99, 96, 224, 100, 96, 224, 252, 15, 34, 24, 0, 6,
    222, 1, 36, 74, 172, 212, 79, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let packed = [
        b"pcd\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_compressed\n".as_slice(),
        &[13, 0, 0, 0, 12, 0, 0, 0, 11, 51, 51, 163, 64, 205, 204, 204, 61, 102, 102, 6, 64],
    ];
    vec![
        ("stl", STL.into()),
        ("obj", OBJ.into()),
        ("ply", PLY.into()),
        ("pcd", PCD.into()),
        ("pcd-packed", packed.concat()),
        ("dae", DAE.into()),
        ("raw", b"raw\n\x00\x01\x02\x03".to_vec()),
        ("png", [b"png\n".as_slice(), &PNG].concat()),
    ]
}
