//! docs/first-behaviour.md: its code stands in the files that it names, and its commands print what it shows.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

const PAGE: &str = include_str!("../../../docs/first-behaviour.md");
const SCENARIO: &str = include_str!("../square.toml");

fn program(name: &str) -> Command {
    Command::new(match name {
        "dwell-sim" => env!("CARGO_BIN_EXE_dwell-sim"),
        "dwell-agent" => env!("CARGO_BIN_EXE_dwell-agent"),
        "dwell-ground" => env!("CARGO_BIN_EXE_dwell-ground"),
        _ => panic!("{name} is no program of this crate"),
    })
}

/// The blocks that begin with this word: what else stands in the first line, and the lines below.
fn blocks(kind: &str) -> Vec<(&'static str, Vec<&'static str>)> {
    let mut blocks = Vec::new();
    let mut lines = PAGE.lines();
    while let Some(line) = lines.next() {
        if let Some(opening) = line.strip_prefix("```") {
            let block: Vec<_> = lines.by_ref().take_while(|line| *line != "```").collect();
            if let Some(rest) = opening.strip_prefix(kind) {
                blocks.push((rest.trim(), block));
            }
        }
    }
    blocks
}

/// A folder that looks to commands as the repository does.
fn repository() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("tests/dwell")).unwrap();
    fs::write(folder.path().join("tests/dwell/square.toml"), SCENARIO).unwrap();
    folder
}

#[test]
fn the_code_of_the_page_is_the_code_of_the_crate() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let blocks = [blocks("rust"), blocks("toml")].concat();
    assert!(blocks.len() >= 7, "the page has lost its code");
    for (file, lines) in blocks {
        let shown = lines.join("\n");
        let text = fs::read_to_string(root.join(file)).unwrap();
        assert!(text.contains(&shown), "this is not in {file}:\n{shown}");
    }
}

#[test]
fn the_commands_of_the_page_print_what_it_shows() {
    let folder = repository();
    let session = session();
    assert!(session.len() >= 4, "the page has lost its commands");
    for lines in session {
        let (command, shown) = (lines[0], &lines[1..]);
        let arguments: Vec<&str> = command.split(' ').collect();
        let end = arguments.iter().position(|argument| *argument == "--").unwrap();
        let name = arguments[end - 1];
        let output = program(name).args(&arguments[end + 1..]).current_dir(folder.path()).output().unwrap();
        assert_shows(command, &output, shown);
    }
}

/// The commands of the page, without their prompts, each with the lines that it prints.
fn session() -> Vec<Vec<&'static str>> {
    let mut commands: Vec<Vec<&str>> = Vec::new();
    for line in blocks("console").into_iter().flat_map(|(_, lines)| lines) {
        match (line.strip_prefix("$ "), commands.last_mut()) {
            (Some(command), _) => commands.push(vec![command]),
            (None, Some(command)) => command.push(line),
            (None, None) => panic!("{line} follows no command"),
        }
    }
    commands
}

/// The lines that are shown stand in what was printed, in this order; `...` stands for any number of others.
fn assert_shows(command: &str, output: &Output, shown: &[&str]) {
    let printed = [&output.stdout[..], &output.stderr].concat();
    let printed = String::from_utf8_lossy(&printed).into_owned();
    let mut left = printed.lines().map(str::trim_end);
    let mut skips = false;
    for line in shown {
        if *line == "..." {
            skips = true;
            continue;
        }
        let found = if skips { left.any(|other| other == *line) } else { left.next() == Some(*line) };
        assert!(found, "`{command}` does not print\n{line}\nbut\n{printed}");
        skips = false;
    }
    assert!(skips || left.next().is_none(), "`{command}` prints more:\n{printed}");
}

fn json(command: &mut Command) -> Value {
    let output = command.output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"))
}

/// In lockstep, how long the flight takes, and its hash.
fn fly(scenario: &str) -> (f64, Value) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("square.toml"), scenario).unwrap();
    let arguments = ["fly", "square.toml", "--clock", "lockstep", "--headless", "--json", "--out", "out"];
    let summary = json(program("dwell-sim").args(arguments).current_dir(folder.path()));
    assert_eq!(summary["succeeded"], true, "{summary}");
    (summary["sim_time_s"].as_f64().unwrap(), summary["trace_hash"].clone())
}

#[test]
fn a_behaviour_is_off_unless_it_is_named() {
    let (dwelling_s, _) = fly(SCENARIO);
    let off = SCENARIO.replace("[behaviours]\ndwell = { for_s = 3.0 }\n", "");
    assert_ne!(off, SCENARIO);
    let (through_s, _) = fly(&off);
    assert!((5.0..8.0).contains(&(dwelling_s - through_s)), "{dwelling_s} s with it, {through_s} s without");
}

#[test]
fn what_is_wrong_with_settings_is_named_by_file_and_field() {
    let folder = tempfile::tempdir().unwrap();
    for (settings, fault) in [
        (
            "dwell = { for_s = -1.0 }",
            "behaviours.dwell.for_s: invalid value: floating point `-1.0`, expected a number above 0",
        ),
        ("dwell = { for_s = 1, how = 2 }", "behaviours.dwell.how: is no setting of this behaviour"),
        ("dwell = {}", "behaviours.dwell: missing field `for_s`"),
        ("dawdle = {}", "behaviours.dawdle: this program has no such behaviour; it has: dwell"),
    ] {
        let text = SCENARIO.replace("dwell = { for_s = 3.0 }", settings);
        fs::write(folder.path().join("square.toml"), text).unwrap();
        let output =
            program("dwell-sim").args(["fly", "square.toml"]).current_dir(folder.path()).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("square.toml") && told.contains(fault), "{settings}: {told}");
    }
}

/// Each node in a process of its own, over Zenoh, in real time.
#[test]
fn it_flies_as_processes_of_ones_own_programs() {
    let folder = repository();
    let summary = json(
        program("dwell-sim")
            .args(["fly", "tests/dwell/square.toml", "--processes", "--headless", "--json", "--out", "out"])
            .args(["--port-offset", "4100", "--agent", env!("CARGO_BIN_EXE_dwell-agent")])
            .args(["--ground", env!("CARGO_BIN_EXE_dwell-ground")])
            .current_dir(folder.path()),
    );
    assert_eq!(summary["succeeded"], true, "{summary}");
    let log = fs::read_to_string(folder.path().join("out/logs/uav-1.log")).unwrap();
    assert!(log.contains("uav/1/dwelt{leg: 0}"), "{log}");
}
