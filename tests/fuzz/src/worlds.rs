//! Worlds: those of Gazebo (SDF), which include and name other files, and boxes (CSV).

use std::collections::BTreeMap;

use nalgebra::Vector3;
use skein_world::Scene;

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "worlds", allowed: Allowed { bytes: 64 << 10, per_byte: 300 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    let files: BTreeMap<String, Vec<u8>> = [("m/model.sdf", MODEL), ("roof.stl", ROOF)]
        .map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec()))
        .into();
    let sdf = Scene::from_sdf(text, "fuzzed.sdf", &files).ok().map(|reading| reading.without_missing().0);
    let csv = Scene::from_csv(text, "fuzzed.csv").ok();
    let scenes: Vec<Scene> = sdf.into_iter().chain(csv).collect();
    for scene in &scenes {
        let clearance = scene.clearance(&Vector3::new(1.0, 2.0, 3.0));
        assert!(!clearance.is_nan());
    }
    match scenes.is_empty() {
        true => Reached::Refused,
        false => Reached::read(scenes.iter().any(|scene| scene.obstacles().len() == 7)),
    }
}

const SDF: &str = "<?xml version='1.0'?>
<sdf version='1.6'><world name='yard'>
<include><uri>model://ground_plane</uri></include>
<spherical_coordinates><latitude_deg>47.4</latitude_deg><longitude_deg>8.5</longitude_deg>
<elevation>488</elevation></spherical_coordinates>
<model name='m'><static>true</static><pose>1 2 0 0 0 0.5</pose><link name='l'>
<collision name='a'><geometry><box><size>1 2 3</size></box></geometry></collision>
<collision name='b'><pose>0 0 3 0 0 0</pose><geometry><cylinder><radius>0.5</radius><length>4</length></cylinder></geometry>
</collision>
<collision name='c'><geometry><sphere><radius>2</radius></sphere></geometry></collision>
<!-- a ceiling -->
<collision name='d'><geometry><plane><normal>0 0 -1</normal></plane></geometry></collision>
</link></model></world></sdf>
";

/// A world of all else that is read: frames, included models, a saved state, an actor, solids of many faces.
const GAZEBO: &str = "<sdf version='1.9'><world name='w'><wind><linear_velocity>1 0 0</linear_velocity></wind>
<frame name='f'><pose>1 0 0 0 0 0</pose></frame><frame name='g' attached_to='f'/>
<include><uri>model://m</uri><name>n</name><pose relative_to='g'>0 0 1 0 0 0</pose></include>
<model name='o' placement_frame='l'><pose relative_to='n'>0 0 1 0 0 0</pose><link name='l'>
<collision name='a'><geometry><capsule><radius>1</radius><length>2</length></capsule></geometry></collision>
<collision name='b'><geometry><mesh><uri>roof.stl</uri><scale>1 1 2</scale></mesh></geometry></collision>
<collision name='c'><geometry><polyline><point>0 0</point><point>1 0</point><point>0 1</point><height>1</height>
</polyline></geometry></collision></link></model>
<actor name='p'><skin/><script><trajectory id='0'><waypoint><time>0</time><pose>0 0 1 0 0 0</pose></waypoint>
<waypoint><time>2</time><pose>4 0 1 0 0 0</pose></waypoint></trajectory></script></actor>
<state world_name='w'><model name='o'><pose>3 0 0 0 0 0</pose><scale>1 1 2</scale></model></state></world></sdf>
";
const MODEL: &str =
    "<sdf version='1.9'><model name='m'><static>1</static><link name='l'><collision name='c'><geometry>
<sphere><radius>1</radius></sphere></geometry></collision></link></model></sdf>";
const ROOF: &str = "solid r\nfacet normal 0 0 1\nouter loop\nvertex 0 0 2\nvertex 1 0 2\nvertex 0 1 2\nendloop\n\
    endfacet\nendsolid r\n";

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let csv = "x,y,z,dx,dy,dz\n# trees\n2,0,1.25,0.5,0.5,2.5\n-3.5,4,1,1,1,2\n1e1,0,1,1,1,2\n";
    vec![("sdf", SDF.into()), ("gazebo", GAZEBO.into()), ("csv", csv.into())]
}
