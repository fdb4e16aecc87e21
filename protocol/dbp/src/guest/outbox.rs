//! A node's bids for the events of one other home, and that home's answers.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::message::{BidAck, OnLoss, Refusal, RemoteBid};

/// The newest record for one home, kept alive by renewals.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outbox {
    /// The home's incarnation, once it is known.
    pub(crate) home_incarnation: Option<u64>,
    /// Number of the present content; 0 before the first.
    pub(crate) epoch: u64,
    pub(crate) bids: Vec<RemoteBid>,
    /// The origin of each b-thread's block there.
    pub(crate) blocks: BTreeMap<String, Statement>,
    /// Requests that a former life of the home may have served: the synchronisation point not to be asked for again.
    pub(crate) unknown: BTreeMap<String, u64>,
    /// The refusals of the content that the home acknowledged last.
    pub(crate) refused: Vec<Refusal>,
    pub(crate) acked_epoch: u64,
    /// When the last acknowledged copy was sent.
    pub(crate) acked_sent_at: Duration,
    /// When the last copy was sent; none of the present content yet.
    pub(crate) sent_at: Option<Duration>,
}

/// A block, from the first synchronisation point that stated it or more, without a pause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Statement {
    /// The present synchronisation point, and the epoch in which it came in.
    pub(crate) sync: u64,
    pub(crate) entered: u64,
    /// The first one, and an epoch since which every content holds the block.
    pub(crate) since: u64,
    pub(crate) held_since: u64,
    /// The synchronisation point at which the home took it in as one that it keeps without renewal (G5).
    pub(crate) durable: Option<u64>,
}

/// The sure hold of a home on a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Upheld {
    /// Until when, on the holder's clock, it keeps the block: one that it keeps without renewal has no end.
    pub(crate) until: Duration,
    /// Whether it has acknowledged the block as it is stated at this very synchronisation point.
    pub(crate) acknowledged: bool,
}

impl Statement {
    /// A block that comes in with the content `epoch`.
    fn new(sync: u64, epoch: u64) -> Self {
        Self { sync, entered: epoch, since: sync, held_since: epoch, durable: None }
    }

    /// Whether the home does not honour it, at any of its synchronisation points.
    fn is_refused(&self, bthread: &str, refused: &[Refusal]) -> bool {
        refused.iter().any(|refusal| {
            refusal.bthread == bthread && refusal.sync >= self.since && refusal.reason.voids_block()
        })
    }
}

impl Outbox {
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
        let mut blocks = BTreeMap::new();
        for (place, bid) in bids.iter_mut().enumerate().filter(|(_, bid)| !bid.block.is_none()) {
            let statement =
                self.continued(place, bid).unwrap_or_else(|| Statement::new(bid.sync, self.epoch + 1));
            bid.block_since = statement.since;
            blocks.insert(bid.bthread.clone(), statement);
        }
        if bids != self.bids {
            (self.bids, self.blocks) = (bids, blocks);
            self.renew_content();
        }
    }

    /// The statement of a block that goes on with this bid: it blocks what it blocked in the content before, or less.
    ///
    /// The home keeps such a block whichever of the two contents it has. That a b-thread has moved on can be passed
    /// over only if the home has taken in the block before that, for what is still on its way may be a refusal.
    fn continued(&self, place: usize, bid: &RemoteBid) -> Option<Statement> {
        let before = self.bids.iter().find(|before| before.bthread == bid.bthread)?;
        let statement = *self.blocks.get(&bid.bthread)?;
        if before.on_loss != bid.on_loss || !bid.block.is_within(&before.block) || !bid.is_within_quota(place)
        {
            return None;
        }
        if before.sync == bid.sync {
            return Some(statement);
        }
        self.upheld_by(statement, &bid.bthread).then_some(Statement {
            sync: bid.sync,
            entered: self.epoch + 1,
            ..statement
        })
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

    /// The requests of `bthread` at its synchronisation point `sync` may have occurred elsewhere: they are not made
    /// here.
    pub(crate) fn leave_unknown(&mut self, bthread: &str, sync: u64) {
        self.unknown.insert(bthread.into(), sync);
    }

    fn renew_content(&mut self) {
        self.epoch += 1;
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
        let mut refused = ack.refused;
        // A home has a say about what is asked of it, and nothing else.
        refused.retain(|refusal| {
            self.bids.iter().any(|bid| bid.bthread == refusal.bthread && refusal.sync <= bid.sync)
        });
        let before = std::mem::replace(&mut self.refused, refused);
        for bid in self.bids.iter().filter(|bid| bid.on_loss == OnLoss::Hold) {
            let Some(statement) = self.blocks.get_mut(&bid.bthread) else { continue };
            if statement.is_refused(&bid.bthread, &self.refused) {
                statement.durable = None;
            } else if statement.entered <= ack.epoch {
                statement.durable = Some(statement.sync);
            }
        }
        self.refused.iter().filter(|refusal| !before.contains(refusal)).cloned().collect()
    }

    /// The home's sure hold on the block of `bthread` at its synchronisation point `sync`; none if it is not known to
    /// have taken the block in. Counts 0.9 lease from sending (G3).
    pub(crate) fn upheld(&self, bthread: &str, sync: u64, lease: Duration) -> Option<Upheld> {
        let statement = self.blocks.get(bthread).filter(|statement| statement.sync == sync)?;
        self.upheld_by(*statement, bthread).then(|| match statement.durable {
            Some(point) => Upheld { until: Duration::MAX, acknowledged: point == sync },
            None => Upheld {
                until: self.acked_sent_at + lease * 9 / 10,
                acknowledged: self.acked_epoch >= statement.entered,
            },
        })
    }

    /// Whether the home has taken in any block that still stands.
    #[cfg(test)]
    pub(crate) fn upholds_any(&self) -> bool {
        self.blocks.iter().any(|(bthread, statement)| self.upheld_by(*statement, bthread))
    }

    /// Whether the home has taken in a block.
    fn upheld_by(&self, statement: Statement, bthread: &str) -> bool {
        (statement.durable.is_some() || self.acked_epoch >= statement.held_since)
            && !statement.is_refused(bthread, &self.refused)
    }

    /// The bids to send a copy of now, if one is due. Each renewal is repeated every tenth of the lease until it is
    /// acknowledged; the next one follows a third of the lease after it was sent.
    pub(crate) fn take_due(&mut self, now: Duration, lease: Duration) -> Option<Vec<RemoteBid>> {
        self.next_deadline(lease).filter(|due| now >= *due)?;
        self.sent_at = Some(now);
        Some(self.bids.clone())
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
