//! The scripts that a vehicle was sent.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use skein_wire::{KeptScript, NodeName, Saving, Store};

use crate::lost::Lost;
use crate::node_file;

/// The version of the file's form.
const VERSION: u32 = 1;

/// Keeps the scripts that were sent to a vehicle in `<folder>/<node>.scripts.json`, written whole each time.
#[derive(Debug)]
pub struct ScriptStore(PathBuf);

#[derive(Serialize)]
struct Content<'a> {
    version: u32,
    scripts: &'a [KeptScript],
}

#[derive(Deserialize)]
struct Version {
    version: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OwnedContent {
    #[serde(rename = "version")]
    _version: u32,
    scripts: Vec<KeptScript>,
}

impl ScriptStore {
    /// The store of `node` in `folder`, and the scripts that a former life has kept there. A file that cannot be
    /// understood is set aside as `<node>.scripts.json.damaged` and told of: for its sake no vehicle stays on the
    /// ground, or in the air without its agent.
    pub fn open(folder: &Path, node: &NodeName) -> (Self, Result<Vec<KeptScript>, Lost>) {
        let path = node_file::path_of(folder, node, "scripts.json");
        let kept = match node_file::read(&path) {
            Ok(Some(text)) => parse(&text),
            Ok(None) => Ok(Vec::new()),
            Err(error) => Err(error.to_string()),
        };
        let what = "the scripts that this vehicle had been sent are kept there, as JSON: it flies without them, send them \
                    again";
        let kept = kept.map_err(|problem| Lost::set_aside(&path, problem, what));
        (Self(path), kept)
    }
}

impl Store<Vec<KeptScript>> for ScriptStore {
    fn save(&mut self, scripts: &Vec<KeptScript>) -> Saving {
        node_file::replace(&self.0, &Content { version: VERSION, scripts })
    }
}

/// The scripts that a file holds. Its version is read first: another version's form may be any.
fn parse(text: &[u8]) -> Result<Vec<KeptScript>, String> {
    let Version { version } = serde_json::from_slice(text).map_err(|error| error.to_string())?;
    if version != VERSION {
        return Err(format!("`version` is {version}: expected {VERSION}"));
    }
    let content: OwnedContent = serde_json::from_slice(text).map_err(|error| error.to_string())?;
    Ok(content.scripts)
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
        let (mut store, nothing) = ScriptStore::open(&state, &node());
        assert_eq!(nothing.unwrap(), []);
        for kept in [vec![patrol()], vec![]] {
            assert_eq!(store.save(&kept), Saving::Done);
            assert_eq!(ScriptStore::open(&state, &node()).1.unwrap(), kept);
        }
        assert_eq!(fs::read_dir(state).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn a_damaged_file_is_named_and_set_aside_and_the_next_script_is_kept() {
        let whole = serde_json::to_string(&Content { version: VERSION, scripts: &[patrol()] }).unwrap();
        for (text, why) in [
            (&whole[..whole.len() / 2], "EOF"),
            ("", "EOF"),
            ("\u{0}\u{0}", "line 1"),
            (r#"{"version": 2, "swarm": []}"#, "`version` is 2: expected 1"),
            (r#"{"version": 1, "scripts": [{"from": 3}]}"#, "line 1 column"),
            (r#"{"version": 1, "scripts": [], "more": 1}"#, "`more`"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("uav-1.scripts.json");
            fs::write(&path, text).unwrap();
            let (mut store, lost) = ScriptStore::open(folder.path(), &node());
            let lost = lost.unwrap_err().to_string();
            let aside = folder.path().join("uav-1.scripts.json.damaged");
            for part in [path.to_str().unwrap(), why, aside.to_str().unwrap()] {
                assert!(lost.contains(part), "{lost} does not say {part}");
            }
            assert_eq!(fs::read_to_string(aside).unwrap(), text);
            assert_eq!(store.save(&vec![patrol()]), Saving::Done);
            assert_eq!(ScriptStore::open(folder.path(), &node()).1.unwrap(), [patrol()]);
        }
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file_not_folder = folder.path().join("state");
        fs::write(&file_not_folder, "").unwrap();
        let (mut store, _) = ScriptStore::open(&file_not_folder, &node());
        let saving = store.save(&vec![]);
        assert!(matches!(&saving, Saving::Failed(why) if why.contains("uav-1.scripts.json")), "{saving:?}");
    }
}
