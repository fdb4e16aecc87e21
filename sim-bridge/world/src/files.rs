//! The files that a world names: whoever reads a world opens them for it.

use std::collections::BTreeMap;
use std::sync::Arc;

/// A place where files are, each with a name of its own.
pub trait Files {
    /// The name of what the file `from` calls `uri` (a path, or `model://`, `file://`, `https://`).
    fn open(&self, uri: &str, from: &str) -> Found;
}

/// The thing under a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// Its content, and the name under which it calls for others.
    File {
        name: String,
        bytes: Arc<[u8]>,
    },
    /// The name that leads, with `/` and the name of a file, into it.
    Folder {
        name: String,
    },
    Missing,
    /// It is there, but cannot be read: why.
    Unreadable(String),
}

/// No files at all.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoFiles;

impl Files for NoFiles {
    fn open(&self, _: &str, _: &str) -> Found {
        Found::Missing
    }
}

/// Files in memory, each by its path with `/`; `model://` is their root.
impl Files for BTreeMap<String, Vec<u8>> {
    fn open(&self, uri: &str, from: &str) -> Found {
        let beside = from.rsplit_once('/').map(|(folder, _)| format!("{folder}/{uri}"));
        let root = uri.strip_prefix("model://").unwrap_or(uri).to_owned();
        for name in std::iter::once(root).chain(beside) {
            if let Some(bytes) = self.get(&name) {
                return Found::File { name, bytes: bytes.as_slice().into() };
            }
            let inside = format!("{name}/");
            if self.range(inside.clone()..).next().is_some_and(|(path, _)| path.starts_with(&inside)) {
                return Found::Folder { name };
            }
        }
        Found::Missing
    }
}
