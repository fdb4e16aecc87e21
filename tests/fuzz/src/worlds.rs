//! Worlds: those of Gazebo (SDF), and boxes (CSV).

use nalgebra::Vector3;
use skein_world::Scene;

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "worlds", allowed: Allowed { bytes: 64 << 10, per_byte: 300 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    let sdf = Scene::from_sdf(text, "fuzzed.sdf").ok().map(|(scene, _)| scene);
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

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let csv = "x,y,z,dx,dy,dz\n# trees\n2,0,1.25,0.5,0.5,2.5\n-3.5,4,1,1,1,2\n1e1,0,1,1,1,2\n";
    vec![("sdf", SDF.into()), ("csv", csv.into())]
}
