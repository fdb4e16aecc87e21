//! Room for what is recorded, so that it never takes what promises are kept on.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Recordings leave so much of a disk free, bytes; a tenth of it, if that is less.
pub const RESERVE: u64 = 64 << 20;
/// The disk is asked this often.
const LOOK: Duration = Duration::from_secs(1);

/// The room for one file that grows: up to a greatest size, and as long as its disk has enough left for what
/// matters more.
#[derive(Debug)]
pub struct Room {
    path: PathBuf,
    most_bytes: u64,
    bytes: u64,
    looked: Option<Instant>,
    is_scarce: Option<String>,
}

impl Room {
    /// Room for so many bytes at `path`.
    #[must_use]
    pub fn new(path: &Path, most_bytes: u64) -> Self {
        Self { path: path.to_owned(), most_bytes, bytes: 0, looked: None, is_scarce: None }
    }

    /// The file grows by so many bytes.
    pub fn take(&mut self, bytes: usize) {
        self.bytes = self.bytes.saturating_add(bytes as u64);
    }

    /// Why the file is to grow no more, if so.
    pub fn is_full(&mut self) -> Option<String> {
        self.bytes = self.bytes.max(std::fs::metadata(&self.path).map_or(0, |file| file.len()));
        if self.looked.is_none_or(|looked| looked.elapsed() >= LOOK) {
            self.looked = Some(Instant::now());
            self.is_scarce = disk(&self.path).and_then(|(free, size)| scarcity(free, size));
        }
        if self.bytes >= self.most_bytes {
            return Some(format!("it has its greatest size, {} MB", self.most_bytes >> 20));
        }
        self.is_scarce.clone()
    }
}

/// Free bytes, for programs without privileges, and all bytes of the disk that a file is on.
fn disk(path: &Path) -> Option<(u64, u64)> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let disk = nix::sys::statvfs::statvfs(folder).ok()?;
    let block = disk.fragment_size();
    Some((disk.blocks_available().saturating_mul(block), disk.blocks().saturating_mul(block)))
}

/// Why a disk with so many free bytes of so many has no room for recordings, if so.
fn scarcity(free: u64, size: u64) -> Option<String> {
    let reserve = RESERVE.min(size / 10);
    (free < reserve).then(|| {
        format!("its disk has {} kB left, and {} kB are for what must be kept", free >> 10, reserve >> 10)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_keeps_a_reserve_of_its_own_size() {
        const GB: u64 = 1 << 30;
        assert_eq!(scarcity(RESERVE, 100 * GB), None);
        assert!(scarcity(RESERVE - 1, 100 * GB).is_some());
        let small = 1 << 20;
        assert_eq!(scarcity(small / 10, small), None);
        assert!(scarcity(small / 10 - 1, small).is_some());
    }

    #[test]
    fn a_file_grows_to_its_greatest_size() {
        let folder = tempfile::tempdir().unwrap();
        let mut room = Room::new(&folder.path().join("set-points.csv"), 100);
        room.take(99);
        assert_eq!(room.is_full(), None);
        room.take(1);
        assert!(room.is_full().is_some_and(|why| why.contains("greatest size")));
    }
}
