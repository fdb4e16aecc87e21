//! A node's incarnation: a number on disk that grows with each of its starts.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use skein_wire::NodeName;

use crate::node_file::path_of;

/// Why the number cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum IncarnationError {
    #[error("`{}`: {source}; this node's incarnation is kept there, so it must be a folder that can be written to", path.display())]
    File { path: PathBuf, source: io::Error },
    #[error("`{}` holds {found:?}: expected a number; put one there that is greater than any this node has had", path.display())]
    Content { path: PathBuf, found: String },
}

/// The next incarnation of `node`: greater than every one before that had this `folder`, and on disk before it is
/// returned; at least `least`, for a node that has lost count. Others take a lower one for a node that is no more.
///
/// ```
/// let folder = std::env::temp_dir().join("skein-incarnation-example");
/// let node = skein_wire::NodeName::new("uav/1")?;
/// let first = skein_disk::next_incarnation(&folder, &node, 0)?;
/// assert_eq!(skein_disk::next_incarnation(&folder, &node, 0)?, first + 1);
/// assert_eq!(skein_disk::next_incarnation(&folder, &node, 58)?, 58);
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn next_incarnation(folder: &Path, node: &NodeName, least: u64) -> Result<u64, IncarnationError> {
    let path = path_of(folder, node, "incarnation");
    let failed = |source| IncarnationError::File { path: path.clone(), source };
    fs::create_dir_all(folder).map_err(failed)?;
    let mut file =
        OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
    // Two processes that start at once get two numbers; the lock goes with the file's handle.
    file.lock().map_err(failed)?;
    let mut text = String::new();
    file.read_to_string(&mut text).map_err(failed)?;
    let last: u64 = match text.trim() {
        "" => 0,
        number => number.parse().map_err(|_| IncarnationError::Content {
            path: path.clone(),
            found: number.chars().take(40).collect(),
        })?,
    };
    let next = last.saturating_add(1).max(least);
    write_over(&mut file, next).map_err(failed)?;
    Ok(next)
}

/// The new number is never shorter than the old one, so that a cut in between leaves a number that is no lower.
fn write_over(file: &mut File, number: u64) -> io::Result<()> {
    file.rewind()?;
    writeln!(file, "{number:020}")?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_that_start_at_once_get_two_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let node = NodeName::new("uav/1").unwrap();
        let start = || next_incarnation(folder.path(), &node, 0).unwrap();
        let mut numbers: Vec<u64> = std::thread::scope(|scope| {
            let starts: Vec<_> = (0..8).map(|_| scope.spawn(start)).collect();
            starts.into_iter().map(|start| start.join().unwrap()).collect()
        });
        numbers.sort_unstable();
        assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn what_is_no_number_is_named_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("uav-1.incarnation");
        fs::write(&path, "seven").unwrap();
        let error =
            next_incarnation(folder.path(), &NodeName::new("uav/1").unwrap(), 0).unwrap_err().to_string();
        assert!(error.contains("uav-1.incarnation") && error.contains("seven"), "{error}");
        assert_eq!(fs::read_to_string(path).unwrap(), "seven");
    }
}
