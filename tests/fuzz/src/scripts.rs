//! Scripts, in TOML and in JSON, and scripts with values as they are sent.

use skein_bp::script::{Assignment, ScriptFile};

use crate::target::{Allowed, Reached, Target};

/// A script's braces may be filled with text many times as long: up to the bound `script_bytes`, whatever its length.
pub const TARGET: Target =
    Target { name: "scripts", allowed: Allowed { bytes: 16 << 20, per_byte: 3000 }, read, seeds };

/// So many states are looked at before a vehicle takes in a script.
const STATES_TRIED: usize = 200;

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    let as_file = ScriptFile::parse("script.toml", text).or_else(|_| ScriptFile::parse("script.json", text));
    let as_sent = Assignment::from_json(text);
    match (as_file, as_sent) {
        (Ok(script), _) => {
            let json = serde_json::to_string(&script).expect("a script is written");
            // Written, it may be longer than what is read.
            if let Ok(again) = ScriptFile::parse("script.json", &json) {
                assert_eq!(again, script);
            }
            Reached::read(script.name.len() == 3)
        }
        (_, Ok(assignment)) => {
            if let Ok(json) = assignment.to_json() {
                assert_eq!(Assignment::from_json(&json).as_ref(), Ok(&assignment));
            }
            if let Ok(script) = assignment.bind("uav/1") {
                let _ = script.bthread.try_out(STATES_TRIED);
            }
            Reached::read(assignment.with.len() == 2)
        }
        _ => Reached::Refused,
    }
}

const FOLLOW: &str = include_str!("../../../agent/scripts/follow.toml");

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let files = [
        ("alternate", include_str!("../../../agent/scripts/alternate.toml")),
        ("curfew", include_str!("../../../agent/scripts/curfew.toml")),
        ("follow", FOLLOW),
        ("keep-low", include_str!("../../../agent/scripts/keep-low.toml")),
        ("patrol", include_str!("../../../agent/scripts/patrol.toml")),
    ];
    let script = ScriptFile::parse("follow.toml", FOLLOW).expect("our own script");
    let json = serde_json::to_vec(&script).expect("a script is written");
    let sent = Assignment { script, with: Default::default(), called: Some("again".into()) };
    let sent = sent.to_json().expect("it is short").into_bytes();
    let texts = files.map(|(name, text)| (name, text.as_bytes().to_vec()));
    texts.into_iter().chain([("follow.json", json), ("sent.json", sent)]).collect()
}
