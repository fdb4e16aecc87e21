//! Names of nodes, which are also the homes of events.

use std::borrow::Borrow;
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use skein_bp::Value;
use skein_bp::catalogue::{Datum, Kind};

/// Longest name of a node, in bytes.
const MAX_LENGTH: usize = 64;

/// The name of a node: two chunks such as `uav/3` or `ground/main`.
///
/// A chunk is one or more of `A-Z a-z 0-9 _ . -`, so that a name is at once the first two chunks of the
/// events that have their home there, and a part of a Zenoh key. Cloning is cheap.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct NodeName(Arc<str>);

/// A text that is not the name of a node.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{given}` is not a node name: expected two chunks of letters, digits, `_`, `.` or `-`, such as `uav/3`, of at most {MAX_LENGTH} bytes"
)]
pub struct NodeNameError {
    pub given: String,
}

impl NodeName {
    /// Checks `name` and makes a node's name of it.
    pub fn new(name: &str) -> Result<Self, NodeNameError> {
        if is_name(name) {
            Ok(Self(name.into()))
        } else {
            Err(NodeNameError { given: name.chars().take(2 * MAX_LENGTH).collect() })
        }
    }

    /// The name as text, `uav/3`.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The first chunk: what kind of node this is, `uav`.
    pub fn kind(&self) -> &str {
        self.0.split('/').next().unwrap_or_default()
    }

    /// The second chunk: which of its kind, `3`.
    pub fn id(&self) -> &str {
        self.0.split('/').nth(1).unwrap_or_default()
    }

    /// The name of this node's event `what`: `uav/3/takeoff` for `takeoff`.
    pub fn event_name(&self, what: &str) -> String {
        format!("{}/{what}", self.0)
    }
}

fn is_name(text: &str) -> bool {
    let mut chunks = text.split('/');
    let two = [chunks.next(), chunks.next()].into_iter().all(|chunk| chunk.is_some_and(is_chunk));
    two && chunks.next().is_none() && text.len() <= MAX_LENGTH
}

impl Datum for NodeName {
    const KIND: Kind = Kind::Text;
    type Plain = Self;

    fn write(self) -> Option<Value> {
        Some(self.0.into())
    }

    fn read(value: Option<&Value>) -> Option<Self> {
        value?.as_text().filter(|text| is_name(text)).cloned().map(Self)
    }
}

impl From<&NodeName> for NodeName {
    fn from(name: &NodeName) -> Self {
        name.clone()
    }
}

/// Whether `text` may be one chunk of a name.
pub fn is_chunk(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'-'))
}

/// The first two chunks of an event's name, if it has more than two: `uav/3` for `uav/3/order/land`.
///
/// An event of fewer chunks has no home: it is local to whoever selects it and never travels.
pub fn first_two_chunks(event_name: &str) -> Option<&str> {
    let first = event_name.find('/')?;
    let second = first + 1 + event_name.get(first + 1..)?.find('/')?;
    event_name.get(..second)
}

impl fmt::Display for NodeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl TryFrom<&str> for NodeName {
    type Error = NodeNameError;

    fn try_from(name: &str) -> Result<Self, NodeNameError> {
        Self::new(name)
    }
}

impl TryFrom<String> for NodeName {
    type Error = NodeNameError;

    fn try_from(name: String) -> Result<Self, NodeNameError> {
        Self::new(&name)
    }
}

impl From<NodeName> for String {
    fn from(name: NodeName) -> Self {
        name.0.as_ref().into()
    }
}

impl Borrow<str> for NodeName {
    fn borrow(&self) -> &str {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_two_chunks() {
        let name = NodeName::new("uav/3").unwrap();
        assert_eq!((name.kind(), name.id()), ("uav", "3"));
        assert_eq!(name.event_name("takeoff"), "uav/3/takeoff");
        for bad in ["", "uav", "uav/", "/3", "uav/3/x", "uav/*", "uav/3 ", "uav/é"] {
            assert!(NodeName::new(bad).is_err(), "{bad:?} was taken for a name");
        }
        assert!(NodeName::new(&format!("uav/{}", "9".repeat(80))).is_err());
    }

    #[test]
    fn a_home_is_the_first_two_chunks() {
        assert_eq!(first_two_chunks("uav/3/takeoff"), Some("uav/3"));
        assert_eq!(first_two_chunks("uav/3/order/land"), Some("uav/3"));
        for none in ["tick", "uav/3", "", "/"] {
            assert_eq!(first_two_chunks(none), None, "{none:?}");
        }
    }
}
