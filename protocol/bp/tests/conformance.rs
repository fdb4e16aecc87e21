//! The kernel against conformance cases, and the runner against itself.

#![allow(clippy::unwrap_used)] // A test fails by panicking.

use skein_bp::conformance::Suite;

#[test]
fn own_cases_hold() {
    let suite = Suite::parse(include_str!("cases/own.json")).unwrap();
    assert_eq!(suite.unsound(), []);
    let report = suite.check();
    assert_eq!(report.failures, []);
    assert_eq!((report.passed, report.skipped), (9, 1));
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
