//! Event sets: what they hold, and how they are written.

use std::collections::BTreeMap;
use std::time::Duration;

use proptest::prelude::*;
use serde_json::json;
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Bound, Event, EventSet, Pattern, Program, ProgramConfig, Value};

fn goto(x: f64, y: f64) -> Event {
    Event::new("uav/3/goto").with("x", x).with("y", y)
}

#[test]
fn each_form_holds_what_it_says() {
    let holds = |set: &EventSet, event: &Event| set.contains(event);
    let event = goto(1.0, 2.0).with("n", 3).with("who", "pilot");
    assert!(holds(&EventSet::All, &event) && !holds(&EventSet::None, &event));
    assert!(holds(&event.clone().into(), &event) && !holds(&EventSet::Exactly("uav/3/goto".into()), &event));
    assert!(
        holds(&"uav/3/goto".into(), &event)
            && holds(&"uav/*/goto".into(), &event)
            && !holds(&"uav/4/**".into(), &event)
    );
    assert!(holds(&EventSet::prefix("uav/3/go"), &event) && !holds(&EventSet::prefix("uav/3/x"), &event));
    assert!(holds(&EventSet::field_range("n", 3.0, 4.0), &event), "a whole number counts, borders included");
    assert!(
        !holds(&EventSet::field_range("n", 3.1, 4.0), &event)
            && !holds(&EventSet::field_range("who", 0.0, 9.0), &event)
    );
    assert!(
        holds(&EventSet::field_is("who", "pilot"), &event) && !holds(&EventSet::field_is("n", "3"), &event)
    );
    assert!(holds(&EventSet::field_is("n", 3.0), &event), "3 is 3.0, however it is written");
    assert!(holds(&EventSet::from(["nothing", "uav/3/goto"]), &event));
    assert!(!holds(&(!EventSet::from("uav/**")), &event));
}

#[test]
fn a_region_needs_x_and_y_and_takes_a_missing_z() {
    let region = EventSet::region([0.0, 0.0, 1.0], [2.0, 2.0, 3.0]);
    assert!(region.contains(&goto(2.0, 0.0)));
    assert!(region.contains(&goto(1.0, 1.0).with("z", 3)));
    assert!(!region.contains(&goto(1.0, 1.0).with("z", 0.5)));
    assert!(!region.contains(&goto(1.0, 2.5)));
    assert!(!region.contains(&Event::new("uav/3/goto").with("x", 1.0)));
    assert!(!region.contains(&goto(f64::NAN, 1.0)));
}

#[test]
fn homes_are_matched_with_care() {
    let may = |set: EventSet| set.could_match_home("uav/3");
    assert!(may("uav/3/go".into()) && may("uav/*/go".into()) && may("**".into()) && may("*/3/go".into()));
    assert!(!may("uav/4/go".into()) && !may("ground/**".into()) && !may("uav/31/go".into()));
    assert!(may(EventSet::prefix("uav/3")) && may(EventSet::prefix("u")) && !may(EventSet::prefix("uav/4/")));
    assert!(may(EventSet::All) && !may(EventSet::None) && may(EventSet::All.and("uav/3/x")));
    assert!(
        !may(EventSet::field_is("k", 1).and("uav/4/x")),
        "one member of an intersection is enough to tell"
    );
    assert!(may(EventSet::from("uav/4/x").or("uav/3/x")));
    assert!(may(EventSet::from("uav/3/x").not()));
}

#[test]
fn a_name_is_enough_to_tell_what_data_cannot_change() {
    let inside = EventSet::region([0.0; 3], [1.0; 3]);
    let goto = EventSet::named("uav/3/goto").and(inside.not());
    assert!(goto.may_hold_named("uav/3/goto") && !goto.holds_all_named("uav/3/goto"));
    assert!(!goto.may_hold_named("uav/3/land"), "one of another name");
    let but_land = EventSet::from("uav/3/**").and(EventSet::named("uav/3/land").not());
    assert!(but_land.holds_all_named("uav/3/goto") && !but_land.may_hold_named("uav/3/land"));
}

#[test]
fn the_written_forms_are_those_of_the_notation() {
    let forms = [
        (json!("e"), EventSet::Exactly("e".into())),
        (json!({"name": "e", "data": {"k": 1}}), EventSet::Exactly(Event::new("e").with("k", 1))),
        (json!({"all": true}), EventSet::All),
        (json!({"all": false}), EventSet::None),
        (json!({"any_data": "e"}), EventSet::named("e")),
        (json!({"named": "a/*"}), "a/*".into()),
        (json!({"prefix": "a"}), EventSet::prefix("a")),
        (json!({"data_has": {"k": true}}), EventSet::field_is("k", true)),
        (
            json!({"field_range": {"key": "z", "min": 1.0, "max": null}}),
            EventSet::field_range("z", 1.0, f64::INFINITY),
        ),
        (
            json!({"region": {"min": [0.0, 0.0, null], "max": [1.0, 1.0, null]}}),
            EventSet::region([0.0, 0.0, f64::NEG_INFINITY], [1.0, 1.0, f64::INFINITY]),
        ),
        (json!({"not": "e"}), EventSet::Exactly("e".into()).not()),
        (json!({"and": ["e", {"prefix": "a"}]}), EventSet::Exactly("e".into()).and(EventSet::prefix("a"))),
        (json!(["e", "f"]), EventSet::Exactly("e".into()).or(Event::new("f"))),
    ];
    for (written, set) in forms {
        assert_eq!(serde_json::from_value::<EventSet>(written.clone()).unwrap(), set, "{written}");
        assert_eq!(serde_json::to_value(&set).unwrap(), written);
    }
}

#[test]
fn several_keys_mean_all_of_them() {
    let set: EventSet = serde_json::from_value(json!({"any_data": "e", "data_has": {"k": 1}})).unwrap();
    assert!(set.contains(&Event::new("e").with("k", 1)) && !set.contains(&Event::new("e")));
    let set: EventSet = serde_json::from_value(json!({"or": ["e", "f"]})).unwrap();
    assert!(set.contains(&"f".into()));
}

#[test]
fn event_data_is_sorted_and_replaced() {
    let event = Event::new("e").with("b", 1).with("a", 2.5).with("b", "x");
    assert_eq!(event.to_string(), r#"e{a: 2.5, b: "x"}"#);
    assert_eq!(
        (event.real("a"), event.text("b"), event.int("a"), event.bool("c")),
        (Some(2.5), Some("x"), None, None)
    );
    assert_eq!(Event::new("e").with("n", 2).real("n"), Some(2.0));
    assert_eq!(Event::new("e").with("x", 0.0), Event::new("e").with("x", -0.0));
}

fn name() -> impl Strategy<Value = String> {
    prop::collection::vec(prop_oneof!["a", "b", "c", "1", "12"], 1..4).prop_map(|chunks| chunks.join("/"))
}

fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        any::<bool>().prop_map(Value::from),
        (0..3_i64).prop_map(Value::from),
        (-1.0..1.0).prop_map(|x: f64| x.into()),
        "[xy]".prop_map(Value::from)
    ]
}

fn event() -> impl Strategy<Value = Event> {
    let data = prop::collection::btree_map("[xyzk]", value(), 0..3);
    (name(), data).prop_map(|(name, data)| {
        data.into_iter().fold(Event::new(name), |event, (key, value)| event.with(key, value))
    })
}

fn event_set() -> impl Strategy<Value = EventSet> {
    let pattern = prop::collection::vec(prop_oneof!["a", "b", "1", "\\*", "\\*\\*"], 1..4)
        .prop_map(|chunks| chunks.join("/"));
    let leaf = prop_oneof![
        Just(EventSet::None),
        Just(EventSet::All),
        event().prop_map(EventSet::Exactly),
        pattern.prop_map(EventSet::from),
        name().prop_map(EventSet::named),
        "[ab]/?[1a]?/?".prop_map(EventSet::prefix),
        (-1.0..1.0, -1.0..1.0).prop_map(|(a, b)| EventSet::field_range("x", a, b)),
        ("[xyk]", value()).prop_map(|(key, value)| EventSet::FieldIs(BTreeMap::from([(key.into(), value)]))),
        (-1.0..1.0, -1.0..1.0).prop_map(|(a, b)| EventSet::region([a, b, 0.0], [b, a, 1.0])),
    ];
    leaf.prop_recursive(3, 12, 3, |set| {
        prop_oneof![
            set.clone().prop_map(|set| EventSet::Not(Box::new(set))),
            prop::collection::vec(set.clone(), 0..3).prop_map(EventSet::And),
            prop::collection::vec(set, 0..3).prop_map(EventSet::Or),
        ]
    })
}

#[test]
fn what_is_surely_within_a_set_is_known() {
    let set = |pattern: &str| EventSet::from(pattern);
    for (inner, outer) in
        [("uav/3/enter", "uav/*/enter"), ("uav/*/enter", "uav/**"), ("uav/3/**", "**"), ("a/*/c", "a/**")]
    {
        assert!(set(inner).is_within(&set(outer)), "{inner} in {outer}");
        assert!(!set(outer).is_within(&set(inner)), "{outer} in {inner}");
    }
    let claim = set("uav/*/enter").and(set("uav/3/enter").not()).and(EventSet::region([0.0; 3], [1.0; 3]));
    assert!(claim.is_within(&set("uav/*/enter")));
    assert!(claim.is_within(&set("uav/*/land").or("uav/*/enter")));
    assert!(claim.is_within(&set("uav/*/land").not()));
    assert!(!claim.is_within(&set("uav/*/land")));
    let but_facts = |home: EventSet| set("uav/1/**").and(home.and(set("uav/1/fact").not()));
    let (narrow, wide) =
        (but_facts(EventSet::prefix("uav/1/")), but_facts(EventSet::prefix("uav/1/").or("swarm/**")));
    assert!(narrow.is_within(&wide), "what is kept out of both does not matter");
    assert!(set("uav/3/*").is_within(&EventSet::prefix("uav/3/")));
    assert!(EventSet::prefix("uav/3/go").is_within(&set("uav/3/**")));
    assert!(EventSet::from(goto(1.0, 2.0)).is_within(&EventSet::field_range("x", 0.0, 2.0)));
    assert!(!EventSet::All.is_within(&set("**").and(EventSet::field_range("x", 0.0, 2.0))));
}

/// `leaf` inside so many sets of a kind.
fn nested(levels: usize, leaf: &EventSet, around: impl Fn(EventSet) -> EventSet) -> EventSet {
    (0..levels).fold(leaf.clone(), |set, _| around(set))
}

/// Sets whose walk must not take longer for each level than for the one before.
fn deep_sets() -> Vec<EventSet> {
    let leaf = EventSet::from("uav/*/advance");
    let more = || EventSet::from("uav/**");
    vec![
        nested(200, &leaf, |set| EventSet::And(vec![set])),
        nested(200, &leaf, |set| EventSet::And(vec![more(), set, more()])),
        nested(200, &leaf, |set| EventSet::Or(vec![EventSet::And(vec![set, more()])])),
        nested(200, &leaf, |set| EventSet::Not(Box::new(EventSet::And(vec![set, more()])))),
    ]
}

#[test]
fn no_walk_takes_longer_for_each_level_than_for_the_one_before() {
    let event = Event::new("uav/3/advance");
    for set in deep_sets() {
        assert!(set.contains(&event), "{set}");
        assert!(set.could_match_home("uav/3") && set.may_overlap(&EventSet::All));
        assert!(set.may_hold_named("uav/3/advance") && !set.is_none());
        assert!(set.about(&EventSet::prefix("uav/3/")).contains(&event));
        let mut program = Program::new(ProgramConfig::default());
        program.put_proxy("hostile", &Bid::new().block(set.clone()));
        program.add("advance", Script::new(&[Op::Sync(Bid::new().request(event.clone()))]).unwrap());
        assert_eq!(program.superstep(Duration::ZERO).unwrap(), []);
        assert_eq!(program.explain("uav/3/advance").blocked.len(), 1);
        assert_eq!(program.explain("uav/3/other").blocked.len(), 1);
        program.remove_proxy("hostile");
        assert_eq!(program.superstep(Duration::ZERO).unwrap().len(), 1);
    }
}

/// What a campaign counts, and sees when a bound is taken away.
#[cfg(feature = "mutants")]
#[test]
fn the_sets_looked_at_are_in_proportion_unless_the_bound_is_taken_away() {
    use skein_bp::bound::mutants::nodes;
    let set = nested(14, &EventSet::from("uav/*/advance"), |set| EventSet::And(vec![set, "uav/**".into()]));
    let looked_at = || {
        let before = nodes();
        assert!(set.could_match_home("uav/3"));
        nodes() - before
    };
    assert!(looked_at() <= 2 * set.extent().nodes as u64);
    let removed = Bound::SetWalk.remove();
    assert!(looked_at() > 10_000);
    drop(removed);
    assert!(looked_at() <= 2 * set.extent().nodes as u64);
}

#[test]
fn two_sets_that_are_hard_to_compare_are_not_within_one_another() {
    let leaf = |text: &str| EventSet::from(text);
    let inner = nested(100, &leaf("a"), |set| EventSet::And(vec![set, leaf("c")]));
    let outer = nested(100, &leaf("b"), |set| EventSet::Or(vec![set, leaf("d")]));
    assert!(!inner.is_within(&outer) && !outer.is_within(&inner));
    assert!(inner.is_within(&inner.clone()), "it is itself");
}

#[test]
fn a_set_of_one_name_many_times_is_one_candidate() {
    // A thousand times the same blocker, asked for a thousand times, would take a million steps an event.
    let many = |set: &EventSet| EventSet::Or(vec![set.clone(); 1000]);
    let mut program = Program::new(ProgramConfig::default());
    let miss = EventSet::field_range("x", 5.0, 6.0);
    program.put_proxy("hostile", &Bid::new().block(many(&miss)));
    let tap = Bid::new().request("uav/3/tap");
    program.add("tap", Script::new(&[Op::repeat(2000, [Op::Sync(tap)])]).unwrap());
    assert_eq!(program.superstep(Duration::ZERO).unwrap().len(), 2000);
}

#[test]
fn files_say_which_limit_a_set_exceeds() {
    let read = |text: &str| serde_json::from_str::<EventSet>(text).map_err(|error| error.to_string());
    let wrap = |levels: usize| format!("{}\"a\"{}", "{\"and\": [".repeat(levels), "]}".repeat(levels));
    assert!(read(&wrap(Bound::SetDepth.stated() - 1)).is_ok());
    let deep = read(&wrap(46)).unwrap_err();
    assert!(deep.contains("17 levels") && deep.contains("at most 16 (bound `set_depth`)"), "{deep}");
    let wide = read(&format!("[{}]", vec!["\"a\""; 2048].join(", "))).unwrap_err();
    assert!(wide.contains("2049 sets") && wide.contains("bound `set_nodes`"), "{wide}");
    let long = read(&format!("{{\"prefix\": \"{}\"}}", "x".repeat(257))).unwrap_err();
    assert!(long.contains("257 bytes of a name") && long.contains("bound `name_bytes`"), "{long}");
    let stars = read(&format!("{{\"named\": \"{}\"}}", vec!["**"; 17].join("/"))).unwrap_err();
    assert!(stars.contains("bound `name_chunks`"), "{stars}");
    let event = serde_json::from_str::<Event>(&format!("\"{}\"", "x".repeat(257))).unwrap_err();
    assert!(event.to_string().contains("bound `name_bytes`"), "{event}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn sets_are_an_algebra(a in event_set(), b in event_set(), e in event()) {
        let (in_a, in_b) = (a.contains(&e), b.contains(&e));
        prop_assert_eq!(a.clone().and(b.clone()).contains(&e), in_a && in_b);
        prop_assert_eq!(a.clone().or(b.clone()).contains(&e), in_a || in_b);
        prop_assert_eq!(a.clone().not().contains(&e), !in_a);
        prop_assert!(!(a.is_none() && in_a));
        prop_assert!(!(in_a && in_b) || a.may_overlap(&b), "they share {}", e);
        prop_assert!(!in_a || a.could_match_home(e.home()));
        prop_assert_eq!(a.about(&b).contains(&e) && in_b, in_a && in_b);
        prop_assert!(!in_a || a.may_hold_named(e.name()));
        prop_assert!(in_a || !a.holds_all_named(e.name()));
        prop_assert!(!a.is_within(&b) || !in_a || in_b, "{} is not in {}", e, b);
    }

    #[test]
    fn what_is_written_is_read_the_same(set in event_set(), event in event()) {
        let text = serde_json::to_string(&set).unwrap();
        prop_assert_eq!(serde_json::from_str::<EventSet>(&text).unwrap(), set, "{}", text);
        let text = serde_json::to_string(&event).unwrap();
        prop_assert_eq!(serde_json::from_str::<Event>(&text).unwrap(), event, "{}", text);
    }

    #[test]
    fn a_pattern_fits_what_a_regular_expression_of_chunks_would(name in name(), pattern in "(a|b|1|\\*|\\*\\*)(/(a|b|1|\\*|\\*\\*)){0,3}") {
        fn fits(pattern: &[&str], name: &[&str]) -> bool {
            match (pattern.split_first(), name.split_first()) {
                (None, _) => name.is_empty(),
                (Some((&"**", rest)), _) => (0..=name.len()).any(|skip| fits(rest, &name[skip..])),
                (Some((chunk, rest)), Some((first, others))) => (*chunk == "*" || chunk == first) && fits(rest, others),
                (Some(_), None) => false,
            }
        }
        let (chunks, names): (Vec<_>, Vec<_>) = (pattern.split('/').collect(), name.split('/').collect());
        prop_assert_eq!(Pattern::new(pattern.as_str()).matches(&name), fits(&chunks, &names));
    }
}
