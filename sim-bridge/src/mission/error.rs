//! Faults in a mission file.

use std::path::PathBuf;

use thiserror::Error;

/// Why a mission file cannot be flown.
#[derive(Debug, Error)]
pub enum MissionError {
    #[error("cannot read `{}`: {cause}", path.display())]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{file}: is larger than {limit} bytes: expected a mission, which is smaller")]
    TooLarge { file: String, limit: usize },
    #[error("{file}:{line}:{column}: {message}")]
    Syntax { file: String, line: usize, column: usize, message: String },
    #[error("{file}:{line}: field `{field}`: expected {expected}, found {found}")]
    Field { file: String, line: usize, field: String, expected: String, found: String },
    #[error(
        "{file}: expected a QGroundControl plan (a member `mission`), a `QGC WPL 110` file, KML, GeoJSON or \
         an LSC mission (a member `agents`)"
    )]
    Unknown { file: String },
}

/// Something in a mission file that is read over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    pub file: String,
    /// Line from 1.
    pub line: usize,
    /// The part that has no effect, and what happens instead.
    pub message: String,
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.message)
    }
}
