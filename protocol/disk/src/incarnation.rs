//! A node's incarnation: a number on disk that grows with each of its starts.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use skein_wire::{NodeName, Saving, Store};

use crate::lost::Lost;
use crate::node_file::path_of;

/// A clock that says less has not been set: the beginning of 2026, in milliseconds since 1970.
const CLOCK_IS_SET: u64 = 1_767_225_600_000;
/// The digits of a number in the file, so that one that was cut short is known.
const DIGITS: usize = 20;

/// Why the number cannot be had.
#[derive(Debug, thiserror::Error)]
#[error(
    "{trouble} This computer's clock has not been set either, so that no number is surely greater than those before: set \
     the clock, or see to the folder"
)]
pub struct IncarnationError {
    trouble: String,
}

/// The number of this life.
#[derive(Debug)]
pub struct Incarnation {
    pub number: u64,
    /// Why it is not on disk, or was not counted on from there but taken from the clock.
    pub trouble: Option<String>,
    /// Where it is still to be kept, if it is not on disk.
    pub unsaved: Option<IncarnationStore>,
}

/// Keeps a node's incarnation in `<folder>/<node>.incarnation`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IncarnationStore(PathBuf);

impl Store<u64> for IncarnationStore {
    fn save(&mut self, number: &u64) -> Saving {
        match take(&self.0, |_| Some(*number)) {
            Ok(_) => Saving::Done,
            Err(error) => Saving::Failed(format!("`{}`: {error}", self.0.display())),
        }
    }
}

/// The next incarnation of `node`: greater than every one before that had this `folder`, and on disk before
/// it is returned, if the disk takes it; at least `least`, for a node that has lost count. Others take a lower
/// one for a node that is no more.
///
/// A number that is damaged is set aside. Without it, and where the disk does not take the new one, the clock
/// gives a number: milliseconds since 1970, more than any node has had lives.
///
/// # Errors
/// The clock is needed, and has not been set, and there is no `least` either.
///
/// ```
/// use std::time::SystemTime;
/// let folder = std::env::temp_dir().join("skein-incarnation-example");
/// let node = skein_wire::NodeName::new("uav/1")?;
/// let first = skein_disk::next_incarnation(&folder, &node, 0, SystemTime::now())?.number;
/// assert_eq!(skein_disk::next_incarnation(&folder, &node, 0, SystemTime::now())?.number, first + 1);
/// assert_eq!(skein_disk::next_incarnation(&folder, &node, 58, SystemTime::now())?.number, 58);
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn next_incarnation(
    folder: &Path,
    node: &NodeName,
    least: u64,
    clock: SystemTime,
) -> Result<Incarnation, IncarnationError> {
    let path = path_of(folder, node, "incarnation");
    let since_1970 = clock.duration_since(SystemTime::UNIX_EPOCH).unwrap_or(Duration::ZERO);
    let by_clock = u64::try_from(since_1970.as_millis()).ok().filter(|ms| *ms >= CLOCK_IS_SET);
    let afresh = by_clock.or((least > 0).then_some(least)).map(|number| number.max(least));
    let mut trouble = None;
    let first_try = take(&path, |last| last.map(|last| last.saturating_add(1).max(least)));
    let taken = match first_try {
        Ok(Taken::Unreadable(found)) if afresh.is_none() => {
            let trouble =
                format!("`{}` holds {found:?}, which is no number as it is written there.", path.display());
            return Err(IncarnationError { trouble });
        }
        Ok(Taken::Unreadable(found)) => {
            let problem = format!("holds {found:?}, which is no number as it is written there");
            let what =
                "the number of this node's lives is kept there. This life's number is taken from the clock";
            trouble = Some(Lost::set_aside(&path, problem, what).to_string());
            take(&path, |_| afresh)
        }
        taken => taken,
    };
    let unsaved = |trouble| IncarnationError { trouble };
    match taken {
        Ok(Taken::Number(number)) => Ok(Incarnation { number, trouble, unsaved: None }),
        Ok(Taken::Unreadable(_)) => Err(unsaved(trouble.unwrap_or_default())),
        Err(error) => {
            let trouble = format!(
                "`{}`: {error}; this node's incarnation is kept there, so it must be a folder that can be written to. \
                 This life's number is taken from the clock, until it can be kept.",
                path.display()
            );
            let Some(afresh) = afresh else { return Err(unsaved(trouble)) };
            let number = afresh.max(read(&path).map_or(0, |last| last.saturating_add(1)));
            let unsaved = Some(IncarnationStore(path));
            Ok(Incarnation { number, trouble: Some(trouble), unsaved })
        }
    }
}

enum Taken {
    Number(u64),
    /// The file holds this, and there is no other number for it.
    Unreadable(String),
}

/// Puts the number that follows the file's into its place; `follow` is given none if the file holds no
/// number. Two processes that start at once get two numbers: the lock goes with the file's handle.
fn take(path: &Path, follow: impl FnOnce(Option<u64>) -> Option<u64>) -> io::Result<Taken> {
    begin(path)?;
    let mut file = OpenOptions::new().read(true).write(true).open(path)?;
    file.lock()?;
    let mut text = Vec::new();
    (&mut file).take(1024).read_to_end(&mut text)?;
    match follow(number(&text)) {
        Some(next) => write_over(&mut file, next).map(|()| Taken::Number(next)),
        None => Ok(Taken::Unreadable(String::from_utf8_lossy(&text).chars().take(40).collect())),
    }
}

fn read(path: &Path) -> Option<u64> {
    number(&fs::read(path).ok()?)
}

/// The number that a file holds; one that may have been cut short is none, and none that another would not write over
/// whole.
fn number(text: &[u8]) -> Option<u64> {
    let text = std::str::from_utf8(text).ok()?;
    let is_whole = text.len() <= DIGITS + 1 && (text.ends_with('\n') || text.len() == DIGITS);
    text.trim().parse().ok().filter(|_| is_whole)
}

/// Makes the file if there is none. It appears with a number in it, so that an empty one is known to be
/// damaged.
fn begin(path: &Path) -> io::Result<()> {
    if path.symlink_metadata().is_ok() {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let beside = path.with_extension(format!("{}-{:?}.new", std::process::id(), std::thread::current().id()));
    let made = File::create(&beside).and_then(|mut file| write_over(&mut file, 0));
    let linked = made.and_then(|()| fs::hard_link(&beside, path));
    let linked = match linked {
        // Not every file system has links; another process may have been quicker.
        Err(_) if path.symlink_metadata().is_ok() => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::Unsupported => fs::rename(&beside, path),
        linked => linked,
    };
    // It may have been renamed.
    let _ = fs::remove_file(&beside);
    linked
}

/// The new number is never shorter than the old one, so that a cut in between leaves a number that is no lower.
fn write_over(file: &mut File, number: u64) -> io::Result<()> {
    file.rewind()?;
    writeln!(file, "{number:0DIGITS$}")?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOCK: u64 = CLOCK_IS_SET + 5;

    fn clock(ms: u64) -> SystemTime {
        SystemTime::UNIX_EPOCH + Duration::from_millis(ms)
    }

    fn node() -> NodeName {
        NodeName::new("uav/1").unwrap()
    }

    #[test]
    fn two_that_start_at_once_get_two_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let start = || next_incarnation(folder.path(), &node(), 0, clock(0)).unwrap().number;
        let mut numbers: Vec<u64> = std::thread::scope(|scope| {
            let starts: Vec<_> = (0..8).map(|_| scope.spawn(start)).collect();
            starts.into_iter().map(|start| start.join().unwrap()).collect()
        });
        numbers.sort_unstable();
        assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn a_damaged_number_is_set_aside_and_none_comes_twice() {
        for text in ["seven", "", "0000000000", "\u{0}\u{0}\u{0}"] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("uav-1.incarnation");
            fs::write(&path, text).unwrap();
            let error = next_incarnation(folder.path(), &node(), 0, clock(3)).unwrap_err().to_string();
            assert!(error.contains("uav-1.incarnation") && error.contains("clock"), "{error}");
            let life = next_incarnation(folder.path(), &node(), 0, clock(CLOCK)).unwrap();
            assert_eq!((life.number, life.unsaved), (CLOCK, None));
            assert!(life.trouble.unwrap().contains("uav-1.incarnation.damaged"));
            let next = next_incarnation(folder.path(), &node(), 0, clock(0)).unwrap();
            assert_eq!((next.number, next.trouble), (CLOCK + 1, None), "it counts on from there");
        }
    }

    #[test]
    fn a_number_that_an_operator_has_put_there_counts() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("uav-1.incarnation"), "12\n").unwrap();
        assert_eq!(next_incarnation(folder.path(), &node(), 0, clock(0)).unwrap().number, 13);
    }

    #[test]
    fn where_nothing_can_be_written_the_clock_gives_a_number_that_is_kept_later() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state");
        fs::write(&state, "a file, not a folder").unwrap();
        assert!(next_incarnation(&state, &node(), 0, clock(0)).is_err());
        let life = next_incarnation(&state, &node(), 0, clock(CLOCK)).unwrap();
        assert_eq!(life.number, CLOCK);
        let mut store = life.unsaved.unwrap();
        assert!(matches!(store.save(&CLOCK), Saving::Failed(why) if why.contains("uav-1.incarnation")));
        fs::remove_file(&state).unwrap();
        assert_eq!(store.save(&CLOCK), Saving::Done);
        assert_eq!(next_incarnation(&state, &node(), 0, clock(0)).unwrap().number, CLOCK + 1);
    }
}
