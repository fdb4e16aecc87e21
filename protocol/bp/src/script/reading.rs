//! Reading TOML and JSON so that a fault names its line and its field.

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::configuration::{self, Malformed};

/// The longest text of a script, in bytes.
pub const MAX_TEXT: usize = 16 * 1024;

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

pub(super) fn too_long(length: usize) -> String {
    format!("the script is {length} bytes long: expected at most {MAX_TEXT}")
}

pub(super) fn from_toml<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, ScriptFileError> {
    check_length(file, text)?;
    configuration::read(text).map_err(|Malformed { line, field, problem, .. }| ScriptFileError {
        file: file.to_owned(),
        line: Some(line),
        field,
        problem,
    })
}

pub(super) fn from_json<T: for<'de> Deserialize<'de>>(file: &str, text: &str) -> Result<T, ScriptFileError> {
    check_length(file, text)?;
    let mut parser = serde_json::Deserializer::from_str(text);
    let fault = |error: &serde_json::Error, field: String| {
        let message = error.to_string();
        let problem = message.split(" at line ").next().unwrap_or_default().to_owned();
        ScriptFileError { file: file.to_owned(), line: Some(error.line()), field, problem }
    };
    let read =
        serde_path_to_error::deserialize(&mut parser).map_err(|error| fault(error.inner(), path(&error)))?;
    parser.end().map_err(|error| fault(&error, String::new()))?;
    Ok(read)
}

fn check_length(file: &str, text: &str) -> Result<(), ScriptFileError> {
    if text.len() > MAX_TEXT {
        return Err(Fault::new("", too_long(text.len())).within(file));
    }
    Ok(())
}

/// The field of an error; empty for the whole.
fn path<E>(error: &serde_path_to_error::Error<E>) -> String {
    let path = error.path().to_string();
    if path == "." { String::new() } else { path }
}

/// Reads a value that stands at `field`.
pub(super) fn read<T: for<'de> Deserialize<'de>>(field: &str, value: Value) -> Result<T, Fault> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let inner = path(&error);
        let dot = if inner.is_empty() || inner.starts_with('[') { "" } else { "." };
        Fault::new(format!("{field}{dot}{inner}"), error.inner().to_string())
    })
}
