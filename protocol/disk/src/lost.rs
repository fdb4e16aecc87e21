//! A file that should hold what a former life has kept, and does not.

use std::path::{Path, PathBuf};
use std::{fmt, fs, io};

/// Something that was kept cannot be had: the problem with its file, and the fate of that.
#[derive(Debug, thiserror::Error)]
#[error("`{}`: {problem}; {what}. {fate}", path.display())]
pub struct Lost {
    pub path: PathBuf,
    pub problem: String,
    /// The content, and what its loss means.
    what: &'static str,
    fate: Fate,
}

#[derive(Debug)]
enum Fate {
    SetAside(PathBuf),
    Left(io::Error),
}

impl fmt::Display for Fate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SetAside(aside) => write!(f, "It is `{}` now", aside.display()),
            Self::Left(error) => write!(f, "It could not be set aside: {error}"),
        }
    }
}

impl Lost {
    /// Sets the file aside, beside all that were before.
    pub(crate) fn set_aside(path: &Path, problem: String, what: &'static str) -> Self {
        let aside = free_place(path);
        let fate = match fs::rename(path, &aside) {
            Ok(()) => Fate::SetAside(aside),
            Err(error) => Fate::Left(error),
        };
        Self { path: path.to_owned(), problem, what, fate }
    }
}

/// `<file>.damaged`, or with a number behind it.
fn free_place(path: &Path) -> PathBuf {
    let named = |end: String| {
        let mut name = path.as_os_str().to_owned();
        name.push(end);
        PathBuf::from(name)
    };
    let numbered = (2..1000).map(|number| format!(".damaged-{number}"));
    let mut places = std::iter::once(".damaged".to_owned()).chain(numbered).map(named);
    places.find(|place| place.symlink_metadata().is_err()).unwrap_or_else(|| named(".damaged".to_owned()))
}
