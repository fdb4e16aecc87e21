//! A file of a node's, replaced whole.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;
use skein_wire::NodeName;

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

/// Writes `content` as JSON in the place of what the file holds.
///
/// # Errors
/// A text for people that names the file. Then it holds the old.
pub fn replace(path: &Path, content: &impl Serialize) -> Result<(), String> {
    serde_json::to_vec_pretty(content)
        .map_err(io::Error::from)
        .and_then(|text| replace_bytes(path, &text))
        .map_err(|error| format!("`{}`: {error}", path.display()))
}

/// Makes the file's folder if need be. Whenever the computer stops, the file holds all of the old or all of the new;
/// once this returns, the new.
fn replace_bytes(path: &Path, content: &[u8]) -> io::Result<()> {
    let beside = path.with_extension("new");
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut file = File::create(&beside)?;
    file.write_all(content)?;
    file.sync_all()?;
    fs::rename(&beside, path)?;
    match path.parent() {
        Some(folder) if cfg!(unix) => File::open(folder)?.sync_all(),
        _ => Ok(()),
    }
}
