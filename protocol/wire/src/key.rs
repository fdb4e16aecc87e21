//! The keys under which messages are put.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use skein_dbp::{BidAck, Board, NodeName, Occurrence, Repair, is_chunk};

use crate::message::{KINDS, Kind, Payload, Readiness, Record, State};
use crate::proto::MAX_PAYLOAD;

/// The first chunk of every key.
const ROOT: &str = "skein";

/// A key: `skein/<fleet>/<what>/<node>/...`.
///
/// The node that speaks comes right after what it says, so that access control can bind a certificate to the
/// keys that its node may put.
///
/// ```
/// use skein_wire::Key;
/// let key: Key = "skein/demo/bid/ground/main/uav/3".parse()?;
/// assert_eq!(key.sender().as_str(), "ground/main");
/// assert_eq!(key.recipient().map(|node| node.as_str()), Some("uav/3"));
/// assert_eq!(key.to_string(), "skein/demo/bid/ground/main/uav/3");
/// # Ok::<(), skein_wire::KeyError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    fleet: Fleet,
    kind: &'static Kind,
    sender: NodeName,
    recipient: Option<NodeName>,
}

/// The name of a fleet: one chunk of letters, digits, `_`, `.` or `-`. Fleets on one network do not hear one another.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fleet(Arc<str>);

/// A text that is not one of Skein's keys.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    #[error(
        "`{given}` is not a fleet name: expected one chunk of letters, digits, `_`, `.` or `-`, such as `demo`"
    )]
    Fleet { given: String },
    #[error(
        "`{given}` is not a key: expected `{ROOT}/<fleet>/<what>/<node>`, `<what>` one of {}, \
         and a second node where it is for one",
        words()
    )]
    Form { given: String },
}

impl Fleet {
    /// Checks `name` and makes a fleet's name of it.
    pub fn new(name: &str) -> Result<Self, KeyError> {
        if is_chunk(name) { Ok(Self(name.into())) } else { Err(KeyError::Fleet { given: name.into() }) }
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Fleet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Key {
    /// The key under which `sender` says to all what an `R` holds.
    ///
    /// Does not compile for a message that is for one node.
    pub fn to_all<R: Record>(fleet: &Fleet, sender: NodeName) -> Self {
        const { assert!(R::KIND.may_be_for_all(), "this message is for one node") };
        Self { fleet: fleet.clone(), kind: &R::KIND, sender, recipient: None }
    }

    /// The key under which `sender` says to one node what an `R` holds.
    ///
    /// Does not compile for a message that is for all.
    pub fn to_one<R: Record>(fleet: &Fleet, sender: NodeName, recipient: NodeName) -> Self {
        const { assert!(R::KIND.may_be_for_one(), "this message is for all") };
        Self { fleet: fleet.clone(), kind: &R::KIND, sender, recipient: Some(recipient) }
    }

    /// The key under which `sender` puts `payload` for `recipient`, none being all.
    pub(crate) fn of(
        payload: &Payload,
        fleet: &Fleet,
        sender: &NodeName,
        recipient: Option<NodeName>,
    ) -> Self {
        let (kind, _, named) = payload.heading();
        let recipient = named.cloned().or(recipient).filter(|_| kind.may_be_for_one());
        Self { fleet: fleet.clone(), kind, sender: sender.clone(), recipient }
    }

    /// Whether `payload` is of this key's kind, and claims no other sender or recipient than the key names.
    pub(crate) fn fits(&self, payload: &Payload) -> bool {
        let (kind, sender, recipient) = payload.heading();
        kind == self.kind
            && sender.is_none_or(|sender| *sender == self.sender)
            && recipient.is_none_or(|recipient| Some(recipient) == self.recipient.as_ref())
    }

    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    /// Whether an `R` is put under it.
    pub fn is_of<R: Record>(&self) -> bool {
        *self.kind == R::KIND
    }

    pub fn sender(&self) -> &NodeName {
        &self.sender
    }

    /// The longest message that may be put under it, in bytes.
    pub fn most_bytes(&self) -> usize {
        self.kind.bytes.most().min(MAX_PAYLOAD)
    }

    /// Whether the newest message under it says all that earlier ones have said.
    pub(crate) fn says_all(&self) -> bool {
        !(self.is_of::<Occurrence>() || self.is_of::<Repair>() || self.is_of::<BidAck>())
    }

    /// Whom it is for; none if for all.
    pub fn recipient(&self) -> Option<&NodeName> {
        self.recipient.as_ref()
    }

    /// The pattern, in Zenoh's language, of all keys under which an `R` is put for all.
    pub fn pattern<R: Record>(fleet: &Fleet) -> String {
        const { assert!(R::KIND.may_be_for_all(), "this message is for one node") };
        pattern(fleet, &R::KIND)
    }

    /// The patterns of all keys that a node of this name wants to hear.
    pub fn subscriptions(fleet: &Fleet, node: &NodeName) -> Vec<String> {
        let heard = || KINDS.iter().filter(|kind| kind.every_node_listens);
        let to_all = heard().filter(|kind| kind.may_be_for_all()).map(|kind| pattern(fleet, kind));
        let to_one = heard().filter(|kind| kind.may_be_for_one());
        to_all.chain(to_one.map(|kind| format!("{}/{node}", pattern(fleet, kind)))).collect()
    }

    /// The patterns of all keys that a node of this name may hear: whatever is for all, and what is for it.
    pub fn audible(fleet: &Fleet, node: &NodeName) -> Vec<String> {
        let to_all = KINDS.iter().filter(|kind| kind.may_be_for_all()).map(|kind| pattern(fleet, kind));
        let to_one = KINDS.iter().filter(|kind| kind.may_be_for_one());
        to_all.chain(to_one.map(|kind| format!("{}/{node}", pattern(fleet, kind)))).collect()
    }

    /// The pattern of all keys under which a node of this name puts.
    pub fn said_by(fleet: &Fleet, node: &NodeName) -> String {
        format!("{ROOT}/{fleet}/*/{node}/**")
    }

    /// The pattern of all keys of a fleet.
    pub fn of_fleet(fleet: &Fleet) -> String {
        format!("{ROOT}/{fleet}/**")
    }

    /// Those of them under which vehicles tell of their bodies: see [`VehicleLink`](crate::VehicleLink).
    pub fn vehicle_subscriptions(fleet: &Fleet) -> Vec<String> {
        vec![Self::pattern::<State>(fleet), Self::pattern::<Readiness>(fleet)]
    }

    /// All but those.
    pub fn protocol_subscriptions(fleet: &Fleet, node: &NodeName) -> Vec<String> {
        let of_vehicles = Self::vehicle_subscriptions(fleet);
        Self::subscriptions(fleet, node)
            .into_iter()
            .filter(|pattern| !of_vehicles.contains(pattern))
            .collect()
    }

    /// The same for a node that also reads the boards of all.
    pub fn subscriptions_with_boards(fleet: &Fleet, node: &NodeName) -> Vec<String> {
        Self::subscriptions(fleet, node).into_iter().chain([Self::pattern::<Board>(fleet)]).collect()
    }
}

fn pattern(fleet: &Fleet, kind: &Kind) -> String {
    format!("{ROOT}/{fleet}/{}/*/*", kind.word)
}

fn words() -> String {
    KINDS.iter().map(|kind| kind.word).collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{ROOT}/{}/{}/{}", self.fleet, self.kind.word, self.sender)?;
        self.recipient.iter().try_for_each(|recipient| write!(f, "/{recipient}"))
    }
}

impl FromStr for Key {
    type Err = KeyError;

    fn from_str(text: &str) -> Result<Self, KeyError> {
        let form = || KeyError::Form { given: text.chars().take(256).collect() };
        let chunks: Vec<&str> = text.split('/').collect();
        let [ROOT, fleet, what, kind, id, rest @ ..] = chunks.as_slice() else { return Err(form()) };
        let node = |kind: &str, id: &str| NodeName::new(&format!("{kind}/{id}")).map_err(|_| form());
        let sender = node(kind, id)?;
        let recipient = match rest {
            [] => None,
            [kind, id] => Some(node(kind, id)?),
            _ => return Err(form()),
        };
        let fits = |kind: &Kind| {
            let fits = if recipient.is_some() { kind.may_be_for_one() } else { kind.may_be_for_all() };
            kind.word == *what && fits
        };
        let kind = KINDS.iter().find(|kind| fits(kind)).ok_or_else(form)?;
        Ok(Self { fleet: Fleet::new(fleet)?, kind, sender, recipient })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(name: &str) -> NodeName {
        NodeName::new(name).unwrap()
    }

    #[test]
    fn every_key_survives_text() {
        let (fleet, a, b) = (Fleet::new("demo").unwrap(), node("uav/1"), node("ground/main"));
        let mut keys = 0;
        for kind in KINDS {
            for recipient in [None, Some(b.clone())] {
                let key = Key { fleet: fleet.clone(), kind, sender: a.clone(), recipient };
                let fits =
                    if key.recipient.is_some() { kind.may_be_for_one() } else { kind.may_be_for_all() };
                assert_eq!(key.to_string().parse::<Key>().ok(), fits.then_some(key));
                keys += usize::from(fits);
            }
        }
        assert_eq!(keys, KINDS.len() + 1, "occurrences alone are for all or for one");
    }

    #[test]
    fn no_two_kinds_have_one_word() {
        let words: std::collections::BTreeSet<_> = KINDS.iter().map(|kind| kind.word).collect();
        assert_eq!(words.len(), KINDS.len());
    }

    #[test]
    fn a_node_listens_to_what_is_for_it_and_for_all() {
        let patterns = Key::subscriptions_with_boards(&Fleet::new("demo").unwrap(), &node("uav/1"));
        let expected = [
            "occ/*/*",
            "presence/*/*",
            "state/*/*",
            "readiness/*/*",
            "bid/*/*/uav/1",
            "ack/*/*/uav/1",
            "occ/*/*/uav/1",
            "repair/*/*/uav/1",
            "board/*/*",
        ];
        assert_eq!(patterns, expected.map(|pattern| format!("skein/demo/{pattern}")));
    }

    #[test]
    fn a_node_may_hear_what_is_for_it_and_for_all_and_nothing_for_others() {
        let (fleet, me) = (Fleet::new("demo").unwrap(), node("uav/1"));
        let audible = Key::audible(&fleet, &me);
        for pattern in Key::subscriptions_with_boards(&fleet, &me) {
            assert!(audible.contains(&pattern), "{pattern} may not be heard");
        }
        for pattern in audible {
            let text = pattern.replacen("*/*", "ground/main", 1);
            let key: Key = text.parse().unwrap();
            assert!(key.recipient().is_none_or(|recipient| *recipient == me), "{key}");
        }
    }

    #[test]
    fn other_texts_are_refused() {
        for bad in [
            "",
            "skein",
            "other/demo/state/uav/1",
            "skein/demo/state/uav",
            "skein/demo/state/uav/1/uav/2",
            "skein/demo/bid/uav/1",
            "skein/demo/bid/uav/1/uav",
            "skein/demo/nonsense/uav/1",
            "skein/de mo/state/uav/1",
            "skein/demo/state/uav/*",
        ] {
            assert!(bad.parse::<Key>().is_err(), "{bad:?} was taken for a key");
        }
    }
}
