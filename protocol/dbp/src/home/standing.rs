//! The standing of the home, for a verifier.

use std::time::Duration;

use skein_bp::Event;

use crate::config::NodeConfig;
use crate::home::Home;
use crate::message::BidRecord;
use crate::name::NodeName;
use crate::verify::row::{Family, Part, Row};

impl Home {
    pub(crate) fn write_standing(&self, row: &mut Row<'_>, config: &NodeConfig) {
        row.flag(self.guarding);
        row.part(Part::Stalls(self.stalls.0.clone()));
        row.list(&self.table.bidders, |row, (node, bidder)| {
            let sync = |bthread: &str| Family::Sync(node.clone(), bidder.incarnation, bthread.into());
            row.text(node.as_str());
            row.plain(bidder.incarnation);
            row.number(Family::Epoch(node.clone(), bidder.incarnation, config.name.clone()), bidder.epoch);
            row.flag(bidder.live);
            row.flag(bidder.knows_this_life);
            row.list(&bidder.bids, |row, (bthread, bid)| {
                row.text(bthread);
                row.number(sync(bthread), bid.sync);
                row.part(Part::Bid(bid.requests.clone(), bid.block.clone(), bid.priority));
                row.flag(bid.open);
                row.flag(bid.keep);
                row.flag(bid.orphaned);
            });
            row.list(&bidder.released, |row, bthread| row.text(bthread));
            row.list(&bidder.served, |row, (bthread, at)| {
                row.text(bthread);
                row.number(sync(bthread), *at);
            });
            row.list(&bidder.refused, |row, refusal| row.refusal(node, bidder.incarnation, refusal));
            row.list(&bidder.lifted, |row, (bthread, at)| {
                row.text(bthread);
                row.number(sync(bthread), *at);
            });
        });
        row.number(Family::Seq(config.name.clone(), config.incarnation), self.history.latest_seq());
    }

    /// Whether this copy of a record, or a newer record, has been taken in.
    pub(crate) fn has_taken_in(&self, record: &BidRecord) -> bool {
        self.table.bidders.get(&record.node).is_some_and(|bidder| {
            let taken = (bidder.incarnation, bidder.epoch, bidder.sent_at);
            taken >= (record.incarnation, record.epoch, record.sent_at)
        })
    }

    /// The occurrences after number `seq` that this home still has.
    pub(crate) fn occurred_since(&self, seq: u64) -> Vec<Event> {
        let kept = self.history.after(seq).into_iter().flatten();
        kept.map(|occurrence| occurrence.event.clone()).collect()
    }

    /// Whether bids of `node` stand here that its lease keeps.
    pub(crate) fn holds_bids_of(&self, node: &NodeName) -> bool {
        self.table.bidders.get(node).is_some_and(|bidder| bidder.live && !bidder.bids.is_empty())
    }

    /// Lets the lease pass of the bids of `node` here.
    pub(crate) fn let_bids_lapse(&mut self, node: &NodeName) {
        if let Some(bidder) = self.table.bidders.get_mut(node) {
            bidder.heard_at = Duration::ZERO;
        }
    }
}

/// Questions of runs that are held against the verifier's model.
#[cfg(test)]
impl Home {
    /// Lets leases by which nothing is held run on, since nobody renews them, and nothing ends with them.
    pub(crate) fn overlook_idle_leases(&mut self) {
        for bidder in self.table.bidders.values_mut() {
            bidder.live |= bidder.bids.is_empty() && bidder.released.is_empty();
        }
    }

    /// Whether the lease of the bids of `node` here runs.
    pub(crate) fn keeps_lease_of(&self, node: &NodeName) -> bool {
        self.table.bidders.get(node).is_some_and(|bidder| bidder.live)
    }
}
