//! The promises that a node has made to others.

use std::path::{Path, PathBuf};

use skein_dbp::Kept;
use skein_wire::{NodeName, Saving, Store};

use crate::lost::Lost;
use crate::node_file;

/// Keeps a node's promises in `<folder>/<node>.kept.json`, written whole each time.
#[derive(Debug)]
pub struct PromiseStore(PathBuf);

impl PromiseStore {
    /// The store of `node` in `folder`, and what a former life has kept there. A file that cannot be
    /// understood is set aside as `<node>.kept.json.damaged`: the node starts, and does not move on before
    /// somebody who has been told says so.
    pub fn open(folder: &Path, node: &NodeName) -> (Self, Result<Kept, Lost>) {
        let path = node_file::path_of(folder, node, "kept.json");
        let kept = match node_file::read(&path) {
            Ok(Some(text)) => serde_json::from_slice(&text).map_err(|error| error.to_string()),
            Ok(None) => Ok(Kept::default()),
            Err(error) => Err(error.to_string()),
        };
        let what = "what this node has promised to others is kept there, as JSON: blocks that must outlive their \
                    holders, and what was decided together";
        let kept = kept.map_err(|problem| Lost::set_aside(&path, problem, what));
        (Self(path), kept)
    }
}

impl Store for PromiseStore {
    fn save(&mut self, kept: &Kept) -> Saving {
        node_file::replace(&self.0, kept)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use skein_bp::EventSet;
    use skein_dbp::{KeptBlock, Roster};

    use super::*;

    fn node() -> NodeName {
        NodeName::new("uav/1").unwrap()
    }

    fn kept() -> Kept {
        let block = KeptBlock {
            node: NodeName::new("ground/main").unwrap(),
            incarnation: 4,
            bthread: "curfew".into(),
            sync: 7,
            block: EventSet::from("uav/*/enter").and(EventSet::region([0.0; 3], [f64::INFINITY, 2.0, 3.0])),
        };
        let roster = Some(Roster::first(node(), [NodeName::new("uav/2").unwrap()]));
        let decisions = vec![skein_bp::Event::new("swarm/launch").with("n", 1)];
        Kept { blocks: vec![block], roster, term: 1, decisions }
    }

    #[test]
    fn what_is_kept_is_there_in_the_next_life() {
        let folder = tempfile::tempdir().unwrap();
        let (mut store, nothing) = PromiseStore::open(folder.path(), &node());
        assert_eq!(nothing.unwrap(), Kept::default());
        assert_eq!(store.save(&kept()), Saving::Done);
        assert_eq!(PromiseStore::open(folder.path(), &node()).1.unwrap(), kept());
    }

    #[test]
    fn a_damaged_file_is_named_and_set_aside_and_the_next_promise_is_kept() {
        let whole = serde_json::to_string(&kept()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("uav-1.kept.json");
        let aside = |number: usize| {
            let end = if number == 0 { String::new() } else { format!("-{}", number + 1) };
            folder.path().join(format!("uav-1.kept.json.damaged{end}"))
        };
        let damages = [&whole[..whole.len() / 2], "", "\u{0}\u{0}", "{\"version\": 2}", "{\"blocks\": 3}"];
        for (number, text) in damages.into_iter().enumerate() {
            fs::write(&path, text).unwrap();
            let (mut store, lost) = PromiseStore::open(folder.path(), &node());
            let lost = lost.unwrap_err().to_string();
            for part in [path.to_str().unwrap(), aside(number).to_str().unwrap()] {
                assert!(lost.contains(part), "{lost} does not say {part}");
            }
            assert_eq!(fs::read_to_string(aside(number)).unwrap(), text);
            assert_eq!(store.save(&kept()), Saving::Done);
        }
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        let (mut store, lost) = PromiseStore::open(folder.path(), &node());
        assert!(lost.is_err() && aside(damages.len()).is_dir());
        assert_eq!(store.save(&kept()), Saving::Done);
        assert_eq!(PromiseStore::open(folder.path(), &node()).1.unwrap(), kept());
    }

    // Whoever writes to the first byte of its own memory gets EIO.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_disk_with_an_input_output_error_is_named_and_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let (mut store, _) = PromiseStore::open(folder.path(), &node());
        assert_eq!(store.save(&kept()), Saving::Done);
        let before = fs::read(folder.path().join("uav-1.kept.json")).unwrap();
        std::os::unix::fs::symlink("/proc/self/mem", folder.path().join("uav-1.kept.new")).unwrap();
        let Saving::Failed(why) = store.save(&Kept::default()) else { panic!("it was kept on nothing") };
        assert!(why.contains("uav-1.kept.json") && why.contains("os error 5"), "{why}");
        assert_eq!(fs::read(folder.path().join("uav-1.kept.json")).unwrap(), before);
        assert_eq!(store.save(&Kept::default()), Saving::Done);
        assert_eq!(PromiseStore::open(folder.path(), &node()).1.unwrap(), Kept::default());
    }
}
