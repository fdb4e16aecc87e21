//! Where the solids of a Gazebo world stand: frames, placement, saved states, ways of actors.

use std::time::Duration;

use nalgebra::Vector3;
use skein_world::{NoFiles, Scene, SdfError, Shape};

fn try_read(content: &str) -> Result<Scene, SdfError> {
    let text = format!("<sdf version='1.9'><world name='w'>\n{content}\n</world></sdf>");
    let reading = Scene::from_sdf(&text, "test.sdf", &NoFiles)?;
    Ok(reading.whole().expect("a whole world").0)
}

fn read(content: &str) -> Scene {
    try_read(content).expect("a sound world")
}

fn ball(name: &str, attributes: &str, inside: &str) -> String {
    format!(
        "<model name='{name}' {attributes}><static>1</static>{inside}<link name='l'><collision name='c'><geometry>\
         <sphere><radius>1</radius></sphere></geometry></collision></link></model>"
    )
}

#[track_caller]
fn stands_at(scene: &Scene, name: &str, place: [f64; 3]) {
    let solid = scene.obstacles().iter().find(|solid| solid.name == name);
    let at = solid.map(|solid| solid.pose.translation.vector);
    let is_there = at.is_some_and(|at| (at - Vector3::from(place)).norm() < 1e-9);
    assert!(is_there, "{name} is at {at:?}, not at {place:?}");
}

#[test]
fn poses_are_relative_to_the_frames_that_they_name() {
    let scene = read(
        &[
            "<frame name='site'><pose>10 0 0 0 0 1.5707963267948966</pose></frame>",
            "<frame name='gate' attached_to='tower'><pose>0 0 4 0 0 0</pose></frame>",
            &ball("tower", "", "<pose relative_to='site'>5 0 2 0 0 0</pose>"),
            &ball("lamp", "", "<pose relative_to='gate'>1 0 0 0 0 0</pose>"),
            &ball("guest", "", "<pose relative_to='tower::l'>0 0 -1 0 0 0</pose>"),
        ]
        .concat(),
    );
    stands_at(&scene, "tower::l::c", [10.0, 5.0, 2.0]);
    stands_at(&scene, "lamp::l::c", [10.0, 6.0, 6.0]);
    stands_at(&scene, "guest::l::c", [10.0, 5.0, 1.0]);
}

#[test]
fn a_placement_frame_is_what_the_pose_is_the_place_of() {
    let inside = "<pose>20 0 9 0 0 0</pose><frame name='tip' attached_to='mid'><pose>0 0 3 0 0 0</pose></frame>\
                  <frame name='mid'><pose>0 0 2 0 0 0</pose></frame>";
    stands_at(&read(&ball("mast", "placement_frame='tip'", inside)), "mast::l::c", [20.0, 0.0, 4.0]);
    let inner = ball("inner", "placement_frame='l'", "<pose>0 0 1 0 0 0</pose>");
    let outer =
        format!("<model name='outer' placement_frame='inner::l'><pose>7 0 0 0 0 0</pose>{inner}</model>");
    stands_at(&read(&outer), "outer::inner::l::c", [7.0, 0.0, 0.0]);
}

#[test]
fn links_collisions_and_joints_may_be_relative_to_one_another() {
    let scene = read(
        "<model name='m'><static>1</static><pose>1 0 0 0 0 0</pose>\
         <joint name='hinge' type='fixed'><child>arm</child><parent>base</parent><pose>0 2 0 0 0 0</pose></joint>\
         <link name='base'><pose>0 0 5 0 0 0</pose></link>\
         <link name='arm'><pose relative_to='base'>3 0 0 0 0 0</pose>\
         <collision name='near'><pose relative_to='base'>0 1 0 0 0 0</pose><geometry><sphere><radius>1</radius>\
         </sphere></geometry></collision>\
         <collision name='far'><pose relative_to='hinge'>0 0 0.5 0 0 0</pose><geometry><sphere><radius>1</radius>\
         </sphere></geometry></collision></link></model>",
    );
    stands_at(&scene, "m::arm::near", [1.0, 1.0, 5.0]);
    stands_at(&scene, "m::arm::far", [4.0, 2.0, 5.5]);
}

#[test]
fn frames_that_are_not_there_or_lead_in_a_circle_are_refused_with_their_place() {
    let lost = ball("m", "", "<pose relative_to='elsewhere'>1 0 0 0 0 0</pose>");
    let error = try_read(&lost).expect_err("no such frame").to_string();
    assert!(error.starts_with("test.sdf:2:") && error.contains("there is no frame `elsewhere`"), "{error}");
    let circle =
        "<frame name='a'><pose relative_to='b'/></frame><frame name='b'><pose relative_to='a'/></frame>";
    let error =
        try_read(&format!("{circle}{}", ball("m", "", "<pose relative_to='a'/>"))).expect_err("a circle");
    assert!(matches!(error, SdfError::Circle { .. }), "{error}");
    let own = ball("m", "placement_frame='f'", "<frame name='f'><pose relative_to='world'/></frame>");
    assert!(try_read(&own).is_err());
}

#[test]
fn a_long_chain_of_frames_is_followed_to_its_end() {
    let links: String = (1..20_000)
        .map(|n| format!("<frame name='f{n}' attached_to='f{}'><pose>0.001 0 0 0 0 0</pose></frame>", n - 1))
        .collect();
    let content = format!(
        "<frame name='f0'/>{links}{}",
        ball("m", "", "<pose relative_to='f19999'>0 0 0 0 0 0</pose>")
    );
    let at = read(&content).obstacles()[0].pose.translation.x;
    assert!((at - 19.999).abs() < 1e-6, "{at}");
}

#[test]
fn a_saved_state_moves_scales_adds_and_removes_models() {
    let scene = read(
        "<model name='crate'><static>1</static><pose>0 40 1 0 0 0</pose><link name='l'><collision name='c'>\
         <pose>0 0 1 0 0 0</pose><geometry><box><size>2 2 2</size></box></geometry></collision></link>\
         <link name='lid'><collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry></collision>\
         </link></model>\
         <model name='gone'><link name='l'><collision name='c'><geometry><sphere><radius>1</radius></sphere>\
         </geometry></collision></link></model>\
         <state world_name='w'><sim_time>7 0</sim_time><model name='crate'><pose>12 -2 1 0 0 1.5707963267948966</pose>\
         <scale>1 1 2</scale><link name='lid'><pose>12 -2 6 0 0 0</pose></link></model>\
         <insertions><model name='new'><static>1</static><pose>30 0 0 0 0 0</pose><link name='l'><collision name='c'>\
         <geometry><sphere><radius>1</radius></sphere></geometry></collision></link></model></insertions>\
         <deletions><name>gone</name></deletions></state>",
    );
    stands_at(&scene, "crate::l::c", [12.0, -2.0, 2.0]);
    stands_at(&scene, "crate::lid::c", [12.0, -2.0, 6.0]);
    stands_at(&scene, "new::l::c", [30.0, 0.0, 0.0]);
    assert_eq!(scene.obstacles().len(), 3);
    let half_extents = Vector3::new(1.0, 1.0, 2.0);
    assert_eq!(scene.obstacles()[0].shape, Shape::Box { half_extents });
}

#[test]
fn an_actor_walks_from_place_to_place_in_its_time() {
    let mut scene = read(
        "<actor name='walker'><skin><filename>walk.dae</filename></skin><script><loop>true</loop>\
         <delay_start>1</delay_start><trajectory id='0' type='walk'>\
         <waypoint><time>0</time><pose>0 5 1 0 0 0</pose></waypoint>\
         <waypoint><time>4</time><pose>8 5 1 0 0 0</pose></waypoint></trajectory></script></actor>",
    );
    assert_eq!(scene.moving().count(), 1);
    for (seconds, x) in [(0.0, 0.0), (3.0, 4.0), (5.5, 0.0)] {
        scene.move_on(Duration::from_secs_f64(seconds));
        let body = Vector3::new(x, 5.0, 1.5);
        assert!(
            scene.clearance(&body) < 0.0 && scene.clearance(&(body + Vector3::y())) > 0.5,
            "at {seconds} s"
        );
    }
}

#[test]
fn the_wind_of_a_world_blows() {
    assert_eq!(
        read("<wind><linear_velocity>3 -1 0</linear_velocity></wind>").wind(),
        Vector3::new(3.0, -1.0, 0.0)
    );
}
