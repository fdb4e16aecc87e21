//! Scripts: b-threads as data.

use crate::support::{START, plain, script, superstep};
use serde_json::{Value, json};
use skein_bp::script::{Library, Op, Script, ScriptSource};
use skein_bp::{Program, ProgramConfig};

#[test]
fn nested_loops_count_separately() {
    let body = json!([
        {"repeat": 2, "do": [{"repeat": 2, "do": [{"sync": {"request": ["a"]}}]}, {"sync": {"request": ["b"]}}]},
        {"repeat": 0, "do": [{"sync": {"request": ["never"]}}]},
        {"repeat": 1, "do": [{"sync": {"request": ["c"]}}]}
    ]);
    assert_eq!(superstep(&mut plain([("t", body)])).concat(), "aabaabc");
}

#[test]
fn a_branch_goes_by_the_event_that_ended_the_last_sync() {
    let body = json!([{"repeat": 3, "do": [
        {"sync": {"wait": ["a", "b", "c"]}},
        {"on": {"a": [{"sync": {"request": ["got a"]}}], "b": [{"sync": {"request": ["got b"]}}, {"stop": true}]}},
    ]}]);
    let mut program = plain([("t", body)]);
    for event in ["c", "a", "b", "a"] {
        program.enqueue(event);
    }
    assert_eq!(superstep(&mut program), ["c", "a", "got a", "b", "got b"]);
    assert!(!program.has_bthreads(), "stopped within the third round");
}

#[test]
fn a_template_is_spawned_under_its_name_each_time() {
    let source = |name: &str, body: Value| ScriptSource {
        name: name.into(),
        body: serde_json::from_value(body).unwrap(),
        priority: None,
    };
    let library = Library::new([
        source(
            "child",
            json!([{"sync": {"request": ["child"]}}, {"spawn": "grandchild"}, {"sync": {"wait": "never"}}]),
        ),
        source("grandchild", json!([{"sync": {"request": ["grandchild"]}}])),
    ]);
    let ops: Vec<Op> = serde_json::from_value(json!([{"spawn": "child"}, {"spawn": "child"}])).unwrap();
    let mut program = Program::new(ProgramConfig::default());
    program.add("parent", Script::with_library(&ops, None, &library.unwrap()).unwrap());
    assert_eq!(superstep(&mut program), ["child", "grandchild"]);
    assert_eq!(program.bids().map(|(name, ..)| name).collect::<Vec<_>>(), ["child", "child~2"]);
}

#[test]
fn the_daemon_flag_reaches_the_program() {
    let mut program =
        plain([("t", json!([{"daemon": true}, {"sync": {"request": ["a"]}}, {"daemon": false}]))]);
    program.synchronise(START).unwrap();
    assert!(program.is_daemon());
    superstep(&mut program);
    assert!(!program.is_daemon());
}

#[test]
fn scripts_at_the_same_place_are_equal_however_they_came_there() {
    let body =
        json!([{"repeat": 5, "do": [{"sync": {"wait": ["a", "b"]}}, {"on": {"a": [{"daemon": true}]}}]}]);
    let after = |events: &[&str]| {
        let mut program = plain([("t", body.clone())]);
        events.iter().for_each(|event| program.occurred(*event));
        program.superstep(START).unwrap();
        program
    };
    assert_eq!(after(&["a", "b"]), after(&["b", "a"]));
    assert_eq!(after(&["a", "b"]).state_digest(), after(&["b", "a"]).state_digest());
    assert_ne!(after(&["a"]), after(&["a", "a"]));
    assert_ne!(after(&["a"]).state_digest(), after(&["a", "a"]).state_digest());
    assert_eq!(after(&["a"]).states_json().unwrap()["t"]["rounds"], json!([1]));
}

#[test]
fn what_is_read_is_written_the_same() {
    let body = json!([
        {"sync": {"request": ["a", {"name": "b", "data": {"k": 1}}], "wait": {"any_data": "c"}, "block": ["d", {"prefix": "e"}],
                  "interrupt": {"not": {"named": "x/**"}}, "hot": true, "prio": 3}},
        {"repeat": "forever", "do": [{"sync": {}}]},
        {"repeat": 3, "do": [{"on": {"a": [{"stop": true}]}}]},
        {"assert_fail": "why"}, {"enqueue": ["x"]}, {"daemon": true}, {"on_interrupt_enqueue": ["$event", "y"]},
        {"spawn": "t"}, {"spawn": {"name": "n", "body": [{"stop": true}]}}
    ]);
    let ops: Vec<Op> = serde_json::from_value(body.clone()).unwrap();
    assert_eq!(serde_json::to_value(ops).unwrap(), body);
}

fn refusal(text: &str) -> String {
    serde_json::from_str::<Vec<Op>>(text).unwrap_err().to_string()
}

#[test]
fn errors_in_a_script_name_place_and_remedy() {
    assert!(
        refusal("[\n{\"sinc\": {}}]").contains("unknown field `sinc`, expected one of `sync`"),
        "{}",
        refusal("[{\"sinc\": {}}]")
    );
    assert!(refusal("[\n{\"sinc\": {}}]").contains("line 2"));
    assert!(refusal(r#"[{"repeat": 3}]"#).contains("missing field `do`"));
    assert!(refusal(r#"[{"repeat": "twice", "do": []}]"#).contains("a number of rounds or \"forever\""));
    assert!(refusal(r#"[{"repeat": -1, "do": []}]"#).contains("a number of rounds"));
    assert!(refusal(r#"[{"sync": {}, "stop": true}]"#).contains("`stop` is the second"));
    assert!(refusal(r#"[{"sync": {"wait": {"al": true}}}]"#).contains("unknown field `al`"));
    assert!(refusal(r#"[{"sync": {"request": [{"data": {}}]}}]"#).contains("missing field `name`"));
    assert!(refusal(r#"[{}]"#).contains("needs one of the keys"));
}

#[test]
fn unsound_scripts_are_refused() {
    let error =
        |body: Value| Script::new(&serde_json::from_value::<Vec<Op>>(body).unwrap()).unwrap_err().to_string();
    assert!(error(json!([{"spawn": "ghost"}])).contains("names the template `ghost`"));
    assert!(
        error(json!([{"repeat": "forever", "do": [{"enqueue": ["a"]}]}]))
            .contains("neither `sync` nor `stop`")
    );
}

#[test]
fn a_loop_that_never_syncs_fails_instead_of_hanging() {
    let body =
        json!([{"sync": {"request": ["a"]}}, {"repeat": "forever", "do": [{"on": {"b": [{"stop": true}]}}]}]);
    let mut program = plain([("t", body)]);
    assert_eq!(superstep(&mut program), ["a"]);
    assert_eq!(program.failed(), Some(("t", "ran 100000 ops without a sync")));
}

#[test]
fn endless_spawning_fails_instead_of_hanging() {
    let body = serde_json::from_value(json!([{"spawn": "hydra"}, {"spawn": "hydra"}])).unwrap();
    let library = Library::new([ScriptSource { name: "hydra".into(), body, priority: None }]).unwrap();
    let mut program = Program::new(ProgramConfig::default());
    let ops: Vec<Op> = serde_json::from_value(json!([{"spawn": "hydra"}])).unwrap();
    program.add("t", Script::with_library(&ops, None, &library).unwrap());
    let error = program.step(START).unwrap_err().to_string();
    assert!(error.contains("without end"), "{error}");
}

#[test]
fn an_empty_script_ends_at_once() {
    let mut program = plain([("t", json!([]))]);
    program.add("u", script(json!([{"stop": true}, {"sync": {"request": ["never"]}}])));
    assert_eq!(superstep(&mut program), [""; 0]);
    assert!(!program.has_bthreads());
}
