//! What `bench --json` prints. No figure decides a test.

use std::process::Command;

use serde_json::Value;

/// The one object that a benchmark prints.
fn bench(arguments: &[&str], environment: &[(&str, &str)]) -> (Value, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skein-lab"));
    let output = command.arg("bench").args(arguments).arg("--json").envs(environment.iter().copied());
    let output = output.output().expect("the program starts");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    (serde_json::from_slice(&output.stdout).expect("one JSON object"), errors)
}

fn assert_positive(object: &Value, fields: &[&str]) {
    for field in fields {
        let number = object.pointer(&format!("/{field}")).and_then(Value::as_f64);
        assert!(number.is_some_and(|number| number > 0.0), "`{field}` in {object}");
    }
}

#[test]
fn programs_are_measured_without_bppy_too() {
    let arguments = ["bp", "--repetitions", "1", "--seconds", "0.01", "--philosophers", "4"];
    let (object, errors) = bench(&arguments, &[("SKEIN_PYTHON", "no-such-python")]);
    let programs = ["hot_cold", "idle_100", "idle_1000", "woken_1000"];
    assert_positive(
        &object,
        &programs.map(|program| format!("{program}_events_per_s")).each_ref().map(String::as_str),
    );
    assert_positive(&object, &["verified_states", "verify_states_per_s", "verify_states_per_cpu_s"]);
    for program in programs {
        assert_eq!(object.get(format!("ratio_{program}")), Some(&Value::Null), "{object}");
    }
    assert!(errors.contains("no-such-python") && errors.contains("pip install bppy"), "{errors}");
}

#[test]
fn a_fleet_is_measured_at_every_size_asked_for() {
    let (object, _) = bench(&["fleet", "--nodes", "2,5", "--seconds", "3"], &[]);
    let sizes = object["per_node"].as_array().expect("a list");
    assert_eq!(sizes.iter().map(|size| &size["nodes"]).collect::<Vec<_>>(), [2, 5]);
    for size in sizes {
        let traffic =
            ["sent_messages_per_s", "sent_bytes_per_s", "received_messages_per_s", "received_bytes_per_s"];
        assert_positive(size, &traffic);
        assert_positive(size, &["events_per_s"]);
        // So few nodes may fit into what the process has anyway.
        assert!(size["memory_bytes"].as_f64().is_some_and(|bytes| bytes >= 0.0), "{size}");
    }
    // Everybody hears everybody.
    assert!(sizes[1]["received_messages_per_s"].as_f64() > sizes[0]["received_messages_per_s"].as_f64());
}

#[test]
fn round_trips_are_measured_between_processes() {
    let arguments =
        ["link", "--round-trips", "40", "--homes", "2", "--confirmations", "5", "--stopped-s", "1.5"];
    let (object, _) = bench(&arguments, &[]);
    assert_positive(
        &object,
        &["zenoh_rtt_us/p50", "zenoh_rtt_us/p99", "queued_rtt_us/p50", "queued_rtt_us/p99"],
    );
    assert_positive(
        &object,
        &["event_rtt_us/p50", "event_rtt_us/p99", "ratio_p50", "ratio_event_queued_p50"],
    );
    assert_positive(
        &object,
        &["confirm_10_homes_us/p50", "confirm_10_homes_us/p99", "stopped/longest_superstep_us"],
    );
    assert!(object["stopped"]["leases_lost"].is_u64(), "{object}");
}
