//! A file of a node's, replaced whole.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;
use skein_wire::{NodeName, Saving};

pub fn path_of(folder: &Path, node: &NodeName, what: &str) -> PathBuf {
    folder.join(format!("{}.{what}", node.as_str().replace('/', "-")))
}

/// The content of the file; none if there is no file.
pub fn read(path: &Path) -> io::Result<Option<Vec<u8>>> {
    match fs::read(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// Writes `content` as JSON in the place of what the file holds. If that fails, it holds the old.
pub fn replace(path: &Path, content: &impl Serialize) -> Saving {
    let text = serde_json::to_vec_pretty(content).map_err(io::Error::from);
    match text.and_then(|text| replace_bytes(path, &text)) {
        Ok(()) => Saving::Done,
        Err(error) => Saving::Failed(format!("`{}`: {error}", path.display())),
    }
}

/// Makes the file's folder if need be. Whenever the computer stops, the file holds all of the old or all of the new;
/// once this returns, the new.
fn replace_bytes(path: &Path, content: &[u8]) -> io::Result<()> {
    let beside = path.with_extension("new");
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let written = File::create(&beside).and_then(|mut file| {
        file.write_all(content)?;
        file.sync_all()
    });
    if let Err(error) = written.and_then(|()| fs::rename(&beside, path)) {
        // What is there of it takes room that is needed.
        let _ = fs::remove_file(&beside);
        return Err(error);
    }
    match path.parent() {
        Some(folder) if cfg!(unix) => File::open(folder)?.sync_all(),
        _ => Ok(()),
    }
}
