//! Bids that mean something beyond their node.

use std::collections::{BTreeMap, BTreeSet};

use skein_bp::{Bid, Event, EventSet};

use crate::guest::held_blocks::{Block, HeldBlocks};
use crate::message::{OnLoss, RemoteBid};
use crate::name::NodeName;
use crate::routes::{Route, Routes};
use crate::run::Run;

/// One b-thread's bid, as it concerns other homes.
pub(super) struct BidAbroad {
    pub(super) bthread: String,
    pub(super) sync: u64,
    /// Its requests at other homes.
    requests: BTreeMap<NodeName, Vec<Event>>,
    /// Whether it requests something here too.
    requests_here: bool,
    /// The name of an event that it requests in vain, because no member is its home.
    pub(super) unroutable: Option<String>,
    block: EventSet,
    /// The other homes that its block concerns.
    blocked_homes: Vec<NodeName>,
    priority: Option<i32>,
    on_loss: OnLoss,
    /// Whether its holder is, or was, or wants to be told that the block holds.
    pub(super) is_watched: bool,
    awaits_confirmation: bool,
}

impl BidAbroad {
    /// The bids that mean something beyond this node; most do not.
    pub(super) fn all(run: &Run, routes: &Routes<'_>, held: &HeldBlocks) -> Vec<Self> {
        let bids = run.program.bids().filter(|(_, _, sync)| *sync > 0);
        bids.filter_map(|(bthread, bid, sync)| Self::of(bthread, bid, sync, run, routes, held)).collect()
    }

    fn of(
        bthread: &str,
        bid: &Bid,
        sync: u64,
        run: &Run,
        routes: &Routes<'_>,
        held: &HeldBlocks,
    ) -> Option<Self> {
        let mut requests: BTreeMap<NodeName, Vec<Event>> = BTreeMap::new();
        let (mut requests_here, mut unroutable) = (false, None);
        for event in bid.requests() {
            match routes.of(event) {
                Route::Local => {}
                Route::Here => requests_here = true,
                Route::Elsewhere(home) => requests.entry(home).or_default().push(event.clone()),
                Route::Unroutable => unroutable = Some(event.name().into()),
            }
        }
        let blocked_homes = routes.concerned_by(bid.blocks());
        // In a fleet of one no other home is concerned; who waits to hear so hears it all the same.
        let awaits_confirmation =
            !bid.blocks().is_none() && bid.waits().contains(&run.confirmation(bthread, sync));
        // The homes that it concerns may be out of the roster, and come back.
        let is_relied_on = held.is_relied_on(bthread, bid.blocks());
        let is_watched = !blocked_homes.is_empty() || awaits_confirmation || is_relied_on;
        if requests.is_empty() && unroutable.is_none() && !is_watched {
            return None;
        }
        Some(Self {
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

    /// The homes at which it requests, this `node` among them.
    pub(super) fn homes_asked<'a>(&'a self, node: &'a NodeName) -> BTreeSet<&'a NodeName> {
        self.requests.keys().chain(self.requests_here.then_some(node)).collect()
    }

    pub(super) fn held_block(&self) -> Block {
        Block {
            set: self.block.clone(),
            on_loss: self.on_loss,
            homes: self.blocked_homes.clone(),
            is_awaited: self.awaits_confirmation,
        }
    }

    /// The bid as each home it concerns is to know it.
    pub(super) fn into_remote_bids(mut self) -> Vec<(NodeName, RemoteBid)> {
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
