//! The program that rehearses, as a child process of the station.

use std::collections::BTreeMap;
use std::io::{Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use skein_dbp::NodeName;

use crate::rehearsal::{Rehearsal, Rehearsed};

/// A rehearsal that takes longer is broken off.
const PATIENCE: Duration = Duration::from_secs(120);
/// The child is looked at this often.
const LOOK: Duration = Duration::from_millis(20);

/// A rehearsal, ready to be flown by `program`.
#[derive(Debug)]
pub(super) struct Staged {
    pub(super) program: PathBuf,
    pub(super) rehearsal: Rehearsal,
    /// The vehicles that have no part in it, and why.
    pub(super) left_out: BTreeMap<NodeName, String>,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub(super) enum NotRehearsed {
    #[error(
        "`rehearser`: there is no program `{}` beside the station's own or on PATH: install skein-sim, or name it in the \
         station's configuration",
        .0.display()
    )]
    NotFound(PathBuf),
    #[error("`rehearser`: {} cannot be run: {cause}", program.display())]
    NotRun { program: PathBuf, cause: std::io::Error },
    #[error("{0}")]
    Refused(String),
    #[error("the rehearsing program has died: {0}")]
    Died(String),
    #[error("the rehearsal has taken longer than {} s and was broken off", .0.as_secs())]
    TooLong(Duration),
    #[error("the rehearsing program has not answered in its words: {0}")]
    Unreadable(String),
}

impl Staged {
    /// Flies it. It takes as long as it takes, but no longer than two minutes.
    ///
    /// # Errors
    /// [`NotRehearsed`]
    pub(super) fn fly(&self) -> Result<Rehearsed, NotRehearsed> {
        let program = find(&self.program).ok_or_else(|| NotRehearsed::NotFound(self.program.clone()))?;
        self.fly_by(&program, PATIENCE)
    }

    fn fly_by(&self, program: &Path, patience: Duration) -> Result<Rehearsed, NotRehearsed> {
        let not_run = |cause| NotRehearsed::NotRun { program: program.to_owned(), cause };
        let question = serde_json::to_vec(&self.rehearsal).map_err(|error| not_run(error.into()))?;
        let mut child = Command::new(program)
            .args(["rehearse", "--json"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(not_run)?;
        // A pipe holds little: each has a thread, so that nobody waits for the other.
        let input = child.stdin.take();
        let (output, complaints) = (read(child.stdout.take()), read(child.stderr.take()));
        std::thread::spawn(move || {
            // One that has died does not read, and its end tells.
            let _ = input.map(|mut input| input.write_all(&question));
        });
        let status = wait(&mut child, patience).map_err(not_run)?.ok_or(NotRehearsed::TooLong(patience))?;
        let output = output.join().unwrap_or_default();
        let complaints = complaints.join().unwrap_or_default();
        match status.code() {
            Some(0 | 1) => serde_json::from_str(&output).map_err(|error| {
                NotRehearsed::Unreadable(if complaints.is_empty() {
                    error.to_string()
                } else {
                    last_line(&complaints)
                })
            }),
            Some(2) => Err(NotRehearsed::Refused(last_line(&complaints))),
            _ => Err(NotRehearsed::Died(match last_line(&complaints) {
                nothing if nothing.is_empty() => status.to_string(),
                said => format!("{status}; {said}"),
            })),
        }
    }
}

fn read(pipe: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // There is no more than was read before a fault.
        let _ = pipe.map(|mut pipe| pipe.read_to_end(&mut bytes));
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Waits for the end of a child; ends it, and gives nothing, when patience has.
fn wait(child: &mut Child, patience: Duration) -> std::io::Result<Option<std::process::ExitStatus>> {
    let deadline = Instant::now() + patience;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}

fn last_line(text: &str) -> String {
    text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default().to_owned()
}

/// A program by its path, or by its name: beside this one, or on PATH.
fn find(program: &Path) -> Option<PathBuf> {
    if program.components().count() > 1 {
        return program.is_file().then(|| program.to_owned());
    }
    let own = std::env::current_exe().ok();
    let beside = own.as_deref().and_then(Path::parent).map(Path::to_owned);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let named = format!("{}{}", program.display(), std::env::consts::EXE_SUFFIX);
    let folders = beside.into_iter().chain(std::env::split_paths(&path));
    folders.map(|folder| folder.join(&named)).find(|candidate| candidate.is_file())
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn fly(script: &str, patience: Duration) -> Result<Rehearsed, NotRehearsed> {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("rehearser");
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let staged =
            Staged { program: program.clone(), rehearsal: Rehearsal::default(), left_out: BTreeMap::new() };
        staged.fly_by(&program, patience)
    }

    const ANSWER: &str = r#"{"seeds":[1],"succeeded":false,"vehicles":[],"ends_s":null,"nearest":[],"clearance_m":null,
        "collisions":[0,0],"realtime_factor":12.5,"notes":[]}"#;

    #[test]
    fn an_answer_is_read_also_when_not_all_arrive() {
        let rehearsed = fly(&format!("cat > /dev/null; echo '{ANSWER}'; exit 1"), PATIENCE).unwrap();
        assert!(!rehearsed.succeeded && rehearsed.realtime_factor == 12.5);
    }

    #[test]
    fn a_child_that_refuses_dies_babbles_or_takes_too_long_is_told_of() {
        let said = |script: &str, patience| fly(script, patience).unwrap_err().to_string();
        assert_eq!(said("echo 'skein-sim: `seeds` is 0' >&2; exit 2", PATIENCE), "skein-sim: `seeds` is 0");
        let died = said("kill -9 $$", PATIENCE);
        assert!(died.contains("has died: signal: 9"), "{died}");
        assert!(said("echo hello", PATIENCE).contains("has not answered in its words"));
        let late = said("exec sleep 60", Duration::from_millis(50));
        assert!(late.contains("broken off"), "{late}");
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let missing = Staged {
            program: PathBuf::from("no-such-program"),
            rehearsal: Rehearsal::default(),
            left_out: BTreeMap::new(),
        };
        let said = missing.fly().unwrap_err().to_string();
        assert!(said.contains("`rehearser`") && said.contains("no-such-program"), "{said}");
    }
}
