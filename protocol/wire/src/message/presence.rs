//! A sign of life, on `presence/<node>`.

use std::time::Duration;

use skein_bp::Bound;
use skein_dbp::{JointWord, NodeName, Presence};

use super::field::{Result, node, ns, number, text};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

impl Record for Presence {
    const KIND: Kind = Kind {
        word: "presence",
        addressee: Addressee::All,
        every_node_listens: true,
        bytes: Bound::PresenceBytes,
    };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.node)
    }
}

impl From<&Presence> for proto::Presence {
    fn from(presence: &Presence) -> Self {
        Self {
            node: text(&presence.node),
            incarnation: presence.incarnation,
            up_ns: ns(presence.up),
            latest_seq: presence.latest_seq,
            oldest_seq: presence.oldest_seq,
            lease_ms: presence.lease_ms,
            joint: presence.joint.map(|word| proto::JointWord {
                term: word.term,
                decided: word.decided,
                heard_ns: word.heard.map(ns),
                asks: word.asks,
            }),
        }
    }
}

impl TryFrom<proto::Presence> for Presence {
    type Error = DecodeError;

    fn try_from(presence: proto::Presence) -> Result<Self> {
        Ok(Self {
            node: node("Presence.node", &presence.node)?,
            incarnation: presence.incarnation,
            up: Duration::from_nanos(presence.up_ns),
            latest_seq: number("Presence.latest_seq", presence.latest_seq, 0)?,
            oldest_seq: number("Presence.oldest_seq", presence.oldest_seq, 1)?,
            lease_ms: presence.lease_ms,
            joint: presence.joint.map(JointWord::try_from).transpose()?,
        })
    }
}

impl TryFrom<proto::JointWord> for JointWord {
    type Error = DecodeError;

    fn try_from(word: proto::JointWord) -> Result<Self> {
        Ok(Self {
            term: number("JointWord.term", word.term, 1)?,
            decided: number("JointWord.decided", word.decided, 0)?,
            heard: word.heard_ns.map(Duration::from_nanos),
            asks: word.asks,
        })
    }
}
