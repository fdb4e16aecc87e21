//! The person or program that gives an order.

use std::fmt;
use std::sync::Arc;

use skein_dbp::NodeName;

/// Most bytes of a name.
const LONGEST: usize = 64;

/// The name of a person or program that gives orders: one line of at most 64 bytes, without `/` and `#`, which stand in
/// the names of nodes and b-threads.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Giver(Arc<str>);

/// A text is no name of a person or program.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name:?} names no person or program: expected 1 to 64 bytes in one line, without `/` and `#`, such as \"Anna\""
)]
pub struct UnfitName {
    name: String,
}

impl Giver {
    /// # Errors
    /// [`UnfitName`] if it is empty, too long, or has control characters, `/` or `#`.
    pub fn new(name: &str) -> Result<Self, UnfitName> {
        let name = name.trim();
        let odd = |letter: char| letter.is_control() || matches!(letter, '/' | '#');
        if name.is_empty() || name.len() > LONGEST || name.contains(odd) {
            return Err(UnfitName { name: name.chars().take(LONGEST).collect() });
        }
        Ok(Self(name.into()))
    }

    /// Whoever looks on, and orders nothing.
    #[cfg(feature = "console")]
    pub(crate) fn looking_on() -> Self {
        Self("whoever looks on".into())
    }

    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A node's own program.
impl From<&NodeName> for Giver {
    fn from(node: &NodeName) -> Self {
        Self(node.as_str().replace('/', " ").into())
    }
}

impl fmt::Display for Giver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_one_line_that_no_node_and_no_bthread_can_have() {
        for name in ["Anna", " Anna ", "Žofie Nová", "skein-sim", "a@b.c", &"x".repeat(64)] {
            assert_eq!(Giver::new(name).unwrap().as_str(), name.trim());
        }
        for name in ["", "  ", "script/patrol", "ground#hold", "a\nb", "a\u{1b}[2J", &"x".repeat(65)] {
            assert!(Giver::new(name).unwrap_err().to_string().contains("1 to 64 bytes"), "{name:?}");
        }
    }
}
