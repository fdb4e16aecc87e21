//! The members of a secured network, by the names of their certificates.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use skein_wire::NodeName;

/// The serial number of a node's first certificate.
pub const FIRST_SERIAL: u32 = 1;

/// The members, and the serial number of each one's certificate.
///
/// A certificate's common name is `<node>;<serial>`, such as `uav/1;2`. One without a serial is the first, and
/// `uav-1` counts as `uav/1`, for authorities that allow no `/`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roster {
    members: BTreeMap<NodeName, u32>,
    relays: BTreeSet<NodeName>,
}

/// The file, field by field; the same on all hosts.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RosterFile {
    #[serde(default)]
    relays: Vec<String>,
    members: BTreeMap<String, u32>,
}

/// A roster's file that cannot be read, or is not sound.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{}`: {fault}", path.display())]
pub struct RosterError {
    pub path: PathBuf,
    pub fault: String,
}

/// The reason why a certificate's holder counts for nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unlisted {
    #[error("its certificate has no common name: expected `<node>;<serial>`, such as `uav/1;1`")]
    Nameless,
    #[error(
        "its certificate is that of `{0}`, whom the roster does not name: name it there if it belongs to the fleet"
    )]
    Stranger(String),
    #[error("its certificate is `{given}`, and the roster asks for `{expected}`: renew it")]
    Old { given: String, expected: String },
}

impl Roster {
    /// These members with their first certificates; nobody relays.
    pub fn of(members: impl IntoIterator<Item = NodeName>) -> Self {
        Self {
            members: members.into_iter().map(|node| (node, FIRST_SERIAL)).collect(),
            relays: BTreeSet::new(),
        }
    }

    /// The same, with these members also relaying what others say.
    #[must_use]
    pub fn relayed_by(mut self, relays: impl IntoIterator<Item = NodeName>) -> Self {
        for relay in relays {
            self.members.entry(relay.clone()).or_insert(FIRST_SERIAL);
            self.relays.insert(relay);
        }
        self
    }

    /// Reads a roster's file.
    ///
    /// # Errors
    /// The file, and its field at fault.
    pub fn read(path: &Path) -> Result<Self, RosterError> {
        let fault = |fault: String| RosterError { path: path.into(), fault };
        let text = std::fs::read_to_string(path).map_err(|error| fault(error.to_string()))?;
        Self::parse(&text).map_err(fault)
    }

    /// Reads the text of a roster's file.
    ///
    /// # Errors
    /// The field at fault, and what was expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: RosterFile = toml::from_str(text).map_err(|error| error.to_string())?;
        let node = |name: &String| NodeName::new(name).map_err(|error| error.to_string());
        let members: BTreeMap<_, _> = file
            .members
            .iter()
            .map(|(name, serial)| Ok((node(name)?, *serial)))
            .collect::<Result<_, String>>()?;
        let relays = file.relays.iter().map(node).collect::<Result<BTreeSet<_>, _>>()?;
        if let Some((name, _)) = members.iter().find(|(_, serial)| **serial < FIRST_SERIAL) {
            return Err(format!("`{name}` has the serial 0: expected {FIRST_SERIAL} or more"));
        }
        match relays.iter().find(|relay| !members.contains_key(*relay)) {
            Some(relay) => Err(format!("`relays` names {relay}, which is not in `members`: add it there")),
            None => Ok(Self { members, relays }),
        }
    }

    /// The text of the roster's file.
    pub fn to_text(&self) -> String {
        let relays: Vec<&str> = self.relays.iter().map(NodeName::as_str).collect();
        let members: String =
            self.members.iter().map(|(node, serial)| format!("\"{node}\" = {serial}\n")).collect();
        format!(
            "# Who takes part in the fleet's network. The same file belongs on every host; a node reads it when it \
             starts.\n# Members that pass on what others say: routers. They are trusted with all of it.\n\
             relays = {relays:?}\n\n# The serial number of each member's certificate. To revoke it, take the line \
             out. To renew it, raise the number.\n[members]\n{members}"
        )
    }

    /// Every member, with its certificate's serial.
    pub fn members(&self) -> impl Iterator<Item = (&NodeName, u32)> {
        self.members.iter().map(|(node, serial)| (node, *serial))
    }

    /// Whether `node` may pass on what others say.
    pub fn relays(&self, node: &NodeName) -> bool {
        self.relays.contains(node)
    }

    /// Whether anybody may pass on what others say.
    pub fn has_relays(&self) -> bool {
        !self.relays.is_empty()
    }

    /// Asks for certificates of this serial from `node`, which becomes a member if it is none.
    pub fn set(&mut self, node: NodeName, serial: u32) {
        self.members.insert(node, serial);
    }

    /// The common names of the certificates by which `node` is known: of the serial that the roster has, and of the
    /// next, so that a node may be renewed before every host has the new roster.
    pub(crate) fn common_names(&self, node: &NodeName) -> Vec<String> {
        let Some(serial) = self.members.get(node) else { return Vec::new() };
        let mut names = vec![node.to_string()];
        // Of two names that differ in nothing else, neither may be the other's.
        names.extend((!node.as_str().contains('-')).then(|| node.as_str().replace('/', "-")));
        let with = |serial: u32| names.iter().map(move |name| format!("{name};{serial}"));
        let first = names.iter().filter(|_| *serial == FIRST_SERIAL).cloned();
        first.chain(with(*serial)).chain(with(serial.saturating_add(1))).collect()
    }

    /// The member whose certificate has this common name.
    pub(crate) fn holder(&self, common_name: Option<&str>) -> Result<&NodeName, Unlisted> {
        let given = common_name.ok_or(Unlisted::Nameless)?;
        if let Some(node) =
            self.members.keys().find(|node| self.common_names(node).iter().any(|it| it == given))
        {
            return Ok(node);
        }
        let name = given.split(';').next().unwrap_or(given);
        let known = self.members.iter().find(|(node, _)| {
            node.as_str() == name || !node.as_str().contains('-') && node.as_str().replace('/', "-") == name
        });
        Err(match known {
            Some((node, serial)) => {
                Unlisted::Old { given: given.into(), expected: format!("{node};{serial}") }
            }
            None => Unlisted::Stranger(given.chars().take(100).collect()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(name: &str) -> NodeName {
        NodeName::new(name).unwrap()
    }

    #[test]
    fn a_first_certificate_needs_no_serial_and_an_old_one_is_nobodys() {
        let mut roster = Roster::of([node("uav/1"), node("ground/main")]);
        for name in ["uav/1", "uav-1", "uav/1;1", "uav-1;1", "uav/1;2"] {
            assert_eq!(roster.holder(Some(name)), Ok(&node("uav/1")), "{name}");
        }
        roster.set(node("uav/1"), 2);
        for name in ["uav/1", "uav-1", "uav/1;1", "uav/1;02", "uav/1;4"] {
            assert!(matches!(roster.holder(Some(name)), Err(Unlisted::Old { .. })), "{name}");
        }
        assert_eq!(roster.holder(Some("uav/1;3")), Ok(&node("uav/1")));
        for name in ["uav/2", "uav1", "", "uav/1/x"] {
            assert!(matches!(roster.holder(Some(name)), Err(Unlisted::Stranger(_))), "{name}");
        }
        assert_eq!(roster.holder(None), Err(Unlisted::Nameless));
    }

    #[test]
    fn no_certificate_has_two_holders() {
        let roster = Roster::of([node("a/b-c"), node("a-b/c")]);
        assert!(roster.holder(Some("a-b-c")).is_err());
        assert_eq!(roster.holder(Some("a/b-c")), Ok(&node("a/b-c")));
    }

    #[test]
    fn what_is_written_is_read_and_faults_are_named() {
        let mut roster = Roster::of([node("uav/1")]).relayed_by([node("router/1")]);
        roster.set(node("uav/1"), 3);
        assert_eq!(Roster::parse(&roster.to_text()), Ok(roster));
        for (text, fault) in [
            ("[members]\nuav = 1", "uav"),
            ("[members]\n\"uav/1\" = 0", "serial 0"),
            ("relays = [\"r/1\"]\n[members]\n\"uav/1\" = 1", "not in `members`"),
            ("[member]", "unknown field `member`"),
        ] {
            let error = Roster::parse(text).unwrap_err();
            assert!(error.contains(fault), "{error}");
        }
    }
}
