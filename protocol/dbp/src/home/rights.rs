//! The rights of remote bids at a home: which requests and blocks it honours.

use std::ops::RangeInclusive;
use std::time::Duration;

use skein_bp::{Event, EventSet};

use crate::config::NodeConfig;
use crate::facts;
use crate::home::authority::Authority;
use crate::home::bidder::{Bidder, TakenBid};
use crate::message::{OnLoss, RefusalReason, RemoteBid};
#[cfg(feature = "mutants")]
use crate::mutant::Mutant;
use crate::name::NodeName;
use crate::rule::RULES;

#[derive(Clone, Debug)]
pub(super) struct Rights {
    /// The events that have their home here.
    home: EventSet,
    /// The home's own facts: nobody requests or blocks them from afar.
    facts: EventSet,
    /// Events that nobody requests or blocks from afar ...
    safety: EventSet,
    /// ... but for these, which may be requested.
    gateway: EventSet,
    /// An operator's orders to the node itself. Nobody blocks them from afar: a block must not outlast the order that
    /// ends it, nor keep a node in a term that is over.
    orders: EventSet,
    /// The home's events without all of these: they may be blocked from afar.
    blockable: EventSet,
    /// The grants for the rest.
    authority: Authority,
    /// The band of priorities.
    priority: RangeInclusive<i32>,
    longest_lease: Duration,
    /// Whether blocks may outlive their holders, since they are kept on disk.
    durable: bool,
    /// Whether the disk takes them.
    pub(super) store_works: bool,
    #[cfg(feature = "mutants")]
    pub(super) mutant: Option<Mutant>,
}

impl Rights {
    /// The rights at a home that decides on no events yet.
    pub(super) fn new(config: &NodeConfig) -> Self {
        Self {
            home: EventSet::None,
            facts: facts::all(&config.name),
            safety: config.safety.clone(),
            gateway: config.gateway.clone(),
            orders: EventSet::any_of(RULES.iter().map(|rule| config.name.event_name(rule.name))),
            blockable: EventSet::None,
            authority: config.authority.clone(),
            priority: config.remote_priority.clone(),
            longest_lease: config.longest_lease,
            durable: config.durable,
            store_works: true,
            #[cfg(feature = "mutants")]
            mutant: config.mutant,
        }
    }

    /// When the lease of a bidder runs out, on this home's clock.
    pub(super) fn lapses_at(&self, bidder: &Bidder) -> Duration {
        #[cfg(feature = "mutants")]
        match self.mutant {
            Some(Mutant::G3) => return bidder.heard_at + bidder.lease * 8 / 10,
            Some(Mutant::G5) => return Duration::MAX,
            _ => {}
        }
        bidder.heard_at + bidder.lease
    }

    /// From now on, these events have their home here.
    pub(super) fn set_home(&mut self, home: EventSet) {
        let never = EventSet::any_of([&self.facts, &self.safety, &self.gateway, &self.orders]);
        #[cfg(feature = "mutants")]
        let never = if self.mutant == Some(Mutant::G6) { self.facts.clone() } else { never };
        self.blockable = home.clone().and(never.not());
        self.home = home;
    }

    /// The part of a bid that is honoured, by its place in a record, and why not the rest; whether its block
    /// is kept already and `stays` as it is.
    pub(super) fn judge(
        &self,
        node: &NodeName,
        bid: &RemoteBid,
        place: usize,
        lease: Duration,
        stays: bool,
    ) -> (Option<TakenBid>, Vec<RefusalReason>) {
        if !bid.is_within_quota(place) {
            return (None, vec![RefusalReason::Quota]);
        }
        if lease > self.longest_lease {
            return (None, vec![RefusalReason::LeaseTooLong]);
        }
        let denial = |event: &Event| self.denial(node, &bid.bthread, event);
        #[cfg(feature = "mutants")]
        let denial = |event: &Event| {
            denial(event)
                .filter(|why| self.mutant != Some(Mutant::G7) || *why != RefusalReason::MayNotRequest)
        };
        let lapses = bid.on_loss == OnLoss::Hold && !(self.durable && (self.store_works || stays));
        let mut reasons: Vec<_> = bid.requests.iter().filter_map(denial).collect();
        // A b-thread blocks with one set what it wants to block at all homes together.
        let block = match self.authority.may_block(node, &bid.bthread, &bid.block.about(&self.home)) {
            true if lapses || bid.block.is_none() => EventSet::None,
            // Without what may not be blocked from afar.
            true => bid.block.clone().and(self.blockable.clone()),
            false => {
                reasons.push(RefusalReason::MayNotBlock);
                EventSet::None
            }
        };
        if lapses {
            reasons.push(RefusalReason::HoldUnsupported);
        }
        reasons.sort_unstable();
        reasons.dedup();
        let allowed = bid.requests.iter().filter(|event| denial(event).is_none());
        let requests: Vec<Event> = allowed.cloned().collect();
        let open = !requests.is_empty();
        let priority =
            bid.priority.map(|priority| priority.max(*self.priority.start()).min(*self.priority.end()));
        let keep = bid.on_loss == OnLoss::Hold && !block.is_none();
        let asked_block = bid.block.clone();
        let taken =
            TakenBid { sync: bid.sync, requests, block, asked_block, priority, open, keep, orphaned: false };
        (Some(taken), reasons)
    }

    /// Why `bthread` of `node` may not request `event` from afar, if so.
    fn denial(&self, node: &NodeName, bthread: &str, event: &Event) -> Option<RefusalReason> {
        if !self.home.contains(event) {
            Some(RefusalReason::NotHome)
        } else if self.facts.contains(event) {
            Some(RefusalReason::Reserved)
        } else if self.safety.contains(event) && !self.gateway.contains(event) {
            Some(RefusalReason::Safety)
        } else if !self.authority.may_request(node, bthread, event) {
            Some(RefusalReason::MayNotRequest)
        } else {
            None
        }
    }
}
