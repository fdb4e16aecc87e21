//! The standing of a node, for a verifier: all that its further run depends on, but times.

use std::time::Duration;

use crate::name::NodeName;
use crate::node::Node;
use crate::verify::row::{Family, Part, Row};

impl Node {
    /// Writes where the node stands. Numbers that only grow are written as such, so that they can be counted anew.
    pub(crate) fn write_standing(&self, row: &mut Row<'_>) {
        let config = &self.config;
        row.part(Part::Program(Box::new(self.run.program.clone())));
        for (bthread, _, at) in self.run.program.bids() {
            row.number(Family::Sync(config.name.clone(), config.incarnation, bthread.into()), at);
        }
        row.plain(config.incarnation);
        self.home.write_standing(row, config);
        self.guest.write_standing(row, self.clock.now(), config);
        self.channel.write_standing(row);
    }

    /// The synchronisation point at which a b-thread of this node is.
    pub(crate) fn sync_of(&self, bthread: &str) -> Option<u64> {
        self.run.sync_of(bthread)
    }

    /// Whether the bids that `home` has acknowledged surely holds there now.
    pub(crate) fn is_sure_of(&self, home: &NodeName) -> bool {
        self.guest.is_sure_of(home, self.clock.now(), self.config.lease)
    }

    /// The number of the latest own occurrence.
    pub(crate) fn latest_seq(&self) -> u64 {
        self.home.history.latest_seq()
    }

    /// Lets so much time pass that `home` is to be sent another copy, while it surely keeps what it has acknowledged.
    pub(crate) fn let_renewal_fall_due(&mut self, home: &NodeName) {
        self.guest.let_copy_fall_due(home, self.clock.now() - self.config.lease / 2);
    }

    /// Lets the time pass in which `home` surely keeps what this node has stated there; a fresh copy is due.
    pub(crate) fn let_hold_lapse(&mut self, home: &NodeName) {
        self.guest.let_copy_fall_due(home, Duration::ZERO);
    }

    /// Lets the lease pass of what `node` has stated here, and of its last sign of life.
    pub(crate) fn let_lease_lapse(&mut self, node: &NodeName) {
        self.home.let_bids_lapse(node);
        self.channel.peers.silence(node);
    }

    /// Holds the clock of its b-threads at the start of the run, so that deadlines pass only where they are let.
    pub(crate) fn hold_clock(&mut self) {
        self.clock.held = Some(Duration::ZERO);
    }

    /// The b-threads with an open deadline.
    pub(crate) fn deadlines(&self) -> impl Iterator<Item = &str> {
        self.run.program.bids().filter(|(_, bid, _)| bid.given_deadline().is_some()).map(|(name, ..)| name)
    }

    /// Lets the deadline of a b-thread pass.
    pub(crate) fn let_deadline_pass(&mut self, bthread: &str) {
        let now = self.clock.of_bthreads();
        self.run.program.fire_deadline(bthread, now);
    }

    /// Lets the longest lease pass since the start.
    pub(crate) fn let_guard_end(&mut self) {
        self.clock.started = Some(Duration::ZERO);
    }
}

/// Questions of runs that are held against the verifier's model.
#[cfg(test)]
impl Node {
    /// Lets leases by which nothing is held run on, since nobody renews them, and nothing ends with them.
    pub(crate) fn overlook_idle_leases(&mut self) {
        self.guest.overlook_idle_leases(self.clock.now());
        self.home.overlook_idle_leases();
    }

    /// The epoch of the bids of which this node sends copies to `home`.
    pub(crate) fn states(&self, home: &NodeName) -> Option<u64> {
        self.guest.states(home, self.config.lease)
    }
}
