//! Lists that a node keeps: the scripts that a vehicle was sent, the zones that a station has drawn.

use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use skein_wire::{KeptScript, KeptZone, NodeName, Saving, Store};

use crate::lost::Lost;
use crate::node_file;

/// The version of the file's form.
const VERSION: u32 = 1;

/// Keeps a list in `<folder>/<node>.<list>.json`, written whole each time.
#[derive(Debug)]
pub struct ListStore<T> {
    path: PathBuf,
    list: &'static str,
    of: PhantomData<fn(T)>,
}

#[derive(Deserialize)]
struct Version {
    version: u32,
}

impl ListStore<KeptScript> {
    /// The store of the vehicle `node` in `folder`, and the scripts that a former life has kept there. A file that cannot
    /// be understood is set aside as `<node>.scripts.json.damaged` and told of: for its sake no vehicle stays on the
    /// ground, or in the air without its agent.
    pub fn of_scripts(folder: &Path, node: &NodeName) -> (Self, Result<Vec<KeptScript>, Lost>) {
        let what = "the scripts that this vehicle had been sent are kept there, as JSON: it flies without them, send them \
                    again";
        Self::open(folder, node, "scripts", what)
    }
}

impl ListStore<KeptZone> {
    /// The store of the station `node` in `folder`, and the zones that a former life has kept there. A file that cannot
    /// be understood is set aside as `<node>.zones.json.damaged` and told of.
    pub fn of_zones(folder: &Path, node: &NodeName) -> (Self, Result<Vec<KeptZone>, Lost>) {
        let what = "the zones that this station had drawn are kept there, as JSON: vehicles keep those that they have, draw \
                    them again";
        Self::open(folder, node, "zones", what)
    }
}

impl<T: DeserializeOwned> ListStore<T> {
    fn open(
        folder: &Path,
        node: &NodeName,
        list: &'static str,
        what: &'static str,
    ) -> (Self, Result<Vec<T>, Lost>) {
        let path = node_file::path_of(folder, node, &format!("{list}.json"));
        let kept = match node_file::read(&path) {
            Ok(Some(text)) => parse(&text, list),
            Ok(None) => Ok(Vec::new()),
            Err(error) => Err(error.to_string()),
        };
        let kept = kept.map_err(|problem| Lost::set_aside(&path, problem, what));
        (Self { path, list, of: PhantomData }, kept)
    }
}

impl<T: std::fmt::Debug + Serialize> Store<Vec<T>> for ListStore<T> {
    fn save(&mut self, entries: &Vec<T>) -> Saving {
        node_file::replace(&self.path, &json!({ "version": VERSION, self.list: entries }))
    }
}

/// The list that a file holds. Its version is read first: another version's form may be any.
fn parse<T: DeserializeOwned>(text: &[u8], list: &str) -> Result<Vec<T>, String> {
    let in_words = |error: serde_json::Error| error.to_string();
    let Version { version } = serde_json::from_slice(text).map_err(in_words)?;
    if version != VERSION {
        return Err(format!("`version` is {version}: expected {VERSION}"));
    }
    let mut content: Map<String, Value> = serde_json::from_slice(text).map_err(in_words)?;
    let entries = content.remove(list).ok_or_else(|| format!("`{list}` is missing"))?;
    match content.keys().find(|key| *key != "version") {
        Some(key) => Err(format!("`{key}` is unknown: expected `version` and `{list}`")),
        None => serde_json::from_value(entries).map_err(|error| format!("`{list}`: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use skein_bp::script::{Argument, Assignment, ScriptFile};

    use super::*;

    fn node() -> NodeName {
        NodeName::new("uav/1").unwrap()
    }

    fn patrol() -> KeptScript {
        let script =
            ScriptFile::parse("patrol.toml", include_str!("../../../agent/scripts/patrol.toml")).unwrap();
        let with = [("route".to_owned(), Argument::Route(vec![[0.1, 2.0, 1e-7]]))].into();
        let called = Some("round".to_owned());
        KeptScript {
            from: "ground/main#scripts for uav/1".into(),
            assignment: Assignment { script, with, called },
        }
    }

    #[test]
    fn scripts_are_there_in_the_next_life_and_those_given_up_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state");
        let (mut store, nothing) = ListStore::of_scripts(&state, &node());
        assert_eq!(nothing.unwrap(), []);
        for kept in [vec![patrol()], vec![]] {
            assert_eq!(store.save(&kept), Saving::Done);
            assert_eq!(ListStore::of_scripts(&state, &node()).1.unwrap(), kept);
        }
        assert_eq!(fs::read_dir(state).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn a_damaged_file_is_named_and_set_aside_and_the_next_script_is_kept() {
        let whole = serde_json::to_string(&json!({ "version": VERSION, "scripts": [patrol()] })).unwrap();
        for (text, why) in [
            (&whole[..whole.len() / 2], "EOF"),
            ("", "EOF"),
            ("\u{0}\u{0}", "line 1"),
            (r#"{"version": 2, "swarm": []}"#, "`version` is 2: expected 1"),
            (r#"{"version": 1, "scripts": [{"from": 3}]}"#, "`scripts`: invalid type"),
            (r#"{"version": 1, "scripts": [], "more": 1}"#, "`more`"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("uav-1.scripts.json");
            fs::write(&path, text).unwrap();
            let (mut store, lost) = ListStore::of_scripts(folder.path(), &node());
            let lost = lost.unwrap_err().to_string();
            let aside = folder.path().join("uav-1.scripts.json.damaged");
            for part in [path.to_str().unwrap(), why, aside.to_str().unwrap()] {
                assert!(lost.contains(part), "{lost} does not say {part}");
            }
            assert_eq!(fs::read_to_string(aside).unwrap(), text);
            assert_eq!(store.save(&vec![patrol()]), Saving::Done);
            assert_eq!(ListStore::of_scripts(folder.path(), &node()).1.unwrap(), [patrol()]);
        }
    }

    #[test]
    fn zones_are_there_in_the_next_life() {
        let folder = tempfile::tempdir().unwrap();
        let station = NodeName::new("ground/main").unwrap();
        let zone =
            r#"{"name":"pond","kind":"no_fly","centre_m":[1.001,2.0],"radius_m":5.3}"#.parse().unwrap();
        let kept = vec![KeptZone { by: "Anna".to_owned(), zone }];
        let (mut store, nothing) = ListStore::of_zones(folder.path(), &station);
        assert_eq!(nothing.unwrap(), []);
        assert_eq!(store.save(&kept), Saving::Done);
        assert_eq!(ListStore::of_zones(folder.path(), &station).1.unwrap(), kept);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file_not_folder = folder.path().join("state");
        fs::write(&file_not_folder, "").unwrap();
        let (mut store, _) = ListStore::of_scripts(&file_not_folder, &node());
        let saving = store.save(&vec![]);
        assert!(matches!(&saving, Saving::Failed(why) if why.contains("uav-1.scripts.json")), "{saving:?}");
    }
}
