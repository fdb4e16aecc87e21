//! Models that a Gazebo world includes from files of their own.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use skein_world::{Reading, Scene, SdfError, Verdict};

const TREE: &str = "<sdf version='1.9'><model name='tree'><static>1</static><frame name='top'><pose>0 0 6 0 0 0</pose>\
    </frame><link name='trunk'><pose>0 0 3 0 0 0</pose><collision name='c'><geometry><cylinder><radius>0.3</radius>\
    <length>6</length></cylinder></geometry></collision></link></model></sdf>";

fn folder(files: &[(&str, &str)]) -> BTreeMap<String, Vec<u8>> {
    files.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec())).collect()
}

fn try_read(content: &str, files: &[(&str, &str)]) -> Result<Reading, SdfError> {
    let text = format!("<sdf version='1.9'><world name='w'>\n{content}\n</world></sdf>");
    Scene::from_sdf(&text, "test.sdf", &folder(files))
}

fn places(content: &str, files: &[(&str, &str)]) -> BTreeMap<String, Vector3<f64>> {
    let reading = try_read(content, files).expect("a sound world");
    let (scene, _) = reading.whole().expect("a whole world");
    scene.obstacles().iter().map(|solid| (solid.name.clone(), solid.pose.translation.vector)).collect()
}

#[test]
fn an_included_model_has_the_name_and_the_pose_that_it_is_given() {
    let content = "<include><uri>model://tree</uri><name>oak</name><pose>8 0 0 0 0 0</pose></include>\
        <include><uri>model://tree/model.sdf</uri><pose>9 1 0 0 0 0</pose></include>\
        <include><uri>model://tree</uri><name>hung</name><placement_frame>top</placement_frame>\
        <pose relative_to='oak'>4 0 5 0 0 0</pose></include>";
    let places = places(content, &[("tree/model.sdf", TREE)]);
    assert_eq!(places.get("oak::trunk::c"), Some(&Vector3::new(8.0, 0.0, 3.0)));
    assert_eq!(places.get("tree::trunk::c"), Some(&Vector3::new(9.0, 1.0, 3.0)));
    assert_eq!(places.get("hung::trunk::c"), Some(&Vector3::new(12.0, 0.0, 2.0)));
}

#[test]
fn the_configuration_of_a_model_names_its_file_for_the_newest_format() {
    let config = "<?xml version='1.0'?><model><name>tree</name><sdf version='1.5'>old.sdf</sdf>\
        <sdf version='1.10'>older.sdf</sdf><sdf version='1.9'>new.sdf</sdf></model>";
    let files = [("tree/model.config", config), ("tree/new.sdf", TREE)];
    assert_eq!(places("<include><uri>model://tree</uri></include>", &files).len(), 1);
}

#[test]
fn models_in_models_stand_where_those_have_them_and_a_merged_one_lends_its_parts() {
    let gate = "<sdf version='1.9'><model name='gate'><static>1</static>\
        <include><uri>model://tree</uri><name>left</name><pose>0 2 0 0 0 0</pose></include>\
        <include merge='true'><uri>model://tree</uri><pose>0 -2 0 0 0 0</pose></include>\
        <link name='beam'><pose relative_to='trunk'>0 2 2 0 0 0</pose><collision name='c'><geometry><sphere>\
        <radius>1</radius></sphere></geometry></collision></link></model></sdf>";
    let content = "<include><uri>model://gate</uri><pose>20 0 0 0 0 0</pose></include>";
    let places = places(content, &[("tree/model.sdf", TREE), ("gate/model.sdf", gate)]);
    assert_eq!(places.get("gate::left::trunk::c"), Some(&Vector3::new(20.0, 2.0, 3.0)));
    assert_eq!(places.get("gate::trunk::c"), Some(&Vector3::new(20.0, -2.0, 3.0)));
    assert_eq!(places.get("gate::beam::c"), Some(&Vector3::new(20.0, 0.0, 5.0)));
}

#[test]
fn what_is_missing_is_named_and_what_every_gazebo_has_is_not() {
    let content = "<include><uri>model://sun</uri></include><include><uri>model://ground_plane</uri></include>\
        <include><uri>https://server.invalid/1.0/me/models/Ground Plane</uri></include>\n\
        <include><uri>model://barn</uri><name>red</name></include>";
    let reading = try_read(content, &[]).expect("a sound world");
    let refused: Vec<_> = reading.account.refused().map(ToString::to_string).collect();
    assert_eq!(refused.len(), 1, "{refused:?}");
    assert!(refused[0].starts_with("test.sdf:3:1: included model `model://barn` is not there"));
    let honoured = reading.account.entries.iter().filter(|entry| entry.verdict == Verdict::Honoured);
    assert!(
        honoured.clone().any(|entry| entry.element == "world/include"),
        "{:?}",
        honoured.collect::<Vec<_>>()
    );
}

#[test]
fn models_that_include_themselves_or_one_another_many_times_over_are_refused() {
    let endless = "<sdf version='1.9'><model name='m'><include><uri>model://m</uri></include></model></sdf>";
    let error = try_read("<include><uri>model://m</uri></include>", &[("m/model.sdf", endless)]);
    assert!(matches!(error, Err(SdfError::TooDeep { .. })), "{error:?}");
    let level = |n: usize| {
        let below = format!("<include><uri>model://m{}</uri></include>", n - 1).repeat(10);
        (format!("m{n}/model.sdf"), format!("<sdf version='1.9'><model name='m'>{below}</model></sdf>"))
    };
    let mut files: Vec<(String, String)> = (1..20).map(level).collect();
    files.push(("m0/model.sdf".to_owned(), TREE.to_owned()));
    let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    let error = try_read("<include><uri>model://m19</uri></include>", &files);
    assert!(matches!(error, Err(SdfError::TooMany { .. })), "{error:?}");
}

#[test]
fn a_fault_in_an_included_file_is_named_with_its_place_there() {
    let broken = TREE.replace("<radius>0.3</radius>", "\n<radius>wide</radius>");
    let error = try_read("<include><uri>model://tree</uri></include>", &[("tree/model.sdf", &broken)]);
    let error = error.expect_err("no radius").to_string();
    assert!(error.starts_with("tree/model.sdf:2:1: <radius> holds `wide`"), "{error}");
}
