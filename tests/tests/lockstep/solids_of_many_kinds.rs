//! Vehicles keep from all that stands in a world made for Gazebo: models in models, meshes, round solids, one
//! who walks.

use std::fs;
use std::path::Path;

use skein_tests::{flight, fly};

/// A mast with a sign, included by a gate that the world includes: two models deep, from folders beside the
/// world.
const MAST: &str = "<sdf version='1.9'><model name='mast'><static>1</static>
<link name='pole'><pose>0 0 2.5 0 0 0</pose><collision name='c'><geometry><cylinder><radius>0.3</radius><length>5</length>
</cylinder></geometry></collision></link></model></sdf>";
const GATE: &str = "<sdf version='1.9'><model name='gate'><static>1</static><frame name='middle'><pose>0 2 0 0 0 0</pose></frame>
<include><uri>model://mast</uri><name>left</name><pose relative_to='middle'>0 2 0 0 0 0</pose></include>
<include><uri>model://mast</uri><name>right</name><pose relative_to='middle'>0 -2 0 0 0 0</pose></include>
</model></sdf>";
/// The gate's right mast, the mesh, and the rest stand on the straight way along y = 0.
const WORLD: &str = "<sdf version='1.9'><world name='yard'>
<include><uri>model://sun</uri></include><include><uri>model://ground_plane</uri></include>
<include><uri>model://gate</uri><pose>6 0 0 0 0 0</pose></include>
<model name='house'><static>1</static><pose>12 0 0 0 0 0</pose><link name='l'><collision name='c'><geometry><mesh>
<uri>house.obj</uri></mesh></geometry></collision></link></model>
<model name='tank'><static>1</static><pose>19 0 2.5 0 0 0</pose><link name='l'><collision name='c'><geometry><capsule>
<radius>1.2</radius><length>2.6</length></capsule></geometry></collision></link></model>
<model name='rock'><static>1</static><pose>25 0.5 1.5 0 0 0</pose><link name='l'><collision name='c'><geometry><ellipsoid>
<radii>1.5 1.2 3</radii></ellipsoid></geometry></collision></link></model>
<model name='roof'><static>1</static><pose>31 -0.5 4 0 0 0</pose><link name='l'><collision name='c'><geometry><cone>
<radius>2</radius><length>8</length></cone></geometry></collision></link></model>
<model name='tower'><static>1</static><pose>37 0 0 0 0 0</pose><link name='l'><collision name='c'><geometry><polyline>
<point>-1 -1</point><point>1 -1</point><point>1 1</point><point>0 2</point><point>-1 1</point><height>6</height>
</polyline></geometry></collision></link></model>
<actor name='walker'><skin/><script><loop>true</loop><trajectory id='0'>
<waypoint><time>0</time><pose>15.5 -6 1 0 0 0</pose></waypoint><waypoint><time>20</time><pose>15.5 6 1 0 0 0</pose></waypoint>
<waypoint><time>40</time><pose>15.5 -6 1 0 0 0</pose></waypoint></trajectory></script></actor>
</world></sdf>";
/// A block of 2 m by 3 m, 6 m high, of six faces.
const HOUSE: &str = "v -1 -1.5 0\nv 1 -1.5 0\nv 1 1.5 0\nv -1 1.5 0\nv -1 -1.5 6\nv 1 -1.5 6\nv 1 1.5 6\nv -1 1.5 6\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
const SCENARIO: &str = "world = \"worlds/yard.sdf\"\ntime_limit_s = 180.0\n[[vehicle]]\nstart_m = [0, 0]\n\
    waypoints_m = [[43, 0, 3]]\n[[vehicle]]\nstart_m = [0, -4]\nwaypoints_m = [[43, -4, 3]]\n";

fn write(folder: &Path, files: &[(&str, &str)]) {
    for (name, text) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
}

#[test]
fn two_vehicles_fly_round_solids_of_every_kind() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        &[
            ("worlds/yard.sdf", WORLD),
            ("worlds/house.obj", HOUSE),
            ("models/gate/model.sdf", GATE),
            ("models/mast/model.sdf", MAST),
            ("yard.toml", SCENARIO),
        ],
    );
    for seed in 1..=3 {
        let summary = fly(flight(&folder.path().join("yard.toml").display().to_string(), seed));
        assert_eq!(summary.reason, None, "seed {seed}");
        assert_eq!(summary.collisions.obstacle, 0, "seed {seed}");
        assert!(
            summary.min_clearance_m.is_some_and(|clearance| clearance > 0.1),
            "{:?}",
            summary.min_clearance_m
        );
        // Who flew straight through would have flown 43 m.
        assert!(summary.path_length_m.max > 43.5, "{:?}", summary.path_length_m);
    }
}
