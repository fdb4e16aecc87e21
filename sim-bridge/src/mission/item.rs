//! An item of a MAVLink mission, whichever file it stands in, and its place there for messages.

use super::json::Node;
use super::{MissionError, Warning};

/// An item.
pub struct Item<'a> {
    pub origin: Origin<'a>,
    /// `MAV_CMD`.
    pub command: u64,
    /// `MAV_FRAME`.
    pub frame: u64,
    /// Its seven parameters; no number where none is given.
    pub params: [f64; 7],
    /// The number by which jumps name it.
    pub number: u64,
    /// The element of the account that it belongs to.
    pub element: usize,
    /// The survey or scan that it is part of.
    pub scan: Option<usize>,
    /// Its height above the sea was worked out from one above the terrain.
    pub follows_terrain: bool,
}

/// The place of an item in its file.
pub enum Origin<'a> {
    Json(Node<'a>),
    Row { file: &'a str, line: usize },
}

/// A part of an item.
#[derive(Debug, Clone, Copy)]
pub enum Part {
    Whole,
    Command,
    Frame,
    /// From 0.
    Parameter(usize),
}

impl<'a> Origin<'a> {
    /// An error at a part of the item.
    pub fn error(&self, part: Part, expected: impl Into<String>, found: impl Into<String>) -> MissionError {
        match self {
            Self::Json(node) => json_part(node, part).error(expected, found),
            Self::Row { file, line } => MissionError::Field {
                file: (*file).to_owned(),
                line: *line,
                field: column(part),
                expected: expected.into(),
                found: found.into(),
            },
        }
    }

    /// A warning at a part of the item.
    pub fn warning(&self, part: Part, message: impl std::fmt::Display) -> Warning {
        match self {
            Self::Json(node) => json_part(node, part).warning(message),
            Self::Row { file, line } => {
                Warning { file: (*file).to_owned(), line: *line, message: message.to_string() }
            }
        }
    }
}

impl Item<'_> {
    /// An error at a parameter that shows its value.
    pub fn mismatch(&self, index: usize, expected: impl Into<String>) -> MissionError {
        self.origin.error(Part::Parameter(index), expected, shown(self.params[index]))
    }

    /// A parameter in a closed range; 0 where none is given.
    pub fn number_in(&self, index: usize, from: f64, to: f64, unit: &str) -> Result<f64, MissionError> {
        let value = self.params[index];
        match value {
            _ if value.is_nan() => Ok(0.0),
            _ if (from..=to).contains(&value) => Ok(value),
            _ => Err(self.mismatch(index, format!("a number from {from} to {to} {unit}"))),
        }
    }

    /// A place in a waypoint file whose altitude is 0: ArduPilot, whose tools write these files, stays at the
    /// height it has.
    pub fn keeps_height(&self) -> bool {
        matches!(self.origin, Origin::Row { .. }) && self.params[6] == 0.0
    }

    /// The parameter is absent or 0.
    pub fn is_unset(&self, index: usize) -> bool {
        self.params[index].is_nan() || self.params[index] == 0.0
    }
}

fn shown(value: f64) -> String {
    if value.is_nan() { "null".to_owned() } else { value.to_string() }
}

fn json_part<'a>(node: &Node<'a>, part: Part) -> Node<'a> {
    let found = match part {
        Part::Whole => None,
        Part::Command => node.optional("command"),
        Part::Frame => node.optional("frame"),
        Part::Parameter(index) => match node.optional("coordinate") {
            Some(place) if index > 3 => place.element(index - 4),
            _ => node.optional("params").and_then(|params| params.element(index)),
        },
    };
    found.unwrap_or_else(|| node.clone())
}

/// Columns from 1: index, current, frame, command, seven parameters, continue.
fn column(part: Part) -> String {
    match part {
        Part::Whole => "row".to_owned(),
        Part::Frame => "column 3, frame".to_owned(),
        Part::Command => "column 4, command".to_owned(),
        Part::Parameter(index) => format!("column {}, parameter {}", index + 5, index + 1),
    }
}
