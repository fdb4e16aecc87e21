//! The solids of a Gazebo world: beams and distances meet what Gazebo has there.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use skein_world::{Lacking, Scene};

/// A roof of two faces, from 2 m up at y = -1 and y = 1 to 3 m at its ridge, along x from -2 to 2.
const ROOF_OBJ: &str = "o roof\nv -2 -1 2\nv 2 -1 2\nv 2 0 3\nv -2 0 3\nv 2 1 2\nv -2 1 2\n\
    f 1 2 3 4\nf 4 3 5 6\no chimney\nv 0 0 3\nv 0.2 0 4\nv 0 0.2 4\nf 7 8 9\n";
const ROOF_STL: &str = "solid roof\nfacet normal 0 0 1\nouter loop\nvertex -2 -1 2\nvertex 2 -1 2\nvertex 2 1 2\n\
    endloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex -2 -1 2\nvertex 2 1 2\nvertex -2 1 2\nendloop\n\
    endfacet\nendsolid roof\n";
/// A sheet of 4 by 2 units, a unit being 0.5 m, lifted by 3 units and stretched to 8 along x.
const SHEET_DAE: &str = "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema'><asset><unit meter='0.5'/>\
    <up_axis>Z_UP</up_axis></asset><library_geometries><geometry id='g' name='sheet'><mesh><source id='p'>\
    <float_array id='a' count='12'>-2 -1 0 2 -1 0 2 1 0 -2 1 0</float_array><technique_common><accessor source='#a' \
    count='4' stride='3'/></technique_common></source><vertices id='v'><input semantic='POSITION' source='#p'/>\
    </vertices><polylist count='1'><input semantic='VERTEX' source='#v' offset='0'/><input semantic='NORMAL' \
    source='#n' offset='1'/><vcount>4</vcount><p>0 9 1 9 2 9 3 9</p></polylist></mesh></geometry>\
    </library_geometries><library_visual_scenes><visual_scene id='s'><node id='n' name='lifted'><translate>0 0 3\
    </translate><scale>2 1 1</scale><instance_geometry url='#g'/></node></visual_scene></library_visual_scenes>\
    <scene><instance_visual_scene url='#s'/></scene></COLLADA>";

fn files() -> BTreeMap<String, Vec<u8>> {
    [("roof.obj", ROOF_OBJ), ("roof.stl", ROOF_STL), ("sheet.dae", SHEET_DAE)]
        .into_iter()
        .map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec()))
        .chain([
            ("hill.raw".to_owned(), vec![0, 0, 0, 0, 200, 0, 0, 0, 0]),
            ("bad.stl".to_owned(), vec![b'x'; 90]),
        ])
        .collect()
}

fn try_read(pose: &str, geometry: &str) -> Result<Scene, Box<Lacking>> {
    let text = format!(
        "<sdf version='1.11'><world name='w'><model name='m'><static>1</static><pose>{pose}</pose><link name='l'>\
         <collision name='c'><geometry>{geometry}</geometry></collision></link></model></world></sdf>"
    );
    let reading = Scene::from_sdf(&text, "test.sdf", &files()).expect("a sound file");
    reading.whole().map(|(scene, _)| scene).map_err(Box::new)
}

/// A solid at (10, 0, 0).
fn read(geometry: &str) -> Scene {
    try_read("10 0 0 0 0 0", geometry).expect("a whole world")
}

#[track_caller]
fn meets(scene: &Scene, from: [f64; 3], along: [f64; 3], range_m: Option<f64>) {
    let (from, along) = (Point3::from(from), Vector3::from(along).normalize());
    let met = scene.cast_ray(&from, &along, 50.0);
    let is_right = match (met, range_m) {
        (Some(met), Some(range_m)) => (met - range_m).abs() < 0.02,
        (met, range_m) => met.is_none() && range_m.is_none(),
    };
    assert!(is_right, "from {from:?} along {along:?}: met {met:?}, not {range_m:?}");
}

const EAST: [f64; 3] = [1.0, 0.0, 0.0];
const DOWN: [f64; 3] = [0.0, 0.0, -1.0];

#[test]
fn round_solids_are_met_at_their_surface() {
    let capsule = read("<capsule><radius>1</radius><length>4</length></capsule>");
    meets(&capsule, [0.0, 0.0, 1.0], EAST, Some(9.0));
    meets(&capsule, [10.0, 0.0, 9.0], DOWN, Some(6.0));
    meets(&capsule, [0.0, 0.0, 2.8], EAST, Some(10.0 - 0.6));
    let ellipsoid = read("<ellipsoid><radii>3 1 2</radii></ellipsoid>");
    meets(&ellipsoid, [0.0, 0.0, 0.5], EAST, Some(10.0 - 3.0 * (1.0_f64 - 0.0625).sqrt()));
    meets(&ellipsoid, [10.0, 0.0, 9.0], DOWN, Some(7.0));
    let cone = read("<cone><radius>2</radius><length>6</length></cone>");
    meets(&cone, [0.0, 0.0, 1.0], EAST, Some(10.0 - 4.0 / 6.0));
    meets(&cone, [10.0, 0.0, 9.0], DOWN, Some(6.0));
}

#[test]
fn an_outline_is_solid_but_for_its_notch() {
    let outline = "<polyline><point>-2 -2</point><point>2 -2</point><point>2 2</point><point>0 0</point>\
        <point>-2 2</point><height>3</height></polyline>";
    let scene = read(outline);
    meets(&scene, [0.0, -1.0, 1.0], EAST, Some(8.0));
    meets(&scene, [10.0, 9.0, 1.0], [0.0, -1.0, 0.0], Some(9.0));
    meets(&scene, [0.0, 0.0, 3.5], EAST, None);
    assert!(scene.clearance(&Vector3::new(10.0, -1.0, 1.0)) < 0.0);
}

#[test]
fn meshes_are_met_at_their_faces_and_are_free_inside() {
    let roof = read("<mesh><uri>roof.obj</uri></mesh>");
    meets(&roof, [11.0, 0.5, 9.0], DOWN, Some(6.5));
    meets(&roof, [11.0, 0.5, 1.0], [0.0, 0.0, 1.0], Some(1.5));
    assert!(roof.clearance(&Vector3::new(10.0, 0.0, 1.0)) > 0.9);
    let flat = read("<mesh><uri>roof.stl</uri><scale>1 2 2</scale></mesh>");
    meets(&flat, [11.0, 1.9, 9.0], DOWN, Some(5.0));
    meets(&flat, [11.0, 2.1, 9.0], DOWN, Some(9.0));
    let sheet = read("<mesh><uri>sheet.dae</uri></mesh>");
    meets(&sheet, [11.9, 0.4, 9.0], DOWN, Some(7.5));
    meets(&sheet, [12.1, 0.4, 9.0], DOWN, Some(9.0));
}

#[test]
fn a_submesh_is_met_alone_and_about_its_own_middle_where_it_is_asked_to_be() {
    let part = |inside: &str| {
        format!("<mesh><uri>roof.obj</uri><submesh><name>roof</name>{inside}</submesh></mesh>")
    };
    meets(&read(&part("")), [11.0, 0.5, 9.0], DOWN, Some(6.5));
    meets(&read(&part("<center>true</center>")), [11.0, 0.5, 9.0], DOWN, Some(9.0));
    let scene = try_read("10 0 2 0 0 0", &part("<center>1</center>")).expect("a whole world");
    meets(&scene, [11.0, 0.5, 9.0], DOWN, Some(7.0));
    let node = "<mesh><uri>sheet.dae</uri><submesh><name>lifted</name></submesh></mesh>";
    meets(&read(node), [11.9, 0.4, 9.0], DOWN, Some(7.5));
}

#[test]
fn a_heightmap_is_solid_below_its_surface() {
    let hill = read("<heightmap><uri>hill.raw</uri><size>20 20 5</size><pos>0 0 1</pos></heightmap>");
    meets(&hill, [10.0, 0.0, 9.0], DOWN, Some(3.0));
    meets(&hill, [15.0, 0.0, 9.0], DOWN, Some(5.5));
    assert!(hill.clearance(&Vector3::new(10.0, 0.0, 2.0)) < 0.0);
}

#[test]
fn where_a_heightmap_lies_on_the_ground_it_is_the_ground() {
    let mut files = files();
    let mut heights = vec![0; 81];
    heights[8] = 255;
    files.insert("corner.raw".to_owned(), heights);
    let clearance = |z: f64| {
        let text = format!(
            "<sdf version='1.9'><world name='w'><model name='m'><static>1</static><pose>0 0 {z} 0 0 0</pose>\
             <link name='l'><collision name='c'><geometry><heightmap><uri>corner.raw</uri><size>80 80 9</size>\
             </heightmap></geometry></collision></link></model></world></sdf>"
        );
        let reading = Scene::from_sdf(&text, "test.sdf", &files).expect("a sound file");
        let (scene, _) = reading.whole().expect("a whole world");
        (scene.clearance(&Vector3::new(-10.0, -10.0, 0.25)), scene.clearance(&Vector3::new(39.5, 39.5, 6.0)))
    };
    let (on_the_flat, in_the_corner) = clearance(0.0);
    assert!(on_the_flat > 20.0 && in_the_corner < 0.0, "{on_the_flat} {in_the_corner}");
    assert!(clearance(1.0).0 < 0.0);
}

#[test]
fn what_cannot_be_solid_is_refused_by_name() {
    for (geometry, expected) in [
        ("<mesh><uri>gone.dae</uri></mesh>", "the mesh `gone.dae` of `l::c` is not there"),
        (
            "<mesh><uri>hill.raw</uri></mesh>",
            "cannot be solid: expected a name that ends in .stl, .obj or .dae",
        ),
        ("<mesh><uri>bad.stl</uri></mesh>", "the mesh `bad.stl` of `l::c` cannot be solid"),
        (
            "<mesh><uri>roof.obj</uri><submesh><name>door</name></submesh></mesh>",
            "there is no part `door` in it",
        ),
        ("<heightmap><uri>roof.obj</uri><size>1 1 1</size></heightmap>", "the heightmap `roof.obj`"),
        (
            "<polyline><point>0 0</point><point>1 1</point><height>1</height></polyline>",
            "expected 3 to 10000 corners",
        ),
    ] {
        let lacking = try_read("0 0 0 0 0 0", geometry).expect_err("no solid").to_string();
        assert!(lacking.starts_with("test.sdf:1:") && lacking.contains(expected), "{lacking}");
    }
}
