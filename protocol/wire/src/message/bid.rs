//! The bids of a node's b-threads for the events of one home, on `bid/<from>/<home>`.

use std::time::Duration;

use skein_bp::{Bound, Event, EventSet};
use skein_dbp::{BidRecord, NodeName, OnLoss, RemoteBid};

use super::field::{Result, node, ns, number, out_of_range, same_variants, text};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

impl Record for BidRecord {
    const KIND: Kind =
        Kind { word: "bid", addressee: Addressee::One, every_node_listens: true, bytes: Bound::BidBytes };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.node)
    }

    fn recipient(&self) -> Option<&NodeName> {
        Some(&self.home)
    }
}

impl From<&BidRecord> for proto::BidRecord {
    fn from(record: &BidRecord) -> Self {
        Self {
            node: text(&record.node),
            incarnation: record.incarnation,
            home: text(&record.home),
            home_incarnation: record.home_incarnation,
            epoch: record.epoch,
            sent_at_ns: ns(record.sent_at),
            applied: record.applied,
            lease_ms: record.lease_ms,
            bids: record.bids.iter().map(Into::into).collect(),
            term: record.term,
            decided: record.decided,
        }
    }
}

impl TryFrom<proto::BidRecord> for BidRecord {
    type Error = DecodeError;

    fn try_from(record: proto::BidRecord) -> Result<Self> {
        let record = Self {
            node: node("BidRecord.node", &record.node)?,
            incarnation: record.incarnation,
            home: node("BidRecord.home", &record.home)?,
            home_incarnation: record.home_incarnation,
            epoch: number("BidRecord.epoch", record.epoch, 1)?,
            sent_at: Duration::from_nanos(record.sent_at_ns),
            applied: number("BidRecord.applied", record.applied, 0)?,
            lease_ms: record.lease_ms,
            term: number("BidRecord.term", record.term, 0)?,
            decided: number("BidRecord.decided", record.decided, 0)?,
            bids: record.bids.into_iter().map(RemoteBid::try_from).collect::<Result<_>>()?,
        };
        record.check_bounds().map_err(|cause| DecodeError::Bound { field: "BidRecord", cause })?;
        Ok(record)
    }
}

same_variants!(OnLoss, proto::OnLoss: Release, Hold);

impl From<&RemoteBid> for proto::RemoteBid {
    fn from(bid: &RemoteBid) -> Self {
        Self {
            bthread: bid.bthread.clone(),
            sync: bid.sync,
            requests: bid.requests.iter().map(Into::into).collect(),
            block: (!bid.block.is_none()).then(|| (&bid.block).into()),
            block_since: Some(bid.block_since),
            priority: bid.priority,
            on_loss: proto::OnLoss::from(bid.on_loss).into(),
        }
    }
}

impl TryFrom<proto::RemoteBid> for RemoteBid {
    type Error = DecodeError;

    fn try_from(bid: proto::RemoteBid) -> Result<Self> {
        let on_loss = proto::OnLoss::try_from(bid.on_loss)
            .map_err(|_| out_of_range("RemoteBid.on_loss", bid.on_loss, "0 (release) or 1 (hold)"))?;
        Ok(Self {
            bthread: bid.bthread,
            sync: number("RemoteBid.sync", bid.sync, 1)?,
            requests: bid.requests.into_iter().map(Event::try_from).collect::<Result<_>>()?,
            block: bid.block.map_or(Ok(EventSet::None), EventSet::try_from)?,
            block_since: bid.block_since.map_or(bid.sync, |since| since.min(bid.sync)),
            priority: bid.priority,
            on_loss: on_loss.into(),
        })
    }
}
