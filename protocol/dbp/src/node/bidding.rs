//! Stating to other homes what the b-threads bid for their events.

use std::collections::{BTreeMap, BTreeSet};

use skein_bp::{Bid, Event, EventSet};

use crate::facts::Unroutable;
use crate::held_blocks::Block;
use crate::node::{Home, Node, NodeError, confirmation};
use crate::{NodeName, OnLoss, RemoteBid, Roster};

/// What one b-thread's bid means beyond this node.
struct BidAbroad {
    bthread: String,
    sync: u64,
    /// Its requests at other homes.
    requests: BTreeMap<NodeName, Vec<Event>>,
    /// Whether it requests something here too.
    requests_here: bool,
    /// The name of an event that it requests in vain, because no member is its home.
    unroutable: Option<String>,
    block: EventSet,
    /// The other homes that its block concerns.
    blocked_homes: Vec<NodeName>,
    priority: Option<i32>,
    on_loss: OnLoss,
    /// Whether its holder is, or was, or wants to be told that the block holds.
    is_watched: bool,
    awaits_confirmation: bool,
}

impl Node {
    /// States to each other home what the b-threads now bid for its events.
    pub(super) fn state_bids(&mut self) -> Result<(), NodeError> {
        let revision = self.program.revision();
        if self.seen_revision.replace(revision) == Some(revision) {
            return Ok(());
        }
        self.stalls_due = true;
        let mut outcome = Ok(());
        let mut by_home: BTreeMap<NodeName, Vec<RemoteBid>> = BTreeMap::new();
        let mut stated = BTreeMap::new();
        for bid in self.bids_abroad() {
            self.report_unroutable(&bid);
            outcome = outcome.and(self.check_one_home(&bid));
            if bid.is_watched {
                stated.insert(bid.bthread.clone(), bid.sync);
                self.held.state(&bid.bthread, bid.sync, bid.held_block());
            }
            for (home, remote) in bid.into_remote_bids() {
                by_home.entry(home).or_default().push(remote);
            }
        }
        self.held.retain(&stated);
        for (home, outbox) in &mut self.outboxes {
            outbox.state(by_home.remove(home).unwrap_or_default());
        }
        outcome
    }

    /// The bids that mean something beyond this node; most do not.
    fn bids_abroad(&self) -> Vec<BidAbroad> {
        let bids = self.program.bids().filter(|(_, _, sync)| *sync > 0);
        bids.filter_map(|(bthread, bid, sync)| self.bid_abroad(bthread, bid, sync)).collect()
    }

    fn bid_abroad(&self, bthread: &str, bid: &Bid, sync: u64) -> Option<BidAbroad> {
        let mut requests: BTreeMap<NodeName, Vec<Event>> = BTreeMap::new();
        let (mut requests_here, mut unroutable) = (false, None);
        for event in bid.requests() {
            match self.home_of(event) {
                Home::Local => {}
                Home::Here => requests_here = true,
                Home::Elsewhere(home) => requests.entry(home).or_default().push(event.clone()),
                Home::Unroutable => unroutable = Some(event.name().into()),
            }
        }
        let blocked_homes = self.homes_concerned(bid.blocks());
        // In a fleet of one no other home is concerned; who waits to hear so hears it all the same.
        let awaits_confirmation =
            !bid.blocks().is_none() && bid.waits().contains(&confirmation(&self.config.name, bthread, sync));
        // The homes that it concerns may be out of the roster, and come back.
        let is_relied_on = self.held.is_relied_on(bthread, bid.blocks());
        let is_watched = !blocked_homes.is_empty() || awaits_confirmation || is_relied_on;
        if requests.is_empty() && unroutable.is_none() && !is_watched {
            return None;
        }
        Some(BidAbroad {
            bthread: bthread.into(),
            sync,
            requests,
            requests_here,
            unroutable,
            block: bid.blocks().clone(),
            blocked_homes,
            priority: bid.given_priority(),
            on_loss: if bid.holds_when_lost() { OnLoss::Hold } else { OnLoss::Release },
            is_watched,
            awaits_confirmation,
        })
    }

    /// The other homes whose events a set may hold.
    fn homes_concerned(&self, set: &EventSet) -> Vec<NodeName> {
        if set.is_none() {
            return Vec::new();
        }
        let roster = self.joint.as_ref().map(|joint| &joint.roster);
        let concerns = |home: &NodeName| {
            set.could_match_home(home.as_str())
                || roster.is_some_and(|roster| {
                    roster.coordinator == *home && set.may_overlap(&Roster::joint_events())
                })
        };
        let member = |home: &NodeName| roster.is_none_or(|roster| roster.members.contains(home));
        self.peers.names().filter(|home| member(home) && concerns(home)).cloned().collect()
    }

    /// Tells once of a request that can go nowhere.
    fn report_unroutable(&mut self, bid: &BidAbroad) {
        let Some(event) = &bid.unroutable else { return };
        if self.unroutable.insert(bid.bthread.clone(), bid.sync) != Some(bid.sync) {
            self.fact(Unroutable { event: event.as_str().into(), bthread: bid.bthread.as_str().into() });
        }
    }

    /// One synchronisation point requests at one home only; a breach is reported once.
    fn check_one_home(&mut self, bid: &BidAbroad) -> Result<(), NodeError> {
        let here = bid.requests_here.then_some(&self.config.name);
        let homes: BTreeSet<String> = bid.requests.keys().chain(here).map(NodeName::to_string).collect();
        if homes.len() < 2 || self.two_homed.insert(bid.bthread.clone(), bid.sync) == Some(bid.sync) {
            return Ok(());
        }
        let (node, bthread) = (self.config.name.clone(), bid.bthread.clone());
        Err(NodeError::TwoHomes { node, bthread, homes: homes.into_iter().collect() })
    }
}

impl BidAbroad {
    fn held_block(&self) -> Block {
        Block {
            set: self.block.clone(),
            on_loss: self.on_loss,
            homes: self.blocked_homes.clone(),
            is_awaited: self.awaits_confirmation,
        }
    }

    /// The bid as each home it concerns is to know it.
    fn into_remote_bids(mut self) -> Vec<(NodeName, RemoteBid)> {
        let homes: BTreeSet<NodeName> = self.requests.keys().chain(&self.blocked_homes).cloned().collect();
        let remote_bid = |home: NodeName| {
            let blocks = self.blocked_homes.contains(&home);
            let bid = RemoteBid {
                bthread: self.bthread.clone(),
                sync: self.sync,
                requests: self.requests.remove(&home).unwrap_or_default(),
                block: if blocks { self.block.clone() } else { EventSet::None },
                block_since: self.sync,
                priority: self.priority,
                on_loss: if blocks { self.on_loss } else { OnLoss::Release },
            };
            (home, bid)
        };
        homes.into_iter().map(remote_bid).collect()
    }
}
