//! The program as a user meets it: exit codes, and errors that name what is wrong.

use std::process::{Command, Output};

fn skein_lab(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_skein-lab")).args(arguments).output().expect("the program starts")
}

/// Exits with 2 and an error that has all of these words.
fn assert_refused(arguments: &[&str], words: &[&str]) {
    let output = skein_lab(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
    for word in words {
        assert!(error.contains(word), "{arguments:?}: `{word}` is not in: {error}");
    }
}

#[test]
fn a_network_that_cannot_be_is_refused_by_its_option() {
    for (option, value) in [
        ("--lease-ms", "-5"),
        ("--lease-ms", "NaN"),
        ("--latency-ms", "-5"),
        ("--latency-ms", "1e300"),
        ("--loss", "1"),
    ] {
        let given = format!("{option}={value}");
        assert_refused(
            &["campaign", "separation", "--seeds", "1", &given],
            &[option, "expected a number from"],
        );
    }
}

#[test]
fn a_network_campaign_counts_its_seeds_events_and_faults() {
    let output = skein_lab(&["campaign", "network", "--seeds", "2", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(output.status.code(), Some(0), "{report}");
    assert_eq!((report["seeds"].as_u64(), report["violations"].as_u64()), (Some(2), Some(0)), "{report}");
    assert!(report["events"].as_u64() >= Some(1000), "{report}");
    assert!(report["faults"]["lost"].is_u64() && report["failing_seeds"].is_array(), "{report}");
}

#[cfg(not(feature = "mutants"))]
#[test]
fn a_plain_build_breaks_no_promise() {
    assert_refused(&["campaign", "network", "--break", "G3"], &["--features mutants", "--break G3"]);
    assert_refused(&["campaign", "network", "--break", "G10"], &["G10", "G9"]);
}

#[test]
fn an_error_is_one_object_on_standard_output_where_json_is_asked_for() {
    let output = skein_lab(&["experiment", "lsc", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    let error: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert!(error["error"].as_str().is_some_and(|error| error.contains("--dir")), "{error}");
}
