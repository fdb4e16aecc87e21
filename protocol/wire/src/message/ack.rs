//! A home's answer to the bids of a node, on `ack/<home>/<node>`.

use std::time::Duration;

use skein_bp::Bound;
use skein_dbp::{BidAck, NodeName, Refusal, RefusalReason};

use super::field::{Result, bounded, node, ns, number, same_variants, text};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

impl Record for BidAck {
    const KIND: Kind =
        Kind { word: "ack", addressee: Addressee::One, every_node_listens: true, bytes: Bound::BidBytes };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.home)
    }

    fn recipient(&self) -> Option<&NodeName> {
        Some(&self.node)
    }
}

impl From<&BidAck> for proto::BidAck {
    fn from(ack: &BidAck) -> Self {
        Self {
            home: text(&ack.home),
            home_incarnation: ack.home_incarnation,
            node: text(&ack.node),
            incarnation: ack.incarnation,
            epoch: ack.epoch,
            sent_at_ns: ns(ack.sent_at),
            latest_seq: ack.latest_seq,
            refused: ack.refused.iter().map(Into::into).collect(),
        }
    }
}

impl TryFrom<proto::BidAck> for BidAck {
    type Error = DecodeError;

    fn try_from(ack: proto::BidAck) -> Result<Self> {
        bounded("BidAck.refused", Bound::ListItems, ack.refused.len())?;
        Ok(Self {
            home: node("BidAck.home", &ack.home)?,
            home_incarnation: ack.home_incarnation,
            node: node("BidAck.node", &ack.node)?,
            incarnation: ack.incarnation,
            epoch: number("BidAck.epoch", ack.epoch, 1)?,
            sent_at: Duration::from_nanos(ack.sent_at_ns),
            latest_seq: number("BidAck.latest_seq", ack.latest_seq, 0)?,
            refused: ack.refused.into_iter().map(Refusal::try_from).collect::<Result<_>>()?,
        })
    }
}

same_variants!(
    RefusalReason, proto::RefusalReason:
    Unspecified, Safety, NotHome, HoldUnsupported, LeaseTooLong, Reserved, Quota, MayNotRequest, MayNotBlock, Lifted
);

impl From<&Refusal> for proto::Refusal {
    fn from(refusal: &Refusal) -> Self {
        let reason = proto::RefusalReason::from(refusal.reason);
        Self { bthread: refusal.bthread.clone(), sync: refusal.sync, reason: reason.into() }
    }
}

impl TryFrom<proto::Refusal> for Refusal {
    type Error = DecodeError;

    fn try_from(refusal: proto::Refusal) -> Result<Self> {
        bounded("Refusal.bthread", Bound::NameBytes, refusal.bthread.len())?;
        // A reason of a later version is still a refusal.
        let reason = proto::RefusalReason::try_from(refusal.reason).unwrap_or_default().into();
        Ok(Self { bthread: refusal.bthread, sync: number("Refusal.sync", refusal.sync, 1)?, reason })
    }
}
