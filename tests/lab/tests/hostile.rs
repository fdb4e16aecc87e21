//! `campaign hostile` as a user meets it, with few seeds.

use std::process::Command;

fn campaign(arguments: &[&str]) -> (Option<i32>, serde_json::Value) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skein-lab"));
    let output = command.args(["campaign", "hostile", "--json"]).args(arguments).output().expect("it starts");
    (output.status.code(), serde_json::from_slice(&output.stdout).expect("one JSON object"))
}

#[test]
fn a_hostile_member_costs_what_is_stated_and_changes_no_flight() {
    let (code, report) = campaign(&["--seeds", "10"]);
    assert_eq!((code, report["violations"].as_u64()), (Some(0), Some(0)), "{report}");
    assert!(report["decoded_share"].as_f64() >= Some(0.8), "{report}");
    assert!(report["messages"].as_u64() >= Some(10_000), "{report}");
    let worst = |count: &str| report["worst_per_bound"][count]["most"].as_u64();
    for count in ["messages_per_tick", "bytes_per_tick", "entries", "facts", "lives", "repeated"] {
        assert!(worst(count) > Some(0), "{count} was never counted: {report}");
    }
}

#[cfg(not(feature = "mutants"))]
#[test]
fn a_plain_build_takes_no_bound_away() {
    let (code, report) = campaign(&["--mutant", "set_depth"]);
    assert_eq!(code, Some(2));
    assert!(report["error"].as_str().is_some_and(|error| error.contains("--features mutants")), "{report}");
}

#[cfg(feature = "mutants")]
#[test]
fn without_a_bound_a_violation_is_found_and_told_in_short() {
    for bound in ["text_bytes", "tick_bytes"] {
        let (code, report) = campaign(&["--mutant", bound, "--seeds", "50", "--first"]);
        assert_eq!(code, Some(1), "{bound}: {report}");
        let story = report["failing_seeds"][0]["story"].as_str().expect("a story");
        assert!(story.matches(';').count() <= 3, "{bound}: {story}");
    }
}
