//! The catalogue of events, and what is written down from it: `docs/events.md`, the console's words, Python's words.

use std::path::{Path, PathBuf};
use std::{env, fs};

use skein_wire::event::{
    Abort, Advance, Catalogue, Declared as _, Handover, Homeward, Launch, OrderTaken, ScriptNews, What,
    Whose, ZoneKind,
};
use skein_wire::event::{Declaration, Load, MOTION, PlanReason, ScriptState, Situation, Unload};

/// With this variable set, the files are written anew.
const WRITE: &str = "SKEIN_WRITE_GENERATED";

fn in_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// Checks that `text` stands in the file between the lines `begin` and `end`, or is all of it.
fn stands_in(path: &str, marks: Option<(&str, &str)>, text: &str) {
    let file = in_project(path);
    let now = fs::read_to_string(&file).unwrap_or_default();
    let wanted = match marks {
        None => text.to_owned(),
        Some((begin, end)) => {
            let (before, rest) = now.split_once(begin).unwrap_or_else(|| panic!("{path} has lost `{begin}`"));
            let (_, after) = rest.split_once(end).unwrap_or_else(|| panic!("{path} has lost `{end}`"));
            format!("{before}{begin}\n{text}{end}{after}")
        }
    };
    if env::var_os(WRITE).is_some() {
        fs::write(&file, wanted).unwrap();
    } else {
        assert!(
            now == wanted,
            "{path} is not what the catalogue says: write it anew with `{WRITE}=1 cargo test -p skein-wire --test it catalogue`"
        );
    }
}

#[test]
fn the_docs_list_every_event() {
    let head = "# Events\n\n\
        Written from the [catalogue](../protocol/wire/src/event/mod.rs), in which each event is declared once. *Own* events are \
        neither requested nor blocked\nfrom afar; an *operator's* are requested from afar and blocked by nobody there; *anyone's* \
        are requested and blocked by whoever has the right.\n";
    stands_in("docs/events.md", None, &format!("{head}{}", Catalogue::standard()));
}

#[test]
fn the_console_knows_the_orders() {
    let mut text = "/**\n * The words of orders, from the catalogue of events (protocol/wire/src/event). Do not edit: a test of \
        skein-wire writes it.\n */\n\n"
        .to_owned();
    let list = |name: &str, words: &[&str]| {
        let lines: Vec<String> = words.iter().map(|word| format!("  {}: '{word}',\n", camel(word))).collect();
        format!(
            "export const {name} = {{\n{}}} as const;\nexport type {name} = (typeof {name})[keyof typeof {name}];\n",
            lines.concat()
        )
    };
    text += &list("What", What::WORDS);
    text += &format!("\n/** What is drawn on the map. */\n{}", list("ZoneKind", ZoneKind::WORDS));
    let mut set = |name: &str, about: &str, is_so: fn(What) -> bool| {
        let words: Vec<String> =
            What::those(is_so).map(|what| format!("What.{}", camel(what.word()))).collect();
        text += &format!(
            "\n/** {about} */\nexport const {name}: ReadonlySet<What> = new Set([{}]);\n",
            words.join(", ")
        );
    };
    set("FOR_ALL", "These are decided for everyone, whoever is selected.", What::is_for_all);
    set("FOR_SAFETY", "These bring vehicles to a stop, home, or down.", What::is_for_safety);
    stands_in("ground/console/src/vocabulary.ts", None, &text);
}

fn camel(word: &str) -> String {
    let mut parts = word.split('_');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |name, part| name + &part[..1].to_uppercase() + &part[1..])
}

#[test]
fn the_python_operator_knows_the_events_that_it_speaks_of() {
    let events = [
        ("ORDER", OrderTaken::NAME),
        ("HANDOVER", Handover::NAME),
        ("LOAD", Load::NAME),
        ("UNLOAD", Unload::NAME),
        ("SCRIPT", ScriptNews::NAME),
        ("ADVANCE", Advance::NAME),
        ("HOMEWARD", Homeward::NAME),
        ("ROSTER", skein_dbp::NewRoster::NAME),
    ];
    let mut text: String = events.map(|(constant, name)| format!("{constant} = \"{name}\"\n")).concat();
    for what in
        [What::Hold, What::Land, What::Return, What::Resume, What::Ask, What::Give, What::Take, What::Release]
    {
        text += &format!("TO_{} = \"{what}\"\n", what.word().to_uppercase());
    }
    for state in [ScriptState::Accepted, ScriptState::Refused, ScriptState::Withdrawn] {
        text += &format!("{} = \"{state}\"\n", state.word().to_uppercase());
    }
    let marks = ("# Words of the catalogue of events:", "# End of the words.");
    stands_in("protocol/python/skein_operator.py", Some(marks), &text);
}

#[test]
fn no_two_events_of_a_vehicle_have_one_name() {
    let catalogue = Catalogue::standard();
    let mut names: Vec<&str> = catalogue.at_vehicle().map(|event| event.name).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
    assert!(MOTION.iter().all(|event| names.contains(&event.name)));
}

#[test]
fn events_of_another_crate_are_known_beside_skeins_own() {
    skein_bp::events! {
        /// The events of a beacon.
        const BEACON;

        /// The beacon blinks.
        Blink = "blink", Own {
            /// How often.
            times: i64 ["", 1.0..=9.0],
        }
    }
    let catalogue = Catalogue::standard().with(BEACON);
    assert!(catalogue.own().any(|event| event.name == Blink::NAME));
    assert!(Catalogue::standard().own().all(|event| event.name != Blink::NAME));
    assert!(
        catalogue
            .to_string()
            .contains("| `blink` | own | `times`: whole number, 1 to 9. How often. | The beacon blinks. |")
    );
    let blink = |times: i64| Blink { times }.at("uav/1");
    assert_eq!(Blink::read(&blink(3)).map(|blink| blink.times), Some(3));
    assert!(Blink::read(&blink(10)).is_none(), "out of its range");
}

#[test]
fn what_a_vehicle_takes_and_its_own_are_as_they_were() {
    let named = |events: &mut dyn Iterator<Item = &'static Declaration>| {
        events.map(|event| event.name).collect::<Vec<_>>()
    };
    let catalogue = Catalogue::standard();
    assert_eq!(named(&mut catalogue.gateway()), ["order", "handover", "load", "unload"]);
    assert_eq!(catalogue.own().count(), 55);
    let others = catalogue.of_vehicle().filter(|event| event.whose == Whose::Anyone);
    assert_eq!(
        named(&mut { others }),
        ["takeoff", "goto", "advance", "enter", "fly_by", "complete", "failed", "disregard"]
    );
    assert_eq!([Launch::NAME, Abort::NAME], [What::Launch.word(), What::Abort.word()]);
}

#[test]
fn words_are_read_as_they_are_written() {
    assert!(What::ALL.iter().all(|what| What::of_word(what.word()) == Some(*what)));
    assert!(PlanReason::ALL.iter().all(|why| PlanReason::of_word(why.word()) == Some(*why)));
    assert!(Situation::ALL.iter().all(|found| Situation::of_word(found.word()) == Some(*found)));
    assert_eq!(What::of_word("dance"), None);
}
