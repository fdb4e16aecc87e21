//! The kernel against conformance cases, and the runner against itself.

mod suite;

use suite::Suite;

#[test]
fn own_cases_hold() {
    let suite = Suite::parse(include_str!("cases/own.json")).unwrap();
    assert_eq!(suite.unsound(), []);
    let report = suite.check();
    assert_eq!(report.failures, []);
    assert_eq!(report.passed, 10);
}

#[test]
fn published_cases_hold() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/conformance.json");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("skipped: needs ../shared/data");
        return;
    };
    let suite = Suite::parse(&text).unwrap();
    assert_eq!(suite.unsound(), []);
    let report = suite.check();
    assert_eq!(report.failures, []);
    assert!(report.passed >= 20, "{report}");
}

/// The problems of one case with the b-thread `t` requesting `a` or `b`.
fn problem(expectation: &str) -> String {
    let case = format!(
        r#"{{"format": "bp-conformance/1", "cases": [{{"name": "case", "expect": [{expectation}],
            "bthreads": [{{"name": "t", "body": [{{"sync": {{"request": ["a", "b"]}}}}]}}]}}]}}"#
    );
    let report = Suite::parse(&case).unwrap().check();
    report.failures.iter().map(ToString::to_string).collect()
}

#[test]
fn the_runner_notices_every_kind_of_difference() {
    assert_eq!(problem(r#"{"kind": "run", "traces": [["a"], ["b"]], "end": "no_bthreads"}"#), "");
    assert!(
        problem(r#"{"kind": "run", "traces": [["a"]], "end": "no_bthreads"}"#)
            .contains(r#"the trace ["b"] is not legal"#)
    );
    assert!(
        problem(r#"{"kind": "run", "traces": [["a"], ["b"], ["c"]], "end": "no_bthreads"}"#)
            .contains("not seen")
    );
    assert!(
        problem(r#"{"kind": "run", "traces": [["a"], ["b"]], "end": "no_selectable"}"#)
            .contains("end is NoBthreads")
    );
    assert!(
        problem(r#"{"kind": "run", "traces": [["a"], ["b"]], "end": "no_bthreads", "alive": ["t"]}"#)
            .contains("alive is []")
    );
    assert!(
        problem(r#"{"kind": "run", "traces": [["a"], ["b"]], "end": "no_bthreads", "violator": "t"}"#)
            .contains("violator is None")
    );
    assert!(
        problem(r#"{"kind": "selectable_at_start", "set": ["a"]}"#)
            .starts_with("case: the selectable set at the start is {a, b}")
    );
}

#[test]
fn files_that_are_no_suites_are_refused() {
    let refusal = |text: &str| Suite::parse(text).unwrap_err().to_string();
    assert!(refusal("{\n\"format\": }").contains("line 2"));
    assert!(
        refusal(r#"{"format": "other", "cases": []}"#)
            .contains("`format` is `other`, expected `bp-conformance/1`")
    );
    let suite = Suite::parse(
        r#"{"format": "bp-conformance/1", "cases": [{"name": "odd", "bthreads": [{"name": "t", "body": [{"spawn": "ghost"}]}], "expect": []}]}"#,
    );
    assert!(suite.unwrap().unsound()[0].to_string().starts_with("odd: `spawn` names the template `ghost`"));
}

#[test]
fn the_runner_notices_every_kind_of_difference_in_a_verdict() {
    // `t` goes round for ever, and is always hot.
    let problem = |rest: &str| -> String {
        let case = format!(
            r#"{{"format": "bp-conformance/1", "cases": [{{"name": "case", "bthreads": [
                {{"name": "t", "body": [{{"repeat": "forever", "do": [
                    {{"sync": {{"request": ["a"], "hot": true}}}}, {{"sync": {{"request": ["b"], "hot": true}}}}]}}]}},
                {{"name": "u", "body": [{{"sync": {{"wait": "a"}}}}]}}],
                "expect": [{{"kind": "verify", {rest}}}]}}]}}"#
        );
        let suite = Suite::parse(&case).unwrap();
        suite.unsound().iter().chain(&suite.check().failures).map(ToString::to_string).collect()
    };
    let hot = r#""inspections": ["hot_bthread"], "verdict": "hot_bthread""#;
    let all = r#""violators": ["t"], "trace": ["a", "b", "a"], "shortest": 3, "cycle_length": 2, "cycle_to_event": "a",
        "states": 3, "edges": 3, "full_graph": {"states": 3, "edges": 3}"#;
    assert_eq!(problem(&format!("{hot}, {all}")), "");
    for (field, noticed) in [
        (r#""violators": ["u"]"#, "the set of violators"),
        (r#""trace": ["a", "b"]"#, "the trace is [a, b, a]"),
        (r#""shortest": 2"#, "the length of the trace"),
        (r#""cycle_length": 1"#, "cycle_length"),
        (r#""cycle_to_event": "b""#, "the cycle closes with"),
        (r#""states": 4"#, "states is 3"),
        (r#""edges": 4"#, "edges is 3"),
        (r#""full_graph": {"states": 3, "edges": 2}"#, "edges of the full graph"),
        (r#""depth": 3"#, "unknown field `depth`"),
    ] {
        let found = problem(&format!("{hot}, {field}"));
        assert!(found.contains(noticed), "{field}: {found}");
    }
    for (asked, verdict) in [
        (r#""deadlock""#, "none"),
        (r#""hot_run""#, "hot_run"),
        (r#"{"hot_run": ["t"]}"#, "hot_run"),
        (r#"{"hot_run": ["u"]}"#, "none"),
        (r#""hot_system""#, "hot_system"),
        (r#""hot_termination""#, "none"),
        (r#""assertion""#, "none"),
    ] {
        assert_eq!(problem(&format!(r#""inspections": [{asked}], "verdict": "{verdict}""#)), "");
        let other = if verdict == "none" { "deadlock" } else { "none" };
        assert!(
            problem(&format!(r#""inspections": [{asked}], "verdict": "{other}""#)).contains("the verdict is")
        );
    }
}
