//! The standing of the guest, for a verifier.

use std::time::Duration;

use crate::config::NodeConfig;
use crate::guest::Guest;
use crate::name::NodeName;
use crate::verify::row::{Family, Part, Row};

impl Guest {
    pub(crate) fn write_standing(&self, row: &mut Row<'_>, now: Duration, config: &NodeConfig) {
        let (own, life) = (&config.name, config.incarnation);
        let sync = |bthread: &str| Family::Sync(own.clone(), life, bthread.into());
        let points = |row: &mut Row<'_>, reported: &std::collections::BTreeMap<String, u64>| {
            row.list(reported, |row, (bthread, at)| {
                row.text(bthread);
                row.number(sync(bthread), *at);
            });
        };
        points(row, &self.unroutable);
        points(row, &self.two_homed);
        row.list(&self.held.0, |row, (bthread, held)| {
            row.text(bthread);
            row.number(sync(bthread), held.sync);
            row.part(Part::Homes(held.block.homes.clone()));
            row.plain(held.standing as u64);
        });
        for (home, outbox) in &self.outboxes {
            let epoch = || Family::Epoch(own.clone(), life, home.clone());
            row.optional(outbox.home_incarnation);
            row.number(epoch(), outbox.epoch);
            row.number(epoch(), outbox.acked_epoch);
            row.flag(self.is_sure_of(home, now, config.lease));
            row.list(&outbox.bids, |row, bid| row.bid(own, life, bid));
            row.list(&outbox.blocks, |row, (bthread, statement)| {
                row.text(bthread);
                row.number(sync(bthread), statement.sync);
                row.number(sync(bthread), statement.since);
                row.number(epoch(), statement.entered);
                row.number(epoch(), statement.held_since);
                row.number(sync(bthread), statement.durable.unwrap_or(0));
            });
            points(row, &outbox.unknown);
            row.list(&outbox.refused, |row, refusal| row.refusal(own, life, refusal));
        }
    }

    /// Whether what `home` has acknowledged surely holds there now.
    pub(crate) fn is_sure_of(&self, home: &NodeName, now: Duration, lease: Duration) -> bool {
        self.outboxes.get(home).is_some_and(|outbox| now < outbox.acked_sent_at + lease * 9 / 10)
    }

    /// Lets another copy for `home` fall due, the last acknowledged one having been sent no later than `sent_at`.
    pub(crate) fn let_copy_fall_due(&mut self, home: &NodeName, sent_at: Duration) {
        if let Some(outbox) = self.outboxes.get_mut(home) {
            outbox.acked_sent_at = outbox.acked_sent_at.min(sent_at);
            outbox.sent_at = None;
        }
    }
}

/// Questions of runs that are held against the verifier's model.
#[cfg(test)]
impl Guest {
    /// Lets leases by which nothing is held run on, since nobody renews them, and nothing ends with them.
    pub(crate) fn overlook_idle_leases(&mut self, now: Duration) {
        for outbox in self.outboxes.values_mut().filter(|outbox| !outbox.upholds_any()) {
            outbox.acked_sent_at = now;
        }
    }

    /// Whether a block holds at `home` as long as this node is sure of it.
    pub(crate) fn relies_on(&self, home: &NodeName) -> bool {
        self.outboxes.get(home).is_some_and(|outbox| outbox.upholds_any())
    }

    /// The epoch of the bids of which this node sends copies to `home`.
    pub(crate) fn states(&self, home: &NodeName, lease: Duration) -> Option<u64> {
        let outbox = self.outboxes.get(home)?;
        outbox.next_deadline(lease).map(|_| outbox.epoch)
    }
}
