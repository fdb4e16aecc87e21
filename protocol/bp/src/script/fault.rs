//! The faults of scripts from files.

/// The reason for which a script was refused: where, and what was expected there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {}{problem}", .line.map(|line| format!(":{line}")).unwrap_or_default(), quoted(.field))]
pub struct ScriptFileError {
    /// The file, or the script's name once its file does not matter any more.
    pub file: String,
    /// The line, from 1, where it is known.
    pub line: Option<usize>,
    /// The field, such as `body[1].do[0].sync`; empty when it is about the whole.
    pub field: String,
    /// The fault there.
    pub problem: String,
}

fn quoted(field: &str) -> String {
    if field.is_empty() { String::new() } else { format!("`{field}` ") }
}

/// A fault at a field.
pub(super) struct Fault {
    pub(super) field: String,
    pub(super) problem: String,
}

impl Fault {
    pub(super) fn new(field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { field: field.into(), problem: problem.into() }
    }

    pub(super) fn within(self, file: &str) -> ScriptFileError {
        ScriptFileError { file: file.to_owned(), line: None, field: self.field, problem: self.problem }
    }
}
