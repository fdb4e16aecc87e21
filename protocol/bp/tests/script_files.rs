//! Script files: what they may say, what they become, and how they are refused.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::schema::Schema;
use crate::support::START;
use serde_json::{Value, json};
use skein_bp::script::{Argument, Assignment, BoundScript, MAX_TEXT, ScriptFile};
use skein_bp::{Event, Program, ProgramConfig};

const PATROL: &str = r#"
name = "patrol"
about = "Goes round."
ends_on = { any_data = "{me}/landed" }

[parameters.route]
about = "Where."
type = "route"

[parameters.least]
about = "How much is enough."
type = "number"
unit = "%"
default = 40
min = 10
max = 90

[[body]]
until = { and = [{ any_data = "{me}/battery" }, { field_range = { key = "percent", max = "{least}" } }] }
do = [{ repeat = "forever", do = [
    { each = "route", as = "here", do = [
        { sync = { request = { name = "{me}/go", data = { x = "{here.x}", y = "{here.y}", by = "script/{name}" } } } },
        { sync = { wait = "{me}/there" } },
    ] },
] }]

[[body]]
sync = { request = "{me}/home" }
"#;

fn bound(text: &str, with: &[(&str, Argument)]) -> BoundScript {
    let with = with.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
    ScriptFile::parse("test.toml", text).unwrap().bind("uav/3", None, &with).unwrap()
}

fn program(script: BoundScript) -> Program {
    let mut program = Program::new(ProgramConfig::default());
    program.add(script.name, script.bthread);
    program
}

/// What happens after an event from outside, itself included.
fn after(program: &mut Program, now: Duration, event: impl Into<Event>) -> Vec<String> {
    program.enqueue(event);
    program.superstep(now).unwrap().iter().map(|selection| selection.event.to_string()).collect()
}

fn route() -> Argument {
    Argument::Route(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
}

#[test]
fn a_script_runs_with_its_parameters_and_leaves_a_block_when_told() {
    let mut program = program(bound(PATROL, &[("route", route())]));
    let there = |program: &mut Program| after(program, START, "uav/3/there");
    let first = crate::support::superstep(&mut program);
    assert_eq!(first, ["uav/3/go{by: \"script/patrol\", x: 1.0, y: 2.0}"]);
    assert_eq!(there(&mut program)[1], "uav/3/go{by: \"script/patrol\", x: 4.0, y: 5.0}");
    assert_eq!(there(&mut program)[1], first[0]);
    let battery = |percent: i64| Event::new("uav/3/battery").with("percent", percent);
    assert_eq!(after(&mut program, START, battery(41)).len(), 1);
    assert_eq!(after(&mut program, START, battery(40))[1], "uav/3/home");
    assert!(!program.has_bthreads());
}

#[test]
fn what_ends_a_script_ends_it_at_every_synchronisation_point() {
    for events in 0..4 {
        let mut program = program(bound(PATROL, &[("route", route())]));
        program.superstep(START).unwrap();
        (0..events).for_each(|_| drop(after(&mut program, START, "uav/3/there")));
        after(&mut program, START, "uav/3/landed");
        assert!(!program.has_bthreads());
    }
}

#[test]
fn a_block_in_time_ends_by_itself_and_says_so() {
    let text = r#"
        name = "pause"
        about = "Blocks for a while, then says how it ended."
        body = [
            { until = "go", within_s = 2.5, do = [{ sync = { block = "move" } }, { sync = {} }] },
            { on = { timeout = [{ sync = { request = "late" } }], go = [{ sync = { request = "told" } }] } },
            { sync = { wait = "never" } },
        ]"#;
    let seconds = Duration::from_secs_f64;
    let mut program = program(bound(text, &[]));
    program.superstep(seconds(1.0)).unwrap();
    assert_eq!(program.next_deadline(), Some(seconds(3.5)));
    let mut told = program.clone();
    assert_eq!(after(&mut told, seconds(2.0), "go"), ["go", "told"]);
    assert_eq!(told.next_deadline(), None);
    assert_eq!(after(&mut program, seconds(3.4), "move"), [""; 0]);
    assert_eq!(after(&mut program, seconds(3.5), "x"), ["late", "move", "x"]);
    assert_eq!(program.next_deadline(), None);
}

#[test]
fn of_blocks_inside_one_another_the_one_whose_time_is_up_ends() {
    let text = r#"
        name = "nested"
        about = "Ticks each second, five seconds long."
        body = [
            { within_s = 5, do = [{ repeat = "forever", do = [
                { within_s = 1, do = [{ sync = {} }] },
                { sync = { request = "tick" } },
            ] }] },
            { sync = { request = "over" } },
        ]"#;
    let mut program = program(bound(text, &[]));
    let mut happened = Vec::new();
    for tenth in 0..80 {
        let selections = program.superstep(Duration::from_millis(100 * tenth)).unwrap();
        happened.extend(selections.into_iter().map(|selection| (tenth, selection.event.name().to_owned())));
    }
    let ticks = [10, 20, 30, 40].map(|tenth| (tenth, "tick".to_owned()));
    assert_eq!(happened[..4], ticks);
    assert_eq!(happened[4..], [(50, "over".to_owned())]);
}

#[test]
fn a_loop_that_was_left_from_within_begins_anew() {
    let text = r#"
        name = "rounds"
        about = "Three times what is left after two of three rounds."
        body = [{ repeat = 2, do = [
            { until = "out", do = [{ repeat = 3, do = [{ sync = { wait = "in" } }] }] },
            { sync = { request = "next" } },
        ] }]"#;
    let mut program = program(bound(text, &[]));
    let mut feed = |event: &str| after(&mut program, START, event).len();
    assert_eq!(["in", "in", "out", "in", "in", "in"].map(&mut feed), [1, 1, 2, 1, 1, 2]);
}

#[test]
fn a_request_takes_data_from_the_event_before() {
    let text = r#"
        name = "echo"
        about = "Goes where the other is."
        body = [{ repeat = "forever", do = [
            { sync = { wait = { any_data = "{me}/seen" } } },
            { sync = { request = { name = "{me}/go", data = { x = "$x", y = "$y", z = 2.0 } } } },
        ] }]"#;
    let mut program = program(bound(text, &[]));
    let seen = Event::new("uav/3/seen").with("x", 7.5).with("z", 9.0);
    // What the event does not say is left out.
    assert_eq!(after(&mut program, START, seen.clone())[1], "uav/3/go{x: 7.5, z: 2.0}");
    let once = program.clone();
    after(&mut program, START, seen.with("x", 1.0));
    assert_eq!(program, once, "what was said is forgotten once it has been used");
}

/// What a trial of these ops says.
fn trial(body: Value) -> String {
    let text = file(&body).to_string();
    let script = ScriptFile::parse("test.json", &text).unwrap();
    let with = [("place", Argument::Point([0.0; 3])), ("way", Argument::Route(vec![[0.0; 3]; 3]))];
    let with = with.map(|(name, value)| (name.to_owned(), value)).into();
    match script.bind("uav/1", None, &with).unwrap().bthread.try_out(1000) {
        Ok(trial) => format!("{} states, complete: {}", trial.states, trial.is_complete),
        Err(fault) => fault.to_string(),
    }
}

#[test]
fn a_trial_finds_blocks_that_are_never_let_go() {
    for (body, verdict) in [
        (
            json!([{"sync": {"block": {"any_data": "move"}}}]),
            "it blocks `move` for ever from the start; give it",
        ),
        (
            json!([{"sync": {"wait": "go"}}, {"sync": {"block": {"any_data": "move"}, "wait": {"all": false}}}]),
            "it blocks `move` for ever after go;",
        ),
        (
            json!([{"repeat": "forever", "do": [{"sync": {"block": "move", "wait": {"any_data": "go", "not": {"data_has": {"by": "me"}}}}}]}]),
            "it blocks `move` for ever from the start",
        ),
        // It waits for what it blocks itself.
        (json!([{"sync": {"block": "move", "wait": "move"}}]), "it blocks `move` for ever from the start"),
        (
            json!([{"sync": {"wait": ["a", "b"]}}, {"on": {"b": [{"sync": {"block": {"any_data": "move", "region": {"min": [0, 0, 0], "max": [2, 2, 2]}}}}]}}]),
            "it blocks `move{x: 1.0, y: 1.0, z: 1.0}` for ever after b;",
        ),
    ] {
        let said = trial(body);
        assert!(said.contains(verdict), "{said} does not say {verdict}");
    }
    for body in [
        json!([{"sync": {"block": {"any_data": "move"}, "wait": "go"}}]),
        json!([{"sync": {"block": {"any_data": "move"}, "interrupt": {"field_range": {"key": "z", "min": 3}}}}]),
        json!([{"within_s": 9, "do": [{"sync": {"block": {"any_data": "move"}}}]}]),
        json!([{"repeat": "forever", "do": [{"sync": {"block": "left", "wait": "right"}}, {"sync": {"block": "right", "wait": "left"}}]}]),
    ] {
        let said = trial(body.clone());
        assert!(said.ends_with("complete: true"), "{body}: {said}");
    }
}

#[test]
fn a_trial_finds_rounds_without_a_pause() {
    let said = trial(
        json!([{"sync": {"wait": "go"}}, {"repeat": "forever", "do": [{"sync": {"request": "x"}}, {"sync": {"request": "y"}}]}]),
    );
    assert!(
        said.contains("it goes round without waiting for anything: ") && said.contains("after go"),
        "{said}"
    );
    for paused in [json!({"sync": {"wait": "go"}}), json!({"within_s": 1, "do": [{"sync": {}}]})] {
        let said = trial(json!([{"repeat": "forever", "do": [{"sync": {"request": "x"}}, paused]}]));
        assert_eq!(said, "2 states, complete: true");
    }
    assert_eq!(
        trial(json!([{"repeat": 5000, "do": [{"sync": {"wait": "go"}}]}])),
        "1000 states, complete: false"
    );
}

#[test]
fn toml_and_json_say_the_same() {
    let from_toml = ScriptFile::parse("patrol.toml", PATROL).unwrap();
    let json = serde_json::to_string(&from_toml).unwrap();
    assert_eq!(ScriptFile::parse("patrol.json", &json).unwrap(), from_toml);
}

#[test]
fn an_assignment_arrives_as_it_was_sent() {
    let script = ScriptFile::parse("patrol.toml", PATROL).unwrap();
    let with = BTreeMap::from([("route".to_owned(), route())]);
    let sent = Assignment { script, with, called: Some("night-patrol".to_owned()) };
    let arrived = Assignment::from_json(&sent.to_json().unwrap()).unwrap();
    assert_eq!(arrived, sent);
    let bound = arrived.bind("uav/3").unwrap();
    assert_eq!((bound.name.as_str(), &bound.with["least"]), ("night-patrol", &Argument::Number(40.0)));
    let long = Assignment::from_json(&" ".repeat(MAX_TEXT + 1)).unwrap_err();
    assert!(long.to_string().contains("expected at most 16384"), "{long}");
}

#[test]
fn arguments_are_refused_with_what_was_expected() {
    let script = ScriptFile::parse("patrol.toml", PATROL).unwrap();
    for (with, refusal) in [
        (json!({}), "patrol: `with.route` is missing: expected a list of 1 to 32 points"),
        (json!({"route": []}), "`with.route` is []: expected a list of 1 to 32 points"),
        (json!({"route": [0, 0, 1]}), "`with.route` is [0.0,0.0,1.0]: expected a list"),
        (json!({"route": [[0, 0, 1]], "least": 5}), "`with.least` is 5: expected 10 to 90 %"),
        (json!({"route": [[0, 0, 1]], "least": "x"}), "`with.least` is \"x\": expected a number"),
        (json!({"route": [[0, 0, 1]], "lest": 50}), "`with.lest` is no parameter; there are: least, route"),
    ] {
        let with = serde_json::from_value(with).unwrap();
        let error = script.bind("uav/1", None, &with).unwrap_err().to_string();
        assert!(error.contains(refusal), "{error} does not say {refusal}");
    }
    let error =
        script.bind("uav/1", Some("Night Patrol"), &[("route".to_owned(), route())].into()).unwrap_err();
    assert!(error.to_string().contains("`as` is \"Night Patrol\": expected 1 to 32"), "{error}");
}

/// Bodies that are refused, where, and whether the schema alone can tell.
fn malformed() -> Vec<(Value, &'static str, bool)> {
    vec![
        (json!([{"sinc": {}}]), "`body[0]` unknown field `sinc`, expected one of `sync`", true),
        (json!([{"sync": {"wait": {"al": true}}}]), "`body[0].sync.wait` unknown field `al`", true),
        (json!([{"sync": {"wait": "a"}}, {"repeat": 3}]), "`body[1]` missing field `do`", true),
        (json!([{"repeat": -1, "do": [{"sync": {}}]}]), "`body[0].repeat` invalid type: integer `-1`", true),
        (json!([{"repeat": "twice", "do": [{"sync": {}}]}]), "a number of rounds or \"forever\"", true),
        (json!([{"do": [{"sync": {}}]}]), "`body[0]` missing field `repeat`", true),
        (
            json!([{"within_s": 0.01, "do": [{"sync": {}}]}]),
            "`body[0].within_s` is too short: expected at least 0.1 s",
            true,
        ),
        (json!([{"within_s": -1, "do": [{"sync": {}}]}]), "expected seconds, 0 or more", true),
        (json!([{"repeat": 2, "within_s": 1, "do": [{"sync": {}}]}]), "put one inside the other", true),
        (json!([{"sync": {"prio": 3}}]), "`body[0].sync.prio` is not for scripts from files", true),
        (
            json!([{"sync": {"deadline": {"secs": 1, "nanos": 0}}}]),
            "`body[0].sync.deadline` is not for scripts",
            true,
        ),
        (
            json!([{"on": {"a": [{"enqueue": "b"}]}}]),
            "`body[0].on.a[0]` is `enqueue`, which is not for scripts",
            true,
        ),
        (json!([{"spawn": {"name": "n", "body": []}}]), "`body[0]` is `spawn`", true),
        (json!([{"daemon": true}]), "`body[0]` is `daemon`", true),
        (json!([{"assert_fail": "no"}]), "`body[0]` is `assert_fail`", true),
        (json!([{"on_interrupt_enqueue": "a"}]), "`body[0]` is `on_interrupt_enqueue`", true),
        (json!([{"sync": {"request": {"data": {}}}}]), "missing field `name`", true),
        (json!([{"sync": {"request": {"name": "a", "data": {"k": [1]}}}}]), "`body[0].sync.request", true),
        (
            json!([{"repeat": "forever", "do": [{"on": {"a": [{"sync": {}}]}}]}]),
            "`body[0]` may go round without a `sync`",
            false,
        ),
        (json!([{"repeat": 9, "do": []}]), "`body[0]` may go round without a `sync`", false),
        (
            json!([{"sync": {"wait": "{who}/there"}}]),
            "`body[0].sync.wait` has `{who}`, which is no parameter; there are: me, name, place, way",
            false,
        ),
        (json!([{"sync": {"wait": "{me/there"}}]), "has a brace without an end", false),
        (
            json!([{"sync": {"request": {"name": "a", "data": {"x": "{me.x}"}}}}]),
            "expected `.x`, `.y` or `.z` of a point",
            false,
        ),
        (
            json!([{"sync": {"wait": {"region": {"min": "{me}", "max": "{place}"}}}}]),
            "`body[0].sync.wait.region.min` invalid type",
            false,
        ),
        (json!([{"each": "way", "do": [{"sync": {}}]}]), "`body[0]` is expected to be { each", true),
        (
            json!([{"each": "place", "as": "p", "do": [{"sync": {}}]}]),
            "`body[0].each` is \"place\", which is no route",
            false,
        ),
        (
            json!([{"each": "me", "as": "p", "do": [{"sync": {}}]}]),
            "`body[0].each` is \"me\", which is no route",
            false,
        ),
        (
            json!([{"each": "way", "as": "me", "do": [{"sync": {}}]}]),
            "`body[0].as` is \"me\", which means something",
            false,
        ),
    ]
}

/// A file around a body, with a point and a route to refer to.
fn file(body: &Value) -> Value {
    json!({
        "name": "test", "about": "A test.", "body": body,
        "parameters": {
            "place": {"about": "A place.", "type": "point"},
            "way": {"about": "A way.", "type": "route"},
        }
    })
}

#[test]
fn malformed_bodies_are_refused_with_the_place_and_what_was_expected() {
    for (body, refusal, _) in malformed() {
        let error = ScriptFile::parse("test.json", &file(&body).to_string()).unwrap_err().to_string();
        assert!(error.starts_with("test.json"), "{error} does not name the file");
        assert!(error.contains(refusal), "{error} does not say {refusal}");
    }
}

#[test]
fn faults_outside_the_body_are_named_with_their_line() {
    for (from, to, refusal) in [
        ("name = \"patrol\"", "name = \"Patrol!\"", "f.toml: `name` is \"Patrol!\": expected 1 to 32"),
        ("about = \"Goes round.\"", "abut = \"Goes round.\"", "f.toml:3: `abut` unknown field `abut`"),
        (
            "type = \"number\"",
            "type = \"numeral\"",
            "f.toml:12: `parameters.least.type` unknown variant `numeral`",
        ),
        ("min = 10", "min = 95", "`parameters.least` `min` is 95 and `max` 90"),
        ("default = 40", "default = 4", "`parameters.least` is 4: expected 10 to 90 %"),
        (
            "type = \"route\"",
            "type = \"route\"\nmin = 3",
            "`parameters.route` `min`, `max` and `unit` are for numbers",
        ),
        ("[parameters.route]", "[parameters.me]", "`parameters.me` has a name of its own"),
        ("[[body]]\nsync", "[[body]\nsync", "f.toml:2"),
        ("ends_on = { any_data", "ends_on = { anydata", "`ends_on` unknown field `anydata`"),
    ] {
        let text = PATROL.replacen(from, to, 1);
        assert_ne!(text, PATROL, "{from}");
        let error = ScriptFile::parse("f.toml", &text).unwrap_err().to_string();
        assert!(error.contains(refusal), "{error} does not say {refusal}");
    }
    let error = ScriptFile::parse("f.json", "{\"name\": \"a\",\n \"about\": 3}").unwrap_err().to_string();
    assert!(error.starts_with("f.json:2: `about` invalid type: integer `3`, expected a string"), "{error}");
}

#[test]
fn a_script_that_is_spelled_out_too_long_is_refused() {
    let mut body = json!([{"sync": {"wait": "a"}}]);
    for name in ["p", "q", "r"] {
        body = json!([{"each": "way", "as": name, "do": body}]);
    }
    let script = ScriptFile::parse("test.json", &file(&body).to_string()).unwrap();
    let with = |points: usize| {
        BTreeMap::from([
            ("place".to_owned(), Argument::Point([0.0; 3])),
            ("way".to_owned(), Argument::Route(vec![[0.0; 3]; points])),
        ])
    };
    assert!(script.bind("uav/1", None, &with(5)).is_ok());
    let error = script.bind("uav/1", None, &with(32)).unwrap_err().to_string();
    assert!(error.contains("expected at most 400 ops"), "{error}");
}

#[test]
fn the_schema_accepts_what_the_parser_accepts() {
    let schema = Schema::read();
    let patrol: Value = toml::from_str(PATROL).unwrap();
    assert_eq!(schema.fault(&patrol), None);
    let everything = json!([
        {"sync": {"request": ["a", {"name": "b", "data": {"k": 1, "t": "x", "f": true}}], "hot": true,
                  "wait": [{"any_data": "c"}, {"named": "uav/*/d"}, {"prefix": "e"}, {"all": true}],
                  "block": {"and": [{"any_data": "f"}, {"not": {"data_has": {"leg": -1}}}]},
                  "interrupt": {"or": [{"any_data": "g", "region": {"min": "{place}", "max": [1, 2, 3]}}]}}},
        {"repeat": "forever", "do": [{"sync": {"wait": {"name": "a", "data": {"k": 2}}}}]},
        {"until": {"field_range": {"key": "z", "min": 0.5}}, "within_s": 3, "do": [{"sync": {}}, {"stop": true}]},
        {"each": "way", "as": "p", "do": [{"on": {"{me}/a": [{"stop": true}]}}]}
    ]);
    let file = file(&everything);
    assert_eq!(schema.fault(&file), None);
    ScriptFile::parse("test.json", &file.to_string()).unwrap();
}

#[test]
fn the_schema_refuses_what_it_can_tell() {
    let schema = Schema::read();
    for (body, _, can_tell) in malformed() {
        assert_eq!(schema.fault(&file(&body)).is_some(), can_tell, "{body}");
    }
    for wrong in [
        json!({"name": "a", "body": []}),
        json!({"name": "A", "about": "", "body": []}),
        json!({"name": "a", "about": "", "body": [], "more": 1}),
        json!({"name": "a", "about": "", "body": [], "parameters": {"p": {"about": "", "type": "text"}}}),
    ] {
        assert!(schema.fault(&wrong).is_some(), "{wrong}");
        assert!(ScriptFile::parse("a.json", &wrong.to_string()).is_err(), "{wrong}");
    }
}

#[test]
fn a_script_that_is_too_much_is_refused_with_the_limit_s_name() {
    let refusal = |body: &str, parameters: &str| {
        let text = format!("name = \"x\"\nabout = \"x\"\nbody = [{body}]\n{parameters}");
        ScriptFile::parse("x.toml", &text).unwrap_err().to_string()
    };
    let nested = format!("{}\"uav/1/advance\"{}", "{\"and\": [".repeat(46), "]}".repeat(46));
    let body = format!("{{\"sync\": {{\"block\": {nested}, \"wait\": \"uav/1/ready\"}}}}");
    let json = format!("{{\"name\": \"x\", \"about\": \"x\", \"body\": [{body}]}}");
    let deep = ScriptFile::parse("x.json", &json).unwrap_err().to_string();
    assert!(deep.contains("bound `set_depth`"), "{deep}");
    // Each `until` counts again at each `sync` inside it.
    let wide = format!("[{}]", vec!["\"uav/1/ready\""; 300].join(", "));
    let syncs = vec!["{ sync = { wait = \"uav/1/ready\" } }"; 20].join(", ");
    let wide = refusal(&format!("{{ until = {wide}, do = [{syncs}] }}"), "");
    assert!(wide.contains("bound `script_nodes`"), "{wide}");
    let points = vec!["[1.0, 2.0, 3.0]"; 32].join(", ");
    let route = format!("[parameters.r]\nabout = \"x\"\ntype = \"route\"\ndefault = [{points}]");
    let long = refusal(&format!("{{ sync = {{ request = \"{}\" }} }}", "{r}".repeat(2000)), &route);
    assert!(long.contains("bound `script_bytes`"), "{long}");
}

#[test]
fn a_trial_takes_no_longer_than_its_states_and_events_allow() {
    let field = |at: usize| {
        format!("{{ any_data = \"uav/1/x{at}\", field_range = {{ key = \"k{at}\", min = 0.0, max = 1.0 }} }}")
    };
    let fields: Vec<String> = (0..150).map(field).collect();
    let sync = format!("{{ sync = {{ wait = [{}] }} }}", fields.join(", "));
    let text = format!("name = \"x\"\nabout = \"x\"\nbody = [{sync}, {{ stop = true }}]\n");
    let file = ScriptFile::parse("x.toml", &text).unwrap();
    let script = file.bind("uav/1", None, &BTreeMap::new()).unwrap();
    assert!(script.bthread.listened_to().len() < 150);
    let trial = script.bthread.try_out(200).unwrap();
    assert!(trial.states > 0 && !trial.is_complete, "what it was not tried with might matter");
}
