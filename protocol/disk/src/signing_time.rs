//! The time up to which a vehicle may have signed MAVLink frames.

use std::path::{Path, PathBuf};

use skein_wire::{NodeName, Saving, Store};

use crate::lost::Lost;
use crate::node_file;

/// Keeps in `<folder>/<node>.signing-time.json` the time up to which a vehicle may have signed MAVLink frames, in units
/// of 10 µs since the beginning of 2015: what it signs in its next life must be later.
#[derive(Debug)]
pub struct SigningTimeStore(PathBuf);

impl SigningTimeStore {
    /// The store of `node` in `folder`, and the time that a former life has kept there, or 0. A file that cannot be
    /// understood is set aside as `<node>.signing-time.json.damaged` and told of: the clock then tells the time alone.
    pub fn open(folder: &Path, node: &NodeName) -> (Self, Result<u64, Lost>) {
        let path = node_file::path_of(folder, node, "signing-time.json");
        let kept = match node_file::read(&path) {
            Ok(Some(text)) => serde_json::from_slice(&text).map_err(|error| error.to_string()),
            Ok(None) => Ok(0),
            Err(error) => Err(error.to_string()),
        };
        let what = "the time up to which MAVLink frames may have been signed is kept there, as a number: the clock \
                    alone tells it now, and if that is behind, the autopilot hears nothing until it has been heard";
        let kept = kept.map_err(|problem| Lost::set_aside(&path, problem, what));
        (Self(path), kept)
    }
}

impl Store<u64> for SigningTimeStore {
    fn save(&mut self, units: &u64) -> Saving {
        node_file::replace(&self.0, units)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_there_in_the_next_life_and_a_damaged_one_is_told_of() {
        let folder = tempfile::tempdir().unwrap();
        let node = NodeName::new("uav/1").unwrap();
        let (mut store, nothing) = SigningTimeStore::open(folder.path(), &node);
        assert_eq!(nothing.unwrap(), 0);
        assert_eq!(store.save(&37_000_000_000_000), Saving::Done);
        assert_eq!(SigningTimeStore::open(folder.path(), &node).1.unwrap(), 37_000_000_000_000);
        let path = folder.path().join("uav-1.signing-time.json");
        for damaged in ["", "-3", "{}"] {
            std::fs::write(&path, damaged).unwrap();
            let lost = SigningTimeStore::open(folder.path(), &node).1.unwrap_err();
            assert!(lost.to_string().contains("uav-1.signing-time.json"), "{lost}");
            assert!(!path.exists());
        }
    }
}
