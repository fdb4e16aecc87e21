//! The keys under which messages are put.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use skein_dbp::{NodeName, is_chunk};

/// The first chunk of every key.
const ROOT: &str = "skein";

/// A key: `skein/<fleet>/<what>/<node>/...`.
///
/// The node that speaks comes right after what it says, so that access control can bind a certificate to the
/// keys that its node may put.
///
/// ```
/// use skein_wire::{Key, Topic};
/// let key: Key = "skein/demo/bid/ground/main/uav/3".parse()?;
/// assert_eq!(key.sender().as_str(), "ground/main");
/// assert_eq!(key.recipient().map(|node| node.as_str()), Some("uav/3"));
/// assert_eq!(key.to_string(), "skein/demo/bid/ground/main/uav/3");
/// # Ok::<(), skein_wire::KeyError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    fleet: Fleet,
    topic: Topic,
}

/// The name of a fleet: one chunk of letters, digits, `_`, `.` or `-`. Fleets on one network do not hear one another.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fleet(Arc<str>);

/// What is said, by whom and to whom.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Topic {
    /// `bid/<from>/<home>`: the bids of a node for the events of a home.
    Bid { from: NodeName, home: NodeName },
    /// `ack/<home>/<node>`: the home's answer.
    Ack { home: NodeName, node: NodeName },
    /// `occ/<home>`: the home's occurrences; `occ/<home>/<node>` when repeated for one.
    Occurrence {
        home: NodeName,
        /// Who asked for it again, if any.
        to: Option<NodeName>,
    },
    /// `repair/<from>/<home>`: a wish to hear occurrences again.
    Repair { from: NodeName, home: NodeName },
    /// `presence/<node>`: a sign of life.
    Presence { node: NodeName },
    /// `state/<node>`: a vehicle's state.
    State { node: NodeName },
    /// `scan/<sensor>/<vehicle>`: what a vehicle's lidar sees.
    Scan {
        /// The node that reads the lidar.
        sensor: NodeName,
        vehicle: NodeName,
    },
    /// `scene/<node>`: what stands in a world.
    Scene {
        /// Who hosts the world.
        node: NodeName,
    },
    /// `board/<node>`: what all b-threads bid at a node.
    Board { node: NodeName },
}

/// A text that is not one of Skein's keys.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// The fleet's name is not one chunk.
    #[error(
        "`{given}` is not a fleet name: expected one chunk of letters, digits, `_`, `.` or `-`, such as `demo`"
    )]
    Fleet {
        /// The text at fault.
        given: String,
    },
    /// The key has another form.
    #[error(
        "`{given}` is not a key: expected `{ROOT}/<fleet>/<what>/<node>`, `<what>` being bid, ack, occ, repair, presence, state, scan, scene or board, and a second node where it is for one"
    )]
    Form {
        /// The text at fault.
        given: String,
    },
}

impl Fleet {
    /// Checks `name` and makes a fleet's name of it.
    pub fn new(name: &str) -> Result<Self, KeyError> {
        if is_chunk(name) { Ok(Self(name.into())) } else { Err(KeyError::Fleet { given: name.into() }) }
    }

    /// The name as text.
    #[must_use]
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
    /// The key of `topic` in `fleet`.
    #[must_use]
    pub fn new(fleet: &Fleet, topic: Topic) -> Self {
        Self { fleet: fleet.clone(), topic }
    }

    #[must_use]
    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    /// What is said.
    #[must_use]
    pub fn topic(&self) -> &Topic {
        &self.topic
    }

    #[must_use]
    pub fn sender(&self) -> &NodeName {
        match &self.topic {
            Topic::Bid { from: node, .. }
            | Topic::Ack { home: node, .. }
            | Topic::Occurrence { home: node, .. }
            | Topic::Repair { from: node, .. }
            | Topic::Presence { node }
            | Topic::State { node }
            | Topic::Scan { sensor: node, .. }
            | Topic::Scene { node }
            | Topic::Board { node } => node,
        }
    }

    /// Whom it is for; none if for all.
    #[must_use]
    pub fn recipient(&self) -> Option<&NodeName> {
        match &self.topic {
            Topic::Bid { home: node, .. } | Topic::Ack { node, .. } | Topic::Repair { home: node, .. } => {
                Some(node)
            }
            Topic::Occurrence { to, .. } => to.as_ref(),
            Topic::Scan { vehicle, .. } => Some(vehicle),
            Topic::Presence { .. } | Topic::State { .. } | Topic::Scene { .. } | Topic::Board { .. } => None,
        }
    }

    /// The pattern, in Zenoh's language, of all states.
    #[must_use]
    pub fn states(fleet: &Fleet) -> String {
        format!("{ROOT}/{fleet}/state/*/*")
    }

    /// The pattern of all occurrences, as they happen.
    #[must_use]
    pub fn occurrences(fleet: &Fleet) -> String {
        format!("{ROOT}/{fleet}/occ/*/*")
    }

    /// The pattern of all scenes.
    #[must_use]
    pub fn scenes(fleet: &Fleet) -> String {
        format!("{ROOT}/{fleet}/scene/*/*")
    }

    /// The patterns, in Zenoh's language, of all keys that a node of this name wants to hear.
    #[must_use]
    pub fn subscriptions(fleet: &Fleet, node: &NodeName) -> Vec<String> {
        let to_all = ["occ", "presence", "state"].map(|what| format!("{ROOT}/{fleet}/{what}/*/*"));
        let to_one = ["bid", "ack", "occ", "repair"].map(|what| format!("{ROOT}/{fleet}/{what}/*/*/{node}"));
        to_all.into_iter().chain(to_one).collect()
    }

    /// The same for a node that also reads the boards of all.
    #[must_use]
    pub fn subscriptions_with_boards(fleet: &Fleet, node: &NodeName) -> Vec<String> {
        let boards = format!("{ROOT}/{fleet}/board/*/*");
        Self::subscriptions(fleet, node).into_iter().chain([boards]).collect()
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match &self.topic {
            Topic::Bid { .. } => "bid",
            Topic::Ack { .. } => "ack",
            Topic::Occurrence { .. } => "occ",
            Topic::Repair { .. } => "repair",
            Topic::Presence { .. } => "presence",
            Topic::State { .. } => "state",
            Topic::Scan { .. } => "scan",
            Topic::Scene { .. } => "scene",
            Topic::Board { .. } => "board",
        };
        write!(f, "{ROOT}/{}/{what}/{}", self.fleet, self.sender())?;
        self.recipient().map_or(Ok(()), |node| write!(f, "/{node}"))
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
        let topic = match (*what, recipient) {
            ("bid", Some(home)) => Topic::Bid { from: sender, home },
            ("ack", Some(node)) => Topic::Ack { home: sender, node },
            ("occ", to) => Topic::Occurrence { home: sender, to },
            ("repair", Some(home)) => Topic::Repair { from: sender, home },
            ("presence", None) => Topic::Presence { node: sender },
            ("state", None) => Topic::State { node: sender },
            ("scan", Some(vehicle)) => Topic::Scan { sensor: sender, vehicle },
            ("scene", None) => Topic::Scene { node: sender },
            ("board", None) => Topic::Board { node: sender },
            _ => return Err(form()),
        };
        Ok(Self { fleet: Fleet::new(fleet)?, topic })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(name: &str) -> NodeName {
        NodeName::new(name).unwrap()
    }

    #[test]
    fn every_topic_survives_text() {
        let (a, b) = (node("uav/1"), node("ground/main"));
        let topics = [
            Topic::Bid { from: a.clone(), home: b.clone() },
            Topic::Ack { home: a.clone(), node: b.clone() },
            Topic::Occurrence { home: a.clone(), to: None },
            Topic::Occurrence { home: a.clone(), to: Some(b.clone()) },
            Topic::Repair { from: a.clone(), home: b.clone() },
            Topic::Presence { node: a.clone() },
            Topic::State { node: a.clone() },
            Topic::Scan { sensor: b.clone(), vehicle: a.clone() },
            Topic::Scene { node: a.clone() },
            Topic::Board { node: a },
        ];
        let fleet = Fleet::new("demo").unwrap();
        for topic in topics {
            let key = Key::new(&fleet, topic);
            assert_eq!(key.to_string().parse::<Key>().as_ref(), Ok(&key));
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
