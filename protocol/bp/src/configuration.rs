//! Configuration files in TOML, read so that an error names the line and the field.

use std::fmt;

use serde::de::DeserializeOwned;

/// A text that is no TOML, has a key that is not known, or a value of the wrong type or range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Malformed {
    /// From 1.
    pub line: usize,
    /// From 1, in characters.
    pub column: usize,
    /// The path of the field, such as `vehicle[2].start_m`; empty for the whole.
    pub field: String,
    pub problem: String,
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}: ", self.line, self.column)?;
        if !self.field.is_empty() {
            write!(f, "field `{}`: ", self.field)?;
        }
        f.write_str(&self.problem)
    }
}

impl std::error::Error for Malformed {}

/// Reads a configuration.
pub fn read<T: DeserializeOwned>(text: &str) -> Result<T, Malformed> {
    let malformed = |error: &toml::de::Error, field: String| {
        let (line, column) = line_and_column(text, error.span().map_or(0, |span| span.start));
        Malformed { line, column, field, problem: error.message().to_owned() }
    };
    let parser = toml::Deserializer::parse(text).map_err(|error| malformed(&error, String::new()))?;
    serde_path_to_error::deserialize(parser).map_err(|error| {
        let field = error.path().to_string();
        malformed(error.inner(), if field == "." { String::new() } else { field })
    })
}

/// Line and column (both from 1, the column in characters) of a byte offset.
fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let column = before.get(line_start..).map_or(0, |line| line.chars().count());
    (before.matches('\n').count() + 1, column + 1)
}
