//! The table of crates in ARCHITECTURE.md, held against their manifests.

use std::collections::{BTreeMap, BTreeSet};

use crate::{members, root};

/// A crate's row: those that it may know.
fn table() -> BTreeMap<String, BTreeSet<String>> {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let rows = text.lines().filter_map(|line| {
        let cells: Vec<_> = line.trim().trim_matches('|').split('|').map(str::trim).collect();
        let &[_, name, _, knows] = cells.as_slice() else { return None };
        let known = knows.split([',', ';', ' ']).filter(|word| !word.is_empty());
        name.starts_with("skein-")
            .then(|| (name.to_owned(), known.map(|word| format!("skein-{word}")).collect::<BTreeSet<_>>()))
    });
    rows.collect()
}

#[test]
fn crates_know_those_that_the_table_of_crates_says_and_no_others() {
    let table = table();
    let mut wrong = Vec::new();
    for (_, manifest) in members() {
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        let Some(row) = table.get(&name) else {
            wrong.push(format!("{name} has no row"));
            continue;
        };
        let dependencies = manifest.get("dependencies").and_then(toml::Value::as_table);
        let known: BTreeSet<_> = dependencies
            .into_iter()
            .flat_map(|table| table.keys())
            .filter(|dependency| dependency.starts_with("skein-"))
            .cloned()
            .collect();
        if known != *row {
            wrong.push(format!("{name} depends on {known:?}; its row says {row:?}"));
        }
    }
    assert!(wrong.is_empty(), "ARCHITECTURE.md and the manifests differ:\n{}", wrong.join("\n"));
}

#[test]
fn each_crate_stands_below_those_that_know_it() {
    let mut below = BTreeSet::new();
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let table = table();
    for line in text.lines() {
        let Some(name) = line.trim().trim_matches('|').split('|').map(str::trim).nth(1) else { continue };
        if let Some(row) = table.get(name) {
            let above: Vec<_> = row.difference(&below).collect();
            assert!(above.is_empty(), "{name} knows {above:?}, which stand further down in the table");
            below.insert(name.to_owned());
        }
    }
    assert_eq!(below.len(), table.len());
}
