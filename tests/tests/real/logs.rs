//! The logs of a swarm's processes, shown when a test fails.

use std::path::{Path, PathBuf};

/// Lines of each log that are shown.
const SHOWN: usize = 60;

/// Shows the ends of all logs in a folder, if the test fails while this lives.
pub struct Logs(PathBuf);

impl Logs {
    /// The logs of processes that have this folder.
    pub fn of(folder: &Path) -> Self {
        Self(folder.join("logs"))
    }
}

impl Drop for Logs {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            return;
        }
        for log in std::fs::read_dir(&self.0).into_iter().flatten().flatten() {
            let text = std::fs::read_to_string(log.path()).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            println!(
                "--- {}\n{}",
                log.path().display(),
                lines[lines.len().saturating_sub(SHOWN)..].join("\n")
            );
        }
    }
}
