//! `skein-ground explain`: what it prints, and its exit codes.

use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use skein_bp::Bid;
use skein_dbp::{Board, BoardRow, NodeName};
use skein_ground::recorder::{Level, Recorder};
use skein_wire::State;

fn explain(file: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_skein-ground"))
        .arg("explain")
        .arg(file)
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A vehicle that stands for ten seconds, with or without its board.
fn record(path: &Path, with_board: bool) {
    let vehicle = NodeName::new("uav/3").unwrap();
    let row =
        BoardRow::new("navigation", &Bid::new().request("uav/3/advance"), |_| vec!["separation".into()]);
    let mut recorder = Recorder::create(path).unwrap();
    recorder.log(Duration::ZERO, Level::Info, "ground/main", "begins").unwrap();
    for second in 0..=10 {
        let now = Duration::from_secs(second);
        recorder.state(now, &State { time: now, armed: true, ..State::new(vehicle.clone()) }).unwrap();
        if with_board {
            recorder.board(now, &Board::new(vehicle.clone(), 1, now, vec![row.clone()])).unwrap();
        }
    }
    recorder.finish().unwrap();
}

#[test]
fn a_moment_is_told_in_words_and_as_one_json_object() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mission.mcap");
    record(&file, true);
    for arguments in [&["--vehicle", "3"][..], &["--vehicle", "uav/3", "--at", "-1"], &["--at", "9.5"], &[]] {
        let told = explain(&file, arguments);
        assert_eq!(told.status.code(), Some(0), "{}", text(&told.stderr));
        let words = text(&told.stdout);
        assert!(
            words.contains("`uav/3/advance` is requested by navigation and blocked by separation"),
            "{words}"
        );
    }
    let told = explain(&file, &["--json", "--at", "10"]);
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).unwrap();
    assert_eq!((&json["at_s"], &json["complete"]), (&10.0.into(), &true.into()));
    assert_eq!(json["vehicles"][0]["requests"][0]["blocked_by"][0]["bthread"], "separation");
}

#[test]
fn wrong_input_exits_with_2_and_names_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mission.mcap");
    record(&file, true);
    for (arguments, named) in [
        (&["--vehicle", "4"][..], "uav/3"),
        (&["--at", "10.5"], "from 0.000 to 10.000 s"),
        (&["--at", "-11"], "from 0.000 to 10.000 s"),
    ] {
        let refused = explain(&file, arguments);
        let error = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{error}");
        assert!(error.contains(named) && error.contains("mission.mcap"), "{error}");
    }
    std::fs::write(&file, "no recording").unwrap();
    let refused = explain(&file, &["--json"]);
    assert_eq!(refused.status.code(), Some(2));
    let json: serde_json::Value = serde_json::from_slice(&refused.stdout).unwrap();
    assert!(json["error"].as_str().is_some_and(|error| error.contains("mission.mcap")), "{json}");
}

#[test]
fn a_recording_that_tells_of_no_b_threads_exits_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mission.mcap");
    record(&file, false);
    let told = explain(&file, &["--json"]);
    assert_eq!(told.status.code(), Some(1));
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).unwrap();
    assert!(json["error"].as_str().is_some_and(|error| error.contains("does not tell")), "{json}");
}
