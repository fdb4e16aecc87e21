//! A remote node's bids, as its home honours them.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use skein_bp::{Bid, Event, EventSet};

use crate::message::{BidRecord, Refusal, RefusalReason, RemoteBid};

/// One node's bids in one of its lives.
#[derive(Clone, Debug, Default)]
pub(super) struct Bidder {
    pub(super) incarnation: u64,
    pub(super) epoch: u64,
    pub(super) sent_at: Duration,
    /// When the newest copy arrived, on this home's clock.
    pub(super) heard_at: Duration,
    pub(super) lease: Duration,
    /// Whether the lease runs.
    pub(super) live: bool,
    /// Whether one of its records was made for this home's present life.
    pub(super) knows_this_life: bool,
    pub(super) bids: BTreeMap<String, TakenBid>,
    /// The b-threads whose blocks lapsed with the lease, until the next record.
    pub(super) released: BTreeSet<String>,
    /// Highest synchronisation point of each b-thread at which a request was served (G4).
    pub(super) served: BTreeMap<String, u64>,
    pub(super) refused: Vec<Refusal>,
    /// Blocks that an authority has lifted: for each b-thread, up to which synchronisation point.
    pub(super) lifted: BTreeMap<String, u64>,
}

/// One bid, as far as it is honoured.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TakenBid {
    pub(super) sync: u64,
    pub(super) requests: Vec<Event>,
    pub(super) block: EventSet,
    /// The block as it was asked for, of which this home honours its own part.
    pub(super) asked_block: EventSet,
    pub(super) priority: Option<i32>,
    /// Whether the requests may still be served.
    pub(super) open: bool,
    /// Whether the block outlives its holder.
    pub(super) keep: bool,
    /// Whether it is left over from a life of its node that has ended, so that only an authority can lift it.
    pub(super) orphaned: bool,
}

impl Bidder {
    /// Its b-threads whose blocks end with its lease.
    pub(super) fn releasing(&self) -> impl Iterator<Item = String> + '_ {
        let releasing = |bid: &TakenBid| !bid.block.is_none() && !bid.keep;
        self.bids.iter().filter(move |(_, bid)| releasing(bid)).map(|(bthread, _)| bthread.clone())
    }

    /// The same node in a new life: of the old one, only the blocks that are kept count.
    pub(super) fn reborn(&mut self, incarnation: u64) -> Self {
        let mut bids = std::mem::take(&mut self.bids);
        bids.retain(|_, bid| bid.keep);
        bids.values_mut().for_each(|bid| *bid = TakenBid { orphaned: true, ..bid.left_over() });
        Self { incarnation, bids, ..Self::default() }
    }

    /// Takes over a newer copy's number, age and lease.
    pub(super) fn renew(&mut self, now: Duration, record: &BidRecord) {
        self.epoch = record.epoch;
        self.sent_at = record.sent_at;
        self.heard_at = now;
        self.lease = Duration::from_millis(record.lease_ms);
        self.live = true;
    }

    pub(super) fn has_been_served(&self, bid: &RemoteBid) -> bool {
        self.served.get(&bid.bthread).is_some_and(|served| bid.sync <= *served)
    }

    pub(super) fn refuse(&mut self, bid: &RemoteBid, reasons: Vec<RefusalReason>) {
        let refusals = reasons.into_iter().map(|reason| Refusal {
            bthread: bid.bthread.clone(),
            sync: bid.sync,
            reason,
        });
        self.refused.extend(refusals);
    }
}

impl TakenBid {
    /// The rest of a bid whose holder is lost.
    pub(super) fn left_over(&self) -> Self {
        let (block, asked_block) = (self.block.clone(), self.asked_block.clone());
        Self { sync: self.sync, block, asked_block, orphaned: self.orphaned, keep: true, ..Self::default() }
    }

    /// The bid of the proxy.
    pub(super) fn to_bid(&self) -> Bid {
        let mut bid = Bid::new().block(self.block.clone());
        if self.open {
            bid = self.requests.iter().fold(bid, |bid, event| bid.request(event));
        }
        match self.priority {
            Some(priority) => bid.priority(priority),
            None => bid,
        }
    }
}
