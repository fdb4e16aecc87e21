//! What a browser says to the console.

use skein_ground::console::check_message;

use crate::target::{Allowed, Reached, Target};

/// A script in a message is tried: see the target `scripts`.
pub const TARGET: Target =
    Target { name: "requests", allowed: Allowed { bytes: 16 << 20, per_byte: 3000 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    match check_message(text) {
        Err(_) => Reached::Refused,
        Ok(()) => Reached::read(text.contains("\"to\":[]") || text.contains("\"point\":[0,0,")),
    }
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let script = "name = \"pause\"\\nabout = \"Waits.\"\\n[[body]]\\nwithin_s = 2.0\\ndo = [{ sync = { block = { any_data = \\\"{me}/advance\\\" } } }]";
    let read = format!(
        r#"{{"type":"read_script","tag":"1","file":"pause.toml","text":"{}"}}"#,
        script.replace("\\\"", "\"").replace('"', "\\\"")
    );
    let script =
        r#"{"name":"pause","about":"Waits.","body":[{"sync":{"wait":{"any_data":"{me}/arrived"}}}]}"#;
    let load = format!(
        r#"{{"type":"order","what":"load","to":["uav/1"],"script":{{"script":{script},"with":{{}}}}}}"#
    );
    vec![
        ("hello", r#"{"type":"hello","tag":"1","name":"Anna"}"#.into()),
        ("hold", r#"{"type":"order","tag":"2","what":"hold","to":"all"}"#.into()),
        ("goto", r#"{"type":"order","what":"goto","to":["uav/1","uav/2"],"point":[1.5,-2,null]}"#.into()),
        ("why", r#"{"type":"why","vehicle":"uav/1"}"#.into()),
        ("read", read.into()),
        ("load", load.into()),
    ]
}
