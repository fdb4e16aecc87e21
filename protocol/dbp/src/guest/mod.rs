//! A node as a guest at other homes: its bids there, and how sure its blocks are (G3, G4).

mod bidding;
pub(crate) mod held_blocks;
mod outbox;
mod standing;

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::Bid;

use crate::channel::Channel;
use crate::config::NodeConfig;
use crate::error::NodeError;
use crate::facts::{Refused, Unknown, Unroutable};
use crate::guest::bidding::BidAbroad;
use crate::guest::held_blocks::HeldBlocks;
use crate::guest::outbox::{Outbox, Upheld};
use crate::joint::roster::Roster;
use crate::message::{BidAck, BidRecord, Message, RemoteBid};
use crate::name::NodeName;
use crate::routes::Routes;
use crate::run::{BoardChange, Delivery, Run};

#[derive(Clone, Debug, Default)]
pub(crate) struct Guest {
    /// The bids at each other home.
    outboxes: BTreeMap<NodeName, Outbox>,
    /// The blocks there that b-threads rely on.
    held: HeldBlocks,
    /// The revision of the program whose bids are stated; none if they are to be stated anew.
    stated: Option<u64>,
    /// For b-threads that request an event without a home, and for those that request at two homes, the synchronisation
    /// point at which that was reported.
    unroutable: BTreeMap<String, u64>,
    two_homed: BTreeMap<String, u64>,
}

impl Guest {
    pub(crate) fn new(config: &NodeConfig) -> Self {
        Self {
            outboxes: config.roster.iter().map(|home| (home.clone(), Outbox::default())).collect(),
            ..Self::default()
        }
    }

    /// The homes of events have changed, so all bids are stated anew.
    pub(crate) fn restate(&mut self) {
        self.stated = None;
    }

    /// States to each other home what the b-threads now bid for its events.
    pub(crate) fn state_bids(
        &mut self,
        node: &NodeName,
        routes: &Routes<'_>,
        run: &mut Run,
    ) -> Result<(), NodeError> {
        let revision = run.program.revision();
        if self.stated.replace(revision) == Some(revision) {
            return Ok(());
        }
        run.bids_changed = true;
        let mut outcome = Ok(());
        let mut by_home: BTreeMap<NodeName, Vec<RemoteBid>> = BTreeMap::new();
        let mut watched = BTreeMap::new();
        for bid in BidAbroad::all(run, routes, &self.held) {
            self.report_unroutable(&bid, run);
            outcome = outcome.and(self.check_one_home(node, &bid));
            if bid.is_watched {
                watched.insert(bid.bthread.clone(), bid.sync);
                self.held.state(&bid.bthread, bid.sync, bid.held_block());
            }
            for (home, remote) in bid.into_remote_bids() {
                by_home.entry(home).or_default().push(remote);
            }
        }
        self.held.retain(&watched);
        for told in [&mut self.unroutable, &mut self.two_homed] {
            told.retain(|bthread, _| run.program.bid(bthread).is_some());
        }
        for (home, outbox) in &mut self.outboxes {
            outbox.state(by_home.remove(home).unwrap_or_default());
        }
        outcome
    }

    /// Tells once of a request that can go nowhere.
    fn report_unroutable(&mut self, bid: &BidAbroad, run: &mut Run) {
        let Some(event) = &bid.unroutable else { return };
        if self.unroutable.insert(bid.bthread.clone(), bid.sync) != Some(bid.sync) {
            run.fact(Unroutable { event: event.as_str().into(), bthread: bid.bthread.as_str().into() });
        }
    }

    /// One synchronisation point requests at one home only; a breach is reported once.
    fn check_one_home(&mut self, node: &NodeName, bid: &BidAbroad) -> Result<(), NodeError> {
        let homes = bid.homes_asked(node);
        if homes.len() < 2 || self.two_homed.insert(bid.bthread.clone(), bid.sync) == Some(bid.sync) {
            return Ok(());
        }
        let homes = homes.into_iter().map(NodeName::to_string).collect();
        Err(NodeError::TwoHomes { node: node.clone(), bthread: bid.bthread.clone(), homes })
    }

    /// Addresses requests to the life of `home` that is heard from now on, and tells of those that its former life may
    /// have served or not.
    pub(crate) fn address(&mut self, home: &NodeName, incarnation: u64, run: &mut Run) {
        let Some(outbox) = self.outboxes.get_mut(home) else { return };
        if outbox.home_incarnation == Some(incarnation) {
            return;
        }
        for bid in outbox.home_restarted(incarnation) {
            for event in &bid.requests {
                tell_unknown(event.name(), &bid.bthread, home, run);
            }
        }
    }

    /// Joint events are decided by `coordinator` from now on, or here. The requests at the `former` coordinator may
    /// have been decided there or not: they are not asked for again.
    pub(crate) fn leave_unknown(&mut self, former: &NodeName, coordinator: Option<&NodeName>, run: &mut Run) {
        let asked = self.outboxes.get(former).map(Outbox::asked).unwrap_or_default();
        for (bthread, sync) in asked {
            let stays = run.sync_of(&bthread) == Some(sync);
            let requests = run.program.bid(&bthread).filter(|_| stays).map_or(&[][..], Bid::requests);
            let Some(event) = requests.iter().find(|event| Roster::is_joint(event)).cloned() else {
                continue;
            };
            match coordinator.and_then(|coordinator| self.outboxes.get_mut(coordinator)) {
                Some(outbox) => outbox.leave_unknown(&bthread, sync),
                // From now on it would be decided here.
                None => run.change_board(BoardChange::Withdrawn(bthread.as_str().into())),
            }
            tell_unknown(event.name(), &bthread, former, run);
        }
    }

    /// A home has taken in a record, and tells what it does not honour.
    pub(crate) fn take_in_ack(&mut self, now: Duration, ack: BidAck, run: &mut Run) {
        let home = ack.home.clone();
        let refused = self.outboxes.get_mut(&home).map(|outbox| outbox.acknowledged(now, ack));
        for refusal in refused.into_iter().flatten() {
            let bthread = refusal.bthread.as_str().into();
            run.fact_because_of(&home, Refused { bthread, home: home.clone(), reason: refusal.reason });
        }
    }

    /// Tells the holders of blocks elsewhere which are sure from now on, and which are no more.
    pub(crate) fn check_blocks(&mut self, now: Duration, lease: Duration, run: &mut Run) {
        let upheld =
            |home: &NodeName, bthread: &str, sync| upheld(&self.outboxes, home, bthread, sync, lease);
        run.news.extend(self.held.check(now, upheld).into_iter().map(Delivery::Block));
    }

    /// The homes that the present block of `bthread` concerns, each with whether it surely keeps the block now.
    pub(crate) fn kept_by(
        &self,
        bthread: &str,
        now: Duration,
        lease: Duration,
    ) -> impl Iterator<Item = (&NodeName, bool)> {
        let held = self.held.get(bthread);
        held.into_iter().flat_map(|(sync, homes)| homes.iter().map(move |home| (home, sync))).map(
            move |(home, sync)| {
                let upheld = upheld(&self.outboxes, home, bthread, sync, lease);
                (home, upheld.is_some_and(|upheld| now < upheld.until))
            },
        )
    }

    /// Sends each home the copy of its record that is due. `term` is the term of joint events, and `decided` how many
    /// of its decisions have been applied.
    pub(crate) fn send_due(
        &mut self,
        now: Duration,
        config: &NodeConfig,
        (term, decided): (u64, u64),
        channel: &mut Channel,
    ) {
        for (home, outbox) in &mut self.outboxes {
            let Some(copy) = outbox.take_due(now, config.lease) else { continue };
            let record = BidRecord {
                node: config.name.clone(),
                incarnation: config.incarnation,
                home: home.clone(),
                home_incarnation: outbox.home_incarnation,
                epoch: outbox.epoch,
                sent_at: now,
                applied: channel.applied(home),
                term,
                decided,
                lease_ms: config.lease_ms(),
                bids: copy,
            };
            channel.send(home, Message::Bid(record));
        }
    }

    /// When a copy is due, or a block that its holder relies on lapses.
    pub(crate) fn next_deadline(&self, lease: Duration) -> Option<Duration> {
        let copies = self.outboxes.values().filter_map(|outbox| outbox.next_deadline(lease));
        let lapse =
            self.held.next_deadline(|home, bthread, sync| upheld(&self.outboxes, home, bthread, sync, lease));
        copies.chain(lapse).min()
    }
}

/// The sure hold of `home` on the block of `bthread` at its synchronisation point `sync`.
fn upheld(
    outboxes: &BTreeMap<NodeName, Outbox>,
    home: &NodeName,
    bthread: &str,
    sync: u64,
    lease: Duration,
) -> Option<Upheld> {
    outboxes.get(home)?.upheld(bthread, sync, lease)
}

/// Tells that a request at `home` may have been served or not, and is not made again (G4).
fn tell_unknown(event: &str, bthread: &str, home: &NodeName, run: &mut Run) {
    run.fact(Unknown { event: event.into(), bthread: bthread.into(), home: home.clone() });
}
