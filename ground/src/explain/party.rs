//! A b-thread somewhere in the fleet.

use std::fmt;

use skein_dbp::NodeName;

/// A b-thread and its node.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Party {
    pub(super) node: NodeName,
    pub(super) bthread: String,
}

impl Party {
    /// Whom `name` means at a node: `hold` is its own, `ground/main#hold` one elsewhere.
    pub(super) fn read(at: &NodeName, name: &str) -> Self {
        let elsewhere =
            name.split_once('#').and_then(|(node, bthread)| Some((NodeName::new(node).ok()?, bthread)));
        match elsewhere {
            Some((node, bthread)) => Self { node, bthread: bthread.to_owned() },
            None => Self { node: at.clone(), bthread: name.to_owned() },
        }
    }

    /// Its name at a node.
    pub(super) fn name_at(&self, node: &NodeName) -> String {
        if self.node == *node { self.bthread.clone() } else { self.to_string() }
    }
}

impl fmt::Display for Party {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#{}", self.node, self.bthread)
    }
}
