//! A process that flies one vehicle, in a folder of its own.

use std::fs::File;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

/// Patience with a process that was asked to end.
const TIME_TO_END: Duration = Duration::from_secs(2);

/// A running autopilot, with whatever it has started. It ends with this.
pub(super) struct Instance(Child);

impl Instance {
    /// Starts `command` in `folder`, which is made anew; what it prints goes into `log.txt` there.
    pub(super) fn start(mut command: Command, folder: &Path) -> anyhow::Result<Self> {
        let log = File::create(folder.join("log.txt")).with_context(|| folder.display().to_string())?;
        let program = command.get_program().to_string_lossy().into_owned();
        command
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            // Programs of its own end with it.
            .process_group(0);
        let child = command.spawn().with_context(|| format!("{program}: cannot be started"))?;
        Ok(Self(child))
    }

    /// Says how it has ended, if it has.
    pub(super) fn check(&mut self, folder: &Path) -> anyhow::Result<()> {
        match self.0.try_wait()? {
            None => Ok(()),
            Some(status) => anyhow::bail!("it has ended ({status}); see {}/log.txt", folder.display()),
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        let group = Pid::from_raw(i32::try_from(self.0.id()).unwrap_or(i32::MAX));
        // Whoever has ended already cannot be asked to.
        let _ = killpg(group, Signal::SIGTERM);
        let deadline = Instant::now() + TIME_TO_END;
        while Instant::now() < deadline && matches!(self.0.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = killpg(group, Signal::SIGKILL);
        let _ = self.0.wait();
    }
}

/// An empty folder for an instance: what an earlier run has left there would be flown by.
pub(super) fn fresh(folder: &Path) -> anyhow::Result<()> {
    if folder.exists() {
        std::fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))
}
