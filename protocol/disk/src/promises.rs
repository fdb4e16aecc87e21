//! The promises that a node has made to others.

use std::io;
use std::path::{Path, PathBuf};

use skein_dbp::Kept;
use skein_wire::{NodeName, Store};

use crate::node_file;

/// The promises that were kept cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PromisesError {
    #[error("`{}`: {source}; what this node must not forget is kept there", path.display())]
    File { path: PathBuf, source: io::Error },
    #[error("`{}`: {source}; it should hold the blocks that this node must keep, as JSON. Remove it only if none of them is to hold any more", path.display())]
    Content { path: PathBuf, source: serde_json::Error },
}

/// Keeps a node's promises in `<folder>/<node>.kept.json`, written whole each time.
#[derive(Debug)]
pub struct PromiseStore(PathBuf);

impl PromiseStore {
    /// The store of `node` in `folder`, and what a former life has kept there.
    ///
    /// # Errors
    /// [`PromisesError`] when there is a file that cannot be understood: it is left alone.
    pub fn open(folder: &Path, node: &NodeName) -> Result<(Self, Kept), PromisesError> {
        let path = node_file::path_of(folder, node, "kept.json");
        let kept = match node_file::read(&path) {
            Ok(Some(text)) => serde_json::from_slice(&text)
                .map_err(|source| PromisesError::Content { path: path.clone(), source })?,
            Ok(None) => Kept::default(),
            Err(source) => return Err(PromisesError::File { path, source }),
        };
        Ok((Self(path), kept))
    }
}

impl Store for PromiseStore {
    fn save(&mut self, kept: &Kept) -> Result<(), String> {
        node_file::replace(&self.0, kept)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use skein_bp::EventSet;
    use skein_dbp::{KeptBlock, Roster};

    use super::*;

    #[test]
    fn what_is_kept_is_there_in_the_next_life() {
        let folder = tempfile::tempdir().unwrap();
        let node = NodeName::new("uav/1").unwrap();
        let (mut store, nothing) = PromiseStore::open(folder.path(), &node).unwrap();
        assert_eq!(nothing, Kept::default());
        let block = KeptBlock {
            node: NodeName::new("ground/main").unwrap(),
            incarnation: 4,
            bthread: "curfew".into(),
            sync: 7,
            block: EventSet::from("uav/*/enter").and(EventSet::region([0.0; 3], [f64::INFINITY, 2.0, 3.0])),
        };
        let roster = Some(Roster::first(node.clone(), [NodeName::new("uav/2").unwrap()]));
        let decisions = vec![skein_bp::Event::new("swarm/launch").with("n", 1)];
        let kept = Kept { blocks: vec![block], roster, term: 1, decisions };
        store.save(&kept).unwrap();
        assert_eq!(PromiseStore::open(folder.path(), &node).unwrap().1, kept);
    }

    #[test]
    fn a_file_that_is_not_understood_is_named_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("uav-1.kept.json");
        fs::write(&path, "{\"blocks\": 3}").unwrap();
        let error =
            PromiseStore::open(folder.path(), &NodeName::new("uav/1").unwrap()).unwrap_err().to_string();
        assert!(error.contains("uav-1.kept.json") && error.contains("line 1"), "{error}");
        assert!(path.exists());
    }
}
