//! A process that flies one vehicle, in a folder of its own.

use std::fs::File;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

/// Patience with a process that was asked to end.
const TIME_TO_END: Duration = Duration::from_secs(2);

/// A running autopilot, with whatever it has started. It ends with this.
pub(super) struct Instance {
    child: Child,
    log: PathBuf,
}

impl Instance {
    /// Starts `command` in `folder`; what it prints goes into `log.txt` there.
    pub(super) fn start(mut command: Command, folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join("log.txt");
        let log = File::create(&path).with_context(|| path.display().to_string())?;
        let program = command.get_program().to_string_lossy().into_owned();
        command
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            // Programs of its own end with it.
            .process_group(0);
        let child = command.spawn().with_context(|| format!("{program}: cannot be started"))?;
        Ok(Self { child, log: path })
    }

    /// Says how it has ended, if it has.
    pub(super) fn check(&mut self) -> anyhow::Result<()> {
        match self.child.try_wait()? {
            None => Ok(()),
            Some(status) => anyhow::bail!("it has ended ({status}); see {}", self.log.display()),
        }
    }
}

/// Tries until it succeeds; not when the instance, if it is our own, has ended, nor for longer than `patience`.
pub(super) fn wait_for<T>(
    instance: &mut Option<Instance>,
    patience: Duration,
    mut attempt: impl FnMut() -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let began = Instant::now();
    loop {
        match attempt() {
            Ok(found) => return Ok(found),
            Err(error) => {
                if let Some(instance) = instance {
                    instance.check()?;
                }
                if began.elapsed() >= patience {
                    return Err(error);
                }
            }
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Words that say how an instance of our own has ended; none of one that runs, or that somebody else has started.
pub(super) fn ending(instance: &mut Option<Instance>) -> String {
    let ending = instance.as_mut().and_then(|instance| instance.check().err());
    ending.map(|ending| format!(": {ending}")).unwrap_or_default()
}

impl Drop for Instance {
    fn drop(&mut self) {
        let group = Pid::from_raw(i32::try_from(self.child.id()).unwrap_or(i32::MAX));
        // Whoever has ended already cannot be asked to.
        let _ = killpg(group, Signal::SIGTERM);
        let deadline = Instant::now() + TIME_TO_END;
        while Instant::now() < deadline && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = killpg(group, Signal::SIGKILL);
        let _ = self.child.wait();
    }
}

/// An empty folder for an instance, by its whole path: what an earlier run has left there would be flown by.
pub(super) fn fresh(folder: &Path) -> anyhow::Result<PathBuf> {
    let name = || folder.display().to_string();
    if folder.exists() {
        std::fs::remove_dir_all(folder).with_context(name)?;
    }
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    folder.canonicalize().with_context(name)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use super::*;

    #[test]
    fn one_that_ends_before_it_answers_is_named_with_its_log() {
        let folder = tempfile::tempdir().unwrap();
        let path = fresh(&folder.path().join("uav-1")).unwrap();
        let mut instance = Some(Instance::start(Command::new("false"), &path).unwrap());
        let never = || -> anyhow::Result<()> { anyhow::bail!("no answer") };
        let error = wait_for(&mut instance, Duration::from_secs(60), never).unwrap_err().to_string();
        assert!(error.contains("exit status: 1") && error.contains("uav-1/log.txt"), "{error}");
        assert_eq!(ending(&mut instance), format!(": {error}"));
        let error = wait_for(&mut None, Duration::ZERO, never).unwrap_err().to_string();
        assert_eq!(error, "no answer");
    }
}
