//! Where a node stands, for a verifier: all that what it will do depends on, but times.

use std::time::Duration;

use crate::node::Node;
use crate::verify::row::{Family, Part, Row};
use crate::{BidRecord, NodeName};

impl Node {
    /// Writes where the node stands. Numbers that only grow are written as such, so that they can be counted anew.
    pub(crate) fn write_standing(&self, row: &mut Row<'_>) {
        let (own, life) = (&self.config.name, self.config.incarnation);
        let sync = |bthread: &str| Family::Sync(own.clone(), life, bthread.into());
        row.part(Part::Program(Box::new(self.program.clone())));
        for (bthread, _, at) in self.program.bids() {
            row.number(sync(bthread), at);
        }
        row.plain(self.config.incarnation);
        row.flag(self.guarding);
        for (_, peer) in self.peers.iter() {
            row.flag(peer.alive);
            row.optional(peer.incarnation);
        }
        for reported in [&self.unroutable, &self.two_homed] {
            row.list(reported, |row, (bthread, at)| {
                row.text(bthread);
                row.number(sync(bthread), *at);
            });
        }
        row.part(Part::Stalls(self.stalls.0.clone()));
        row.list(&self.held.0, |row, (bthread, held)| {
            row.text(bthread);
            row.number(sync(bthread), held.sync);
            row.part(Part::Homes(held.block.homes.clone()));
            row.plain(held.standing as u64);
        });
        self.write_outboxes(row);
        self.write_table(row);
        for (home, stream) in &self.streams {
            row.flag(stream.has_begun());
            row.number(Family::Seq(home.clone(), stream.incarnation().unwrap_or(0)), stream.applied());
        }
        row.number(Family::Seq(own.clone(), life), self.history.latest_seq());
    }

    fn write_outboxes(&self, row: &mut Row<'_>) {
        let (own, life) = (&self.config.name, self.config.incarnation);
        for (home, outbox) in &self.outboxes {
            let epoch = || Family::Epoch(own.clone(), life, home.clone());
            let sync = |bthread: &str| Family::Sync(own.clone(), life, bthread.into());
            row.optional(outbox.home_incarnation);
            row.number(epoch(), outbox.epoch);
            row.number(epoch(), outbox.acked_epoch);
            row.flag(self.is_sure_of(home));
            row.list(&outbox.bids, |row, bid| row.bid(own, life, bid));
            row.list(&outbox.blocks, |row, (bthread, statement)| {
                row.text(bthread);
                row.number(sync(bthread), statement.sync);
                row.number(sync(bthread), statement.since);
                row.number(epoch(), statement.entered);
                row.number(epoch(), statement.held_since);
                row.number(sync(bthread), statement.durable.unwrap_or(0));
            });
            row.list(&outbox.unknown, |row, (bthread, at)| {
                row.text(bthread);
                row.number(sync(bthread), *at);
            });
            row.list(&outbox.refused, |row, refusal| row.refusal(own, life, refusal));
        }
    }

    fn write_table(&self, row: &mut Row<'_>) {
        row.list(&self.table.bidders, |row, (node, bidder)| {
            let sync = |bthread: &str| Family::Sync(node.clone(), bidder.incarnation, bthread.into());
            row.text(node.as_str());
            row.plain(bidder.incarnation);
            row.number(
                Family::Epoch(node.clone(), bidder.incarnation, self.config.name.clone()),
                bidder.epoch,
            );
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
    }

    /// Whether what `home` has acknowledged surely holds there now.
    pub(crate) fn is_sure_of(&self, home: &NodeName) -> bool {
        self.outboxes
            .get(home)
            .is_some_and(|outbox| self.now < outbox.acked_sent_at + self.config.lease * 9 / 10)
    }

    /// Whether `node` counts as alive here.
    pub(crate) fn hears(&self, node: &NodeName) -> bool {
        self.peers.iter().any(|(name, peer)| name == node && peer.alive)
    }

    /// Whether this copy of a record, or a newer record, has been taken in.
    pub(crate) fn has_taken_in(&self, record: &BidRecord) -> bool {
        self.table.bidders.get(&record.node).is_some_and(|bidder| {
            let taken = (bidder.incarnation, bidder.epoch, bidder.sent_at);
            taken >= (record.incarnation, record.epoch, record.sent_at)
        })
    }

    /// Whether `guarded` events are kept back since the start.
    pub(crate) fn is_guarding(&self) -> bool {
        self.guarding
    }

    /// The occurrences after number `seq` that this node, as their home, still has.
    pub(crate) fn occurred_since(&self, seq: u64) -> Vec<skein_bp::Event> {
        let kept = self.history.after(seq).into_iter().flatten();
        kept.map(|occurrence| occurrence.event.clone()).collect()
    }

    /// The number of the latest own occurrence.
    pub(crate) fn latest_seq(&self) -> u64 {
        self.history.latest_seq()
    }

    /// Lets so much time pass that `home` is to be sent another copy, while it surely keeps what it has acknowledged.
    pub(crate) fn let_renewal_fall_due(&mut self, home: &NodeName) {
        if let Some(outbox) = self.outboxes.get_mut(home) {
            outbox.acked_sent_at = outbox.acked_sent_at.min(self.now - self.config.lease / 2);
            outbox.sent_at = None;
        }
    }

    /// Lets the time pass in which `home` surely keeps what this node has stated there; a fresh copy is due.
    pub(crate) fn let_hold_lapse(&mut self, home: &NodeName) {
        if let Some(outbox) = self.outboxes.get_mut(home) {
            outbox.acked_sent_at = Duration::ZERO;
            outbox.sent_at = None;
        }
    }

    /// Whether bids of `node` stand here that its lease keeps.
    pub(crate) fn holds_bids_of(&self, node: &NodeName) -> bool {
        self.table.bidders.get(node).is_some_and(|bidder| bidder.live && !bidder.bids.is_empty())
    }

    /// Lets the lease pass of what `node` has stated here.
    pub(crate) fn let_bids_lapse(&mut self, node: &NodeName) {
        if let Some(bidder) = self.table.bidders.get_mut(node) {
            bidder.heard_at = Duration::ZERO;
        }
    }

    /// Lets the lease pass of what `node` has stated here, and of its last sign of life.
    pub(crate) fn let_lease_lapse(&mut self, node: &NodeName) {
        self.let_bids_lapse(node);
        self.peers.silence(node);
    }

    /// Holds the clock of its b-threads at the start of the run, so that deadlines pass only where they are let.
    pub(crate) fn hold_clock(&mut self) {
        self.held_clock = Some(Duration::ZERO);
    }

    /// The b-threads with an open deadline.
    pub(crate) fn deadlines(&self) -> impl Iterator<Item = &str> {
        self.program.bids().filter(|(_, bid, _)| bid.given_deadline().is_some()).map(|(name, ..)| name)
    }

    /// Lets the deadline of a b-thread pass.
    pub(crate) fn let_deadline_pass(&mut self, bthread: &str) {
        let now = self.program_now();
        self.program.fire_deadline(bthread, now);
    }

    /// Lets the longest lease pass since the start.
    pub(crate) fn let_guard_end(&mut self) {
        self.started = Some(Duration::ZERO);
    }
}

/// What runs that are held against the verifier's model ask.
#[cfg(test)]
impl Node {
    /// Takes leases by which nothing is held to run on: nobody renews them, and nothing ends with them.
    pub(crate) fn overlook_idle_leases(&mut self) {
        for outbox in self.outboxes.values_mut().filter(|outbox| !outbox.upholds_any()) {
            outbox.acked_sent_at = self.now;
        }
        let idle = |bidder: &&mut crate::table::Bidder| bidder.bids.is_empty() && bidder.released.is_empty();
        self.table.bidders.values_mut().filter(idle).for_each(|bidder| bidder.live = true);
    }

    /// Whether a block holds at `home` as long as this node is sure of it.
    pub(crate) fn relies_on(&self, home: &NodeName) -> bool {
        self.outboxes.get(home).is_some_and(|outbox| outbox.upholds_any())
    }

    /// Whether the lease of what `node` bids here runs.
    pub(crate) fn keeps_lease_of(&self, node: &NodeName) -> bool {
        self.table.bidders.get(node).is_some_and(|bidder| bidder.live)
    }

    /// The epoch of the bids of which this node sends copies to `home`.
    pub(crate) fn states(&self, home: &NodeName) -> Option<u64> {
        let outbox = self.outboxes.get(home)?;
        outbox.next_deadline(self.config.lease).map(|_| outbox.epoch)
    }

    /// The number of the last occurrence of `home` that this node was told of.
    pub(crate) fn applied(&self, home: &NodeName) -> u64 {
        self.streams.get(home).map_or(0, crate::stream::Stream::applied)
    }
}
