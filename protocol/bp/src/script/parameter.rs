//! Parameters: the parts of a script that are left open until it is used.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The most points of a route.
const MOST_POINTS: usize = 32;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterKind {
    Number,
    /// A whole number.
    Integer,
    /// The name of a node, such as `uav/2`.
    Node,
    /// `[x, y, z]`, metres ENU.
    Point,
    /// A list of points, 1 to 32.
    Route,
}

impl fmt::Display for ParameterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Number => "a number",
            Self::Integer => "a whole number",
            Self::Node => "the name of a node, such as \"uav/2\"",
            Self::Point => "a point [x, y, z] in metres",
            Self::Route => "a list of 1 to 32 points [x, y, z] in metres",
        })
    }
}

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Argument {
    /// A whole number.
    Integer(i64),
    Number(f64),
    Text(String),
    /// A point, metres ENU.
    Point([f64; 3]),
    /// Points, metres ENU.
    Route(Vec<[f64; 3]>),
}

impl Argument {
    /// The value as it stands in a script.
    pub(super) fn to_json(&self) -> Value {
        match self {
            Self::Integer(n) => Value::from(*n),
            Self::Number(x) => Value::from(*x),
            Self::Text(text) => Value::from(text.as_str()),
            Self::Point(point) => Value::from(point.to_vec()),
            Self::Route(points) => points.iter().map(|point| Value::from(point.to_vec())).collect(),
        }
    }
}

impl fmt::Display for Argument {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_json().fmt(f)
    }
}

/// A parameter of a script.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Its purpose, in one line.
    pub about: String,
    #[serde(rename = "type")]
    pub kind: ParameterKind,
    /// The unit of a number, such as `s` or `%`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Its value unless given; without a default it must be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default: Option<Argument>,
    /// The least number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// The greatest number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

impl Parameter {
    /// The fault of the declaration itself.
    pub(super) fn fault(&self) -> Option<String> {
        let is_number = matches!(self.kind, ParameterKind::Number | ParameterKind::Integer);
        if !is_number && (self.min.is_some() || self.max.is_some() || self.unit.is_some()) {
            return Some("`min`, `max` and `unit` are for numbers".to_owned());
        }
        if let (Some(min), Some(max)) = (self.min, self.max)
            && min > max
        {
            return Some(format!("`min` is {min} and `max` {max}: expected no more than `max`"));
        }
        self.default.as_ref().and_then(|default| self.accept(default).err())
    }

    /// The argument as the parameter's kind, or what was expected.
    pub(super) fn accept(&self, argument: &Argument) -> Result<Argument, String> {
        let accepted = match (self.kind, argument) {
            (ParameterKind::Number, Argument::Integer(n)) => Argument::Number(*n as f64),
            (ParameterKind::Number, Argument::Number(_))
            | (ParameterKind::Integer, Argument::Integer(_))
            | (ParameterKind::Point, Argument::Point(_)) => argument.clone(),
            (ParameterKind::Node, Argument::Text(name)) if is_node(name) => argument.clone(),
            (ParameterKind::Route, Argument::Route(points)) if (1..=MOST_POINTS).contains(&points.len()) => {
                argument.clone()
            }
            _ => return Err(format!("is {argument}: expected {}", self.kind)),
        };
        let number = match &accepted {
            Argument::Integer(n) => *n as f64,
            Argument::Number(x) => *x,
            _ => return Ok(accepted),
        };
        let (min, max) = (self.min.unwrap_or(f64::MIN), self.max.unwrap_or(f64::MAX));
        if (min..=max).contains(&number) {
            return Ok(accepted);
        }
        let unit = self.unit.as_deref().map(|unit| format!(" {unit}")).unwrap_or_default();
        Err(match (self.min, self.max) {
            (Some(min), Some(max)) => format!("is {argument}: expected {min} to {max}{unit}"),
            (Some(min), None) => format!("is {argument}: expected at least {min}{unit}"),
            (None, Some(max)) => format!("is {argument}: expected at most {max}{unit}"),
            (None, None) => format!("is {argument}: expected {}", self.kind),
        })
    }

    /// A value that fits, to try a script with.
    pub fn example(&self) -> Argument {
        let number = self.min.or(self.max).unwrap_or(1.0);
        self.default.clone().unwrap_or_else(|| match self.kind {
            ParameterKind::Number => Argument::Number(number),
            ParameterKind::Integer => Argument::Integer(number.ceil() as i64),
            ParameterKind::Node => Argument::Text("uav/2".to_owned()),
            ParameterKind::Point => Argument::Point([0.0; 3]),
            ParameterKind::Route => Argument::Route(vec![[0.0; 3]]),
        })
    }
}

/// Whether `text` is two plain words with a `/` between.
fn is_node(text: &str) -> bool {
    let plain = |chunk: &str| {
        !chunk.is_empty() && chunk.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c))
    };
    text.split_once('/').is_some_and(|(kind, id)| plain(kind) && plain(id))
}
