//! What this node bids for the events of one other home, and what that home has said to it.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::{BidAck, BidRecord, NodeName, OnLoss, Refusal, RemoteBid};

/// The newest record for one home, kept alive by renewals.
#[derive(Clone, Debug)]
pub(crate) struct Outbox {
    /// The home's incarnation, once it is known.
    pub(crate) home_incarnation: Option<u64>,
    /// Number of the present content; 0 before the first.
    pub(crate) epoch: u64,
    pub(crate) bids: Vec<RemoteBid>,
    /// For each b-thread, its synchronisation point and the epoch in which that came in.
    pub(crate) since: BTreeMap<String, (u64, u64)>,
    /// Requests that a former life of the home may have served: the synchronisation point not to be asked for again.
    pub(crate) unknown: BTreeMap<String, u64>,
    /// What the home did not honour of the content it acknowledged last.
    pub(crate) refused: Vec<Refusal>,
    /// Blocks that the home keeps even without renewal: for each b-thread, its synchronisation point (G5).
    pub(crate) durable: BTreeMap<String, u64>,
    pub(crate) acked_epoch: u64,
    /// When the last acknowledged copy was sent.
    pub(crate) acked_sent_at: Duration,
    /// When the last copy was sent; none of the present content yet.
    pub(crate) sent_at: Option<Duration>,
}

/// Who bids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sender<'a> {
    pub(crate) node: &'a NodeName,
    pub(crate) incarnation: u64,
    pub(crate) lease: Duration,
    /// The term it is in, and how many of its decisions it has applied.
    pub(crate) term: u64,
    pub(crate) decided: u64,
}

impl Outbox {
    pub(crate) fn new() -> Self {
        Self {
            home_incarnation: None,
            epoch: 0,
            bids: Vec::new(),
            since: BTreeMap::new(),
            unknown: BTreeMap::new(),
            refused: Vec::new(),
            durable: BTreeMap::new(),
            acked_epoch: 0,
            acked_sent_at: Duration::ZERO,
            sent_at: None,
        }
    }

    /// The life of the home that requests are addressed to.
    pub(crate) fn home_incarnation(&self) -> Option<u64> {
        self.home_incarnation
    }

    /// States these bids from now on.
    pub(crate) fn state(&mut self, mut bids: Vec<RemoteBid>) {
        self.unknown
            .retain(|bthread, sync| bids.iter().any(|bid| bid.bthread == *bthread && bid.sync == *sync));
        for bid in &mut bids {
            if self.unknown.contains_key(&bid.bthread) {
                bid.requests.clear();
            }
        }
        bids.retain(|bid| !bid.requests.is_empty() || !bid.block.is_none());
        if bids != self.bids {
            self.bids = bids;
            self.renew_content();
        }
    }

    /// The home lives in a new incarnation: nothing that the old one had taken in counts any more. Gives the bids
    /// whose requests may have been served or not (G4).
    pub(crate) fn home_restarted(&mut self, incarnation: u64) -> Vec<RemoteBid> {
        let known_before = self.home_incarnation.replace(incarnation).is_some();
        self.acked_epoch = 0;
        let mut unknown = Vec::new();
        if known_before {
            unknown.extend(self.bids.iter().filter(|bid| !bid.requests.is_empty()).cloned());
            self.unknown.extend(unknown.iter().map(|bid| (bid.bthread.clone(), bid.sync)));
            self.bids.iter_mut().for_each(|bid| bid.requests.clear());
            self.bids.retain(|bid| !bid.block.is_none());
        }
        self.renew_content();
        unknown
    }

    /// The b-threads, each with its synchronisation point, that the home may have served or may still serve.
    pub(crate) fn asked(&self) -> Vec<(String, u64)> {
        let open = self.bids.iter().filter(|bid| self.home_incarnation.is_some() && !bid.requests.is_empty());
        let open = open.map(|bid| (bid.bthread.clone(), bid.sync));
        open.chain(self.unknown.iter().map(|(bthread, sync)| (bthread.clone(), *sync))).collect()
    }

    /// What `bthread` requests since its synchronisation point `sync` may have occurred elsewhere: it is not asked for here.
    pub(crate) fn leave_unknown(&mut self, bthread: &str, sync: u64) {
        self.unknown.insert(bthread.into(), sync);
    }

    fn renew_content(&mut self) {
        self.epoch += 1;
        let epoch = self.epoch;
        let since = self.bids.iter().map(|bid| {
            let entered = match self.since.get(&bid.bthread) {
                Some((sync, entered)) if *sync == bid.sync => *entered,
                _ => epoch,
            };
            (bid.bthread.clone(), (bid.sync, entered))
        });
        self.since = since.collect();
        let since = &self.since;
        self.durable.retain(|bthread, sync| since.get(bthread).is_some_and(|(stated, _)| stated == sync));
        self.sent_at = None;
    }

    /// Takes in an answer of the home's present life; gives the refusals that are news.
    pub(crate) fn acknowledged(&mut self, now: Duration, ack: BidAck) -> Vec<Refusal> {
        if self.home_incarnation != Some(ack.home_incarnation) || ack.epoch > self.epoch || ack.sent_at > now
        {
            return Vec::new();
        }
        let late = (ack.epoch, ack.sent_at) <= (self.acked_epoch, self.acked_sent_at);
        self.acked_sent_at = self.acked_sent_at.max(ack.sent_at);
        if late || ack.epoch < self.acked_epoch {
            return Vec::new();
        }
        self.acked_epoch = ack.epoch;
        let before = std::mem::replace(&mut self.refused, ack.refused);
        for bid in self.bids.iter().filter(|bid| bid.on_loss == OnLoss::Hold) {
            let sync = bid.sync;
            let acked = self.since.get(&bid.bthread).is_some_and(|(_, epoch)| *epoch <= ack.epoch);
            if self.block_refused(&bid.bthread, sync) {
                self.durable.remove(&bid.bthread);
            } else if acked {
                self.durable.insert(bid.bthread.clone(), sync);
            }
        }
        self.refused.iter().filter(|refusal| !before.contains(refusal)).cloned().collect()
    }

    fn block_refused(&self, bthread: &str, sync: u64) -> bool {
        let refused = |refusal: &Refusal| {
            refusal.bthread == bthread && refusal.sync == sync && refusal.reason.voids_block()
        };
        self.refused.iter().any(refused)
    }

    /// Until when, on this node's clock, the home surely keeps the block that `bthread` holds since its
    /// synchronisation point `sync`; none if it has not acknowledged it. Counts 0.9 lease from sending (G3); a block that
    /// is kept without renewal has no end.
    pub(crate) fn kept_until(&self, bthread: &str, sync: u64, lease: Duration) -> Option<Duration> {
        if self.durable.get(bthread) == Some(&sync) {
            return Some(Duration::MAX);
        }
        let (since_sync, epoch) = *self.since.get(bthread)?;
        let kept = since_sync == sync && self.acked_epoch >= epoch && !self.block_refused(bthread, sync);
        kept.then(|| self.acked_sent_at + lease * 9 / 10)
    }

    /// The record to send now, if one is due. Each renewal is repeated every tenth of the lease until it is
    /// acknowledged; the next one follows a third of the lease after it was sent.
    pub(crate) fn due(
        &mut self,
        now: Duration,
        from: &Sender<'_>,
        home: &NodeName,
        applied: u64,
    ) -> Option<BidRecord> {
        if self.next_deadline(from.lease).is_none_or(|due| now < due) {
            return None;
        }
        self.sent_at = Some(now);
        Some(BidRecord {
            node: from.node.clone(),
            incarnation: from.incarnation,
            home: home.clone(),
            home_incarnation: self.home_incarnation,
            epoch: self.epoch,
            sent_at: now,
            applied,
            term: from.term,
            decided: from.decided,
            lease_ms: u64::try_from(from.lease.as_millis()).unwrap_or(u64::MAX),
            bids: self.bids.clone(),
        })
    }

    /// When the next copy is due.
    pub(crate) fn next_deadline(&self, lease: Duration) -> Option<Duration> {
        if !self.has_to_say() {
            return None;
        }
        let repetition = self.sent_at.map_or(Duration::ZERO, |sent_at| sent_at + lease / 10);
        let acknowledged = self.acked_epoch == self.epoch;
        Some(if acknowledged { repetition.max(self.acked_sent_at + lease / 3) } else { repetition })
    }

    /// An empty record is sent until the home knows of it, then no more.
    fn has_to_say(&self) -> bool {
        !self.bids.is_empty() || self.acked_epoch < self.epoch
    }
}
