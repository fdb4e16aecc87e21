//! `skein-agent verify` at the command line: what it prints, and its exit codes.

#![cfg(feature = "zenoh")] // The program is built with it.

use std::process::{Command, Output};

use serde_json::Value;

fn verify(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skein-agent"));
    command.arg("verify").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_example_vehicle_holds_and_what_was_covered_is_told() {
    let output = verify(&["--config", "agent.toml", "--scene", "name", "--scene", "energy", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report = json(&output);
    assert_eq!(report["verified"], true);
    assert_eq!(report["vehicle"], "uav/1");
    let scenes = report["scenes"].as_array().unwrap();
    assert_eq!(scenes.len(), 2);
    assert!(scenes.iter().all(|scene| scene["violation"].is_null() && scene["complete"] == true));
    assert!(scenes[0]["bthreads"].as_array().unwrap().iter().any(|thread| thread["name"] == "one_name"));
    assert!(report["never_told"].as_array().unwrap().iter().any(|told| told["event"] == "uav/1/passage"));
}

#[test]
fn a_violation_is_told_with_the_way_there_and_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let nags = folder.path().join("nags.toml");
    let text = r#"
        name = "nags"
        about = "Orders again whenever it is declined."
        [[body]]
        repeat = "forever"
        do = [
            { sync = { request = { name = "{me}/order", data = { what = "goto" } } } },
            { sync = { wait = { any_data = "{me}/declined" } } },
        ]
    "#;
    std::fs::write(&nags, text).unwrap();
    let output = verify(&["--script", nags.to_str().unwrap(), "--scene", "scripts", "--json"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let violation = json(&output)["scenes"][0]["violation"].clone();
    assert!(violation["what"].as_str().unwrap().contains("without coming to rest"), "{violation}");
    assert!(!violation["again_and_again"].as_array().unwrap().is_empty());
}

#[test]
fn a_script_that_blocks_a_safety_event_is_refused_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keeps.json");
    std::fs::write(&file, r#"{"name": "keeps", "about": "Keeps it up.", "body": [{"sync": {"block": {"any_data": "{me}/land"}}}]}"#)
        .unwrap();
    let output = verify(&["--script", file.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(json(&output)["refused"].as_str().unwrap().contains("uav/1/land"));
}

#[test]
fn wrong_input_ends_with_2_and_names_what_was_expected() {
    for (arguments, expected) in [
        (&["--scene", "nowhere"][..], "expected one of launch"),
        (&["--network", "nothing"], "expected one of alternating gate"),
        (&["--config", "no-such-file.toml"], "no-such-file.toml"),
        (&["--network", "--scene", "launch"], "cannot be used with"),
    ] {
        let output = verify(arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {told}");
        assert!(told.contains(expected), "{arguments:?}: {told}");
    }
}

#[test]
fn as_many_states_as_are_looked_at_unless_given_find_what_is_deepest() {
    let network = json(&verify(&["--network", "asked again", "--json"]))["networks"][0].clone();
    assert!(network["must_hold"] == false && network["as_expected"] == true, "{network}");
}

#[test]
fn a_network_tells_its_moves() {
    let output = verify(&["--network", "naive right of way", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let network = json(&output)["networks"][0].clone();
    assert!(network["must_hold"] == false && network["as_expected"] == true, "{network}");
    assert!(network["violation"]["trace"].as_array().unwrap().len() <= 3, "{network}");
}

#[test]
fn the_states_of_a_scene_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("name.dot");
    let output = verify(&["--scene", "name", "--states", "50", "--dot", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(std::fs::read_to_string(&file).unwrap().starts_with("digraph"));
}
