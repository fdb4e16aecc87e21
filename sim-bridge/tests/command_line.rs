//! The program as a user meets it: exit codes, and errors that name what is wrong.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn skein_sim(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_skein-sim")).args(arguments).output().expect("the program starts")
}

/// Exits with 2 and an error that has all of these words.
fn assert_refused(arguments: &[&str], words: &[&str]) {
    let output = skein_sim(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
    for word in words {
        assert!(error.contains(word), "{arguments:?}: `{word}` is not in: {error}");
    }
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let file = folder.join(name);
    std::fs::write(&file, text).expect("the folder can be written to");
    file.to_string_lossy().into_owned()
}

#[test]
fn an_unknown_scenario_is_answered_with_the_known_ones() {
    assert_refused(&["fly", "florest"], &["florest", "forest", "antipodal", "window", "open"]);
}

#[test]
fn no_vehicles_is_no_swarm() {
    assert_refused(&["fly", "open", "--vehicles", "0"], &["no vehicles", "at least 1"]);
}

#[test]
fn malformed_files_are_refused_by_file_and_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = write(folder.path(), "bad.toml", "name = \"bad\"\ncruise_speed_m_s = \"fast\"\n");
    assert_refused(&["fly", &scenario], &["bad.toml:2", "cruise_speed_m_s"]);
    let world = write(
        folder.path(),
        "bad.world",
        "<sdf version='1.6'>\n<world name='w'>\n<!-- <model>\n</world></sdf>\n",
    );
    assert_refused(&["fly", "open", "--world", &world], &["bad.world:3"]);
    let plan = write(folder.path(), "bad.plan", "{\n\"fileType\": \"Plan\",\n\"mission\": oops\n}");
    assert_refused(&["fly", "open", "--mission", &plan], &["bad.plan:3"]);
}

#[test]
fn a_start_inside_an_obstacle_is_refused_by_both_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[9.0, 0.0, 3.0]]\n\
                [[obstacle]]\nname = \"hut\"\ncentre_m = [0.0, 0.0, 1.0]\nbox_m = [2.0, 2.0, 2.0]\n";
    let scenario = write(folder.path(), "inside.toml", text);
    assert_refused(&["fly", &scenario, "--clock", "lockstep"], &["vehicle 1", "hut"]);
}

#[test]
fn an_unwritable_output_folder_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write(folder.path(), "in-the-way", "a file, not a folder");
    let out = format!("{file}/run");
    assert_refused(&["fly", "open", "--clock", "lockstep", "--out", &out], &["in-the-way", "--out"]);
}

#[test]
fn missing_gazebo_models_are_refused_by_name_unless_a_flag_lifts_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "<sdf version='1.6'><world name='w'>\n<include><uri>model://pine_tree</uri></include>\n</world></sdf>";
    let world = write(folder.path(), "trees.world", text);
    let output = skein_sim(&["check", &world, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    let is_there = |element: &serde_json::Value| element["file"] == world.as_str() && element["line"] == 2;
    let elements = said["elements"].as_array().expect("the elements");
    assert!(elements.iter().any(|element| element["verdict"] == "refused" && is_there(element)), "{said}");
    assert_refused(
        &["fly", "open", "--clock", "lockstep", "--world", &world],
        &["pine_tree", "--without-missing"],
    );
    let output = skein_sim(&["check", &world, "--without-missing"]);
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("pine_tree` is not there; left out"), "{said}");
}

#[test]
fn json_is_one_object_on_standard_output_on_failure_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_string_lossy().into_owned();
    let failing =
        ["fly", "open", "--clock", "lockstep", "--headless", "--controller", "none", "--json", "--out", &out];
    let output = skein_sim(&failing);
    assert_eq!(output.status.code(), Some(1));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(summary["succeeded"], false);
    assert!(summary["reason"].is_string());
    let output = skein_sim(&["fly", "florest", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    let error: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert!(error["error"].as_str().is_some_and(|error| error.contains("florest")));
}

#[test]
fn ctrl_c_lands_everyone_and_finishes_the_files() {
    let _turn = crate::turn::turn();
    let folder = tempfile::tempdir().expect("a folder");
    let mut program = Command::new(env!("CARGO_BIN_EXE_skein-sim"))
        .args(["fly", "open", "--clock", "real", "--speed", "2", "--headless", "--out"])
        .arg(folder.path())
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    // The recording exists from the start of the run; a little later the first vehicle is in the air.
    let recording = folder.path().join("mission.mcap");
    let began = Instant::now();
    while std::fs::metadata(&recording).map_or(0, |file| file.len()) < 200_000 {
        assert!(began.elapsed() < Duration::from_secs(60), "no recording grows");
        std::thread::yield_now();
    }
    let interrupted =
        Command::new("kill").args(["-INT", &program.id().to_string()]).status().expect("kill runs");
    assert!(interrupted.success());
    let status = program.wait().expect("the program ends");
    assert_eq!(status.code(), Some(1));
    let summary = std::fs::read_to_string(folder.path().join("summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("a whole summary");
    assert_eq!(summary["reason"], "interrupted");
    for vehicle in summary["per_vehicle"].as_array().expect("vehicles") {
        assert_ne!(vehicle["outcome"], "airborne", "{vehicle}");
    }
    let bytes = std::fs::read(recording).expect("a recording");
    assert!(bytes.ends_with(b"\x89MCAP0\r\n"), "the recording ends as MCAP files do");
}

#[test]
fn what_has_no_effect_with_another_option_is_refused() {
    let lockstep = ["fly", "open", "--clock", "lockstep"];
    let with = |option: &[&'static str]| [&lockstep[..], option].concat();
    assert_refused(&with(&["--speed", "2"]), &["--speed 2", "lockstep"]);
    assert_refused(&with(&["--launch-on-order"]), &["--launch-on-order", "lockstep"]);
}

#[test]
fn a_file_that_is_not_there_is_named_once_with_one_reason() {
    for arguments in [["check", "nowhere.toml"], ["fly", "nowhere.toml"]] {
        let error = String::from_utf8(skein_sim(&arguments).stderr).expect("text");
        assert_eq!(error.matches("No such file").count(), 1, "{error}");
        assert_eq!(error.matches("nowhere.toml").count(), 1, "{error}");
    }
}

#[test]
fn a_flight_says_where_its_recording_is_and_keeps_the_former_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let out = out.to_string_lossy();
    let text = "time_limit_s = 60.0\n[[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[6.0, 0.0, 3.0]]\n";
    let scenario = write(folder.path(), "hop.toml", text);
    let hop = || skein_sim(&["fly", &scenario, "--clock", "lockstep", "--headless", "--out", &out]);
    let (first, again) = (hop(), hop());
    let said = String::from_utf8_lossy(&first.stderr).into_owned();
    assert!(first.status.success() && again.status.success(), "{said}");
    assert!(said.contains(&format!("recording: {out}/mission.mcap")), "{said}");
    assert!(said.contains(&format!("skein-ground explain {out}/mission.mcap --at")), "{said}");
    let kept = |name: &str| folder.path().join("run").join(name).is_file();
    assert!(kept("mission.mcap") && kept("mission-1.mcap"));
}

/// Two that fly past one another, as `rehearse` is told of them.
const REHEARSAL: &str = r#"{"vehicles": [
    {"node": "uav/3", "position_m": [0, 0, 3], "airborne": true, "battery": 0.9, "route_m": [[20, 0, 3]]},
    {"node": "uav/8", "position_m": [20, 6, 3], "airborne": true, "battery": 0.9, "route_m": [[0, 6, 3]]}
  ], "min_m": [-10, -10, -1], "max_m": [30, 20, 10], "seeds": [1, 2]}"#;

fn rehearse(text: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_skein-sim"))
        .args(["rehearse", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    std::io::Write::write_all(&mut child.stdin.take().expect("a pipe"), text.as_bytes()).expect("it reads");
    child.wait_with_output().expect("it ends")
}

#[test]
fn what_is_rehearsed_comes_as_one_object_and_a_wrong_field_is_named() {
    let output = rehearse(REHEARSAL);
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_eq!((&said["succeeded"], &said["vehicles"][1]["arrives"]), (&true.into(), &2.into()), "{said}");
    let nearest = &said["nearest"][0];
    assert_eq!(nearest["who"], serde_json::json!(["uav/3", "uav/8"]));
    assert!(nearest["distance_m"].as_f64().is_some_and(|metres| (4.0..6.5).contains(&metres)), "{nearest}");

    let missing = REHEARSAL.replace("[[20, 0, 3]]", "[[40, 0, 3]]");
    let output = rehearse(&missing);
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(output.status.code(), Some(1), "a goal outside of the air: {said}");
    assert!(said["vehicles"][0]["fails"][0]["why"].is_string(), "{said}");

    for (from, to, field) in [
        ("\"battery\": 0.9", "\"battery\": 2", "`vehicles[0].battery` is 2.0"),
        ("[[20, 0, 3]]", "[]", "`vehicles[0].route_m`"),
        ("[20, 6, 3]", "[20, 600, 3]", "`vehicles[1].position_m`"),
        ("\"seeds\": [1, 2]", "\"seeds\": []", "`seeds`"),
        ("\"seeds\"", "\"sead\"", "unknown field `sead`"),
        ("[-10, -10, -1]", "[-10, \"a\", -1]", "`min_m[1]`"),
        ("\"min_m\"", "\"model\": \"kite\", \"min_m\"", "`model`"),
        ("\"min_m\"", "\"world\": \"nowhere.csv\", \"min_m\"", "nowhere.csv"),
        (
            "\"min_m\"",
            "\"obstacles\": [{\"form\": \"sphere\", \"radius\": 0, \"position\": [0, 0, 0]}], \"min_m\"",
            "`obstacles[0].radius`",
        ),
        ("}", "", "standard input"),
    ] {
        let output = rehearse(&REHEARSAL.replacen(from, to, 1));
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{field}: {error}");
        assert!(error.contains(field), "`{field}` is not in: {error}");
    }
    assert_refused(&["rehearse", "nowhere.json"], &["nowhere.json"]);
}

#[test]
fn a_scenario_s_check_lists_its_own_tables_and_each_element_of_the_files_that_it_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let tree = "<include><uri>model://pine_tree</uri></include>\n";
    let wall = "<model name='wall'><static>true</static><pose>0 30 1 0 0 0</pose><link name='l'><collision name='c'>\
                <geometry><box><size>4 1 2</size></box></geometry></collision></link></model>\n";
    let world_of = |more: &str| format!("<sdf version='1.6'><world name='w'>\n{wall}{more}</world></sdf>");
    let world = write(folder.path(), "yard.world", &world_of(""));
    let plan = r#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{"altitudeMode":"relativeToGround"},"geometry":
        {"type":"LineString","coordinates":[[8.0,47.0,5.0],[8.0002,47.0,5.0]]}}]}"#;
    let mission = write(folder.path(), "way.geojson", plan);
    let text =
        "name = \"yard\"\nworld = \"yard.world\"\nmission = [\"way.geojson\"]\ncruise_speed_m_s = 2.0\n";
    let scenario = write(folder.path(), "yard.toml", text);
    let checked = |code: i32| -> Vec<(String, String, u64)> {
        let output = skein_sim(&["check", &scenario, "--json"]);
        let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
        assert_eq!(output.status.code(), Some(code), "{said}");
        let told = |element: &serde_json::Value| {
            let word = |field: &str| element[field].as_str().unwrap_or_default().to_owned();
            let file = word("file").rsplit('/').next().unwrap_or_default().to_owned();
            (format!("{file} {}", word("what")), word("verdict"), element["line"].as_u64().unwrap_or(0))
        };
        said["elements"].as_array().expect("the elements").iter().map(told).collect()
    };
    let elements = checked(0);
    let is_there = |elements: &[(String, String, u64)], what: &str, verdict: &str, line: u64| {
        elements
            .iter()
            .any(|element| element.0.starts_with(what) && element.1 == verdict && element.2 == line)
    };
    assert!(is_there(&elements, " cruise_speed_m_s", "honoured", 4), "{elements:?}");
    assert!(is_there(&elements, "yard.world", "honoured", 2), "{elements:?}");
    assert!(elements.iter().any(|element| element.0.starts_with("way.geojson")), "{elements:?}");
    // What is missing in its world refuses the scenario, and its line says so.
    write(folder.path(), "yard.world", &world_of(tree));
    assert!(is_there(&checked(1), "yard.world", "refused", 3));
    // A field at fault is named.
    write(folder.path(), "yard.world", &world_of(""));
    write(folder.path(), "yard.toml", &text.replace("cruise_speed_m_s = 2.0", "cruise_speed_m_s = -2.0"));
    assert!(is_there(&checked(1), " cruise_speed_m_s", "refused", 4));
    let _ = (world, mission);
}
