//! A home's table of remote bids, each of which stands in the program as a proxy b-thread.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use skein_bp::{Bid, Event, EventSet};

use crate::history::History;
#[cfg(feature = "mutants")]
use crate::mutant::Mutant;
use crate::{
    Authority, BidRecord, KeptBlock, NodeName, OnLoss, Refusal, RefusalReason, RemoteBid, Roster,
    ServedRequest,
};

/// What of a remote bid this home honours.
#[derive(Clone, Debug)]
pub(crate) struct Rights {
    /// The events that have their home here.
    pub(crate) home: EventSet,
    /// The home's own facts: nobody requests or blocks them from afar.
    pub(crate) facts: EventSet,
    /// Events that nobody requests or blocks from afar ...
    pub(crate) safety: EventSet,
    /// ... but for these, which may be requested.
    pub(crate) gateway: EventSet,
    /// An operator's orders to the node itself, which nobody blocks from afar.
    pub(crate) orders: EventSet,
    /// What may be blocked from afar: the home's events without all of these.
    pub(crate) blockable: EventSet,
    /// Who may do what of the rest.
    pub(crate) authority: Authority,
    /// The band of priorities.
    pub(crate) priority: RangeInclusive<i32>,
    /// The longest lease granted.
    pub(crate) longest_lease: Duration,
    /// Whether blocks may outlive their holders, since what must be kept is kept on disk.
    pub(crate) durable: bool,
    #[cfg(feature = "mutants")]
    pub(crate) mutant: Option<crate::Mutant>,
}

/// The change of a proxy: its new bid, or none if it goes.
pub(crate) type ProxyChange = (Arc<str>, Option<Bid>);

/// What has occurred at this home.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Past<'a> {
    pub(crate) history: &'a History,
    pub(crate) term: u64,
    /// The decisions of that term, if it makes them.
    pub(crate) decisions: Option<&'a History>,
}

/// What became of a record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TakenIn {
    /// It counts, and is acknowledged.
    Yes {
        /// How the proxies change.
        proxies: Vec<ProxyChange>,
        /// What is not honoured of it, and was not in the record before.
        denied: Vec<Refusal>,
    },
    /// It is older than what is known, or its sender has to catch up first: no answer.
    No,
}

impl TakenIn {
    /// It counts and changes nothing.
    const AGAIN: Self = Self::Yes { proxies: Vec::new(), denied: Vec::new() };
}

/// All remote bids.
#[derive(Clone, Debug)]
pub(crate) struct BidTable {
    incarnation: u64,
    rights: Rights,
    pub(crate) bidders: BTreeMap<NodeName, Bidder>,
    /// Whether the blocks to be kept have changed since they were last taken to be saved.
    unsaved: bool,
}

/// One node's bids in one of its lives.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bidder {
    pub(crate) incarnation: u64,
    pub(crate) epoch: u64,
    pub(crate) sent_at: Duration,
    /// When the newest copy arrived, on this home's clock.
    pub(crate) heard_at: Duration,
    pub(crate) lease: Duration,
    /// Whether the lease runs.
    pub(crate) live: bool,
    /// Whether one of its records was made for this home's present life.
    pub(crate) knows_this_life: bool,
    pub(crate) bids: BTreeMap<String, TakenBid>,
    /// The b-threads whose blocks lapsed with the lease, until the next record.
    pub(crate) released: BTreeSet<String>,
    /// Highest synchronisation point of each b-thread at which a request was served (G4).
    pub(crate) served: BTreeMap<String, u64>,
    pub(crate) refused: Vec<Refusal>,
    /// Blocks that an authority has lifted: for each b-thread, up to which synchronisation point.
    pub(crate) lifted: BTreeMap<String, u64>,
}

/// One bid, as far as it is honoured.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TakenBid {
    pub(crate) sync: u64,
    pub(crate) requests: Vec<Event>,
    pub(crate) block: EventSet,
    /// The block as it was asked for, of which this home honours its own part.
    pub(crate) asked_block: EventSet,
    pub(crate) priority: Option<i32>,
    /// Whether the requests may still be served.
    pub(crate) open: bool,
    /// Whether the block outlives its holder.
    pub(crate) keep: bool,
    /// Whether it is left over from a life of its node that has ended, so that only an authority can lift it.
    pub(crate) orphaned: bool,
}

/// A remote b-thread that stands behind a proxy.
#[derive(Clone, Debug, PartialEq)]
pub struct RemoteParty {
    pub node: NodeName,
    pub bthread: String,
    /// How long ago its bid was renewed, on this home's clock.
    pub lease_age: Duration,
    /// After what age it lapses.
    pub lease: Duration,
}

impl BidTable {
    /// A table with the blocks that a former life of this home has kept, and the proxies that stand for them.
    pub(crate) fn new(incarnation: u64, rights: Rights, kept: Vec<KeptBlock>) -> (Self, Vec<ProxyChange>) {
        let mut bidders: BTreeMap<NodeName, Bidder> = BTreeMap::new();
        for KeptBlock { node, incarnation, .. } in &kept {
            let bidder = bidders.entry(node.clone()).or_default();
            bidder.incarnation = bidder.incarnation.max(*incarnation);
        }
        for KeptBlock { node, incarnation, bthread, sync, block } in kept {
            let bidder = bidders.entry(node).or_default();
            let (asked_block, orphaned) = (block.clone(), incarnation < bidder.incarnation);
            bidder.bids.insert(bthread, TakenBid { sync, block, asked_block, orphaned, ..TakenBid::kept() });
        }
        let nothing = BTreeMap::new();
        let proxies =
            bidders.iter().flat_map(|(node, bidder)| changes(node, &nothing, &bidder.bids)).collect();
        (Self { incarnation, rights, bidders, unsaved: false }, proxies)
    }

    /// The rights that this home grants from now on.
    pub(crate) fn rights_mut(&mut self) -> &mut Rights {
        &mut self.rights
    }

    /// The blocks that must outlive this home's life.
    pub(crate) fn kept(&self) -> Vec<KeptBlock> {
        let blocks = self.bidders.iter().flat_map(|(node, bidder)| {
            bidder.bids.iter().filter(|(_, bid)| bid.keep).map(|(bthread, bid)| KeptBlock {
                node: node.clone(),
                // Of the lives that have ended, one is as good as another.
                incarnation: bidder.incarnation.saturating_sub(u64::from(bid.orphaned)),
                bthread: bthread.clone(),
                sync: bid.sync,
                block: bid.block.clone(),
            })
        });
        blocks.collect()
    }

    /// Whether [`kept`](Self::kept) has changed since the last call.
    pub(crate) fn take_unsaved(&mut self) -> bool {
        std::mem::take(&mut self.unsaved)
    }

    /// An authority lifts the block of `bthread` at `node`.
    pub(crate) fn lift(&mut self, node: &NodeName, bthread: &str) -> Vec<ProxyChange> {
        let Some(bidder) = self.bidders.get_mut(node) else { return Vec::new() };
        let Some(bid) = bidder.bids.get_mut(bthread).filter(|bid| bid.keep) else { return Vec::new() };
        self.unsaved = true;
        bidder.lifted.insert(bthread.into(), bid.sync);
        let before = bidder.bids.clone();
        bidder.bids.remove(bthread);
        changes(node, &before, &bidder.bids)
    }

    /// Takes in a record of a roster member in its present life.
    pub(crate) fn take_in(&mut self, now: Duration, record: &BidRecord, past: &Past<'_>) -> TakenIn {
        let for_this_life = record.home_incarnation == Some(self.incarnation);
        let mut since = Vec::new();
        if for_this_life {
            let decided = if record.term == past.term { record.decided } else { 0 };
            match (past.history.after(record.applied), past.decisions.map(|made| made.after(decided))) {
                (Some(own), None) => since.extend(own.map(|occurrence| &occurrence.event)),
                (Some(own), Some(Some(joint))) => {
                    since.extend(own.chain(joint).map(|occurrence| &occurrence.event));
                }
                _ => return TakenIn::No,
            }
        }
        let bidder = self.bidders.entry(record.node.clone()).or_default();
        if record.incarnation != bidder.incarnation {
            *bidder = bidder.reborn(record.incarnation);
        }
        match (record.epoch, record.sent_at).cmp(&(bidder.epoch, bidder.sent_at)) {
            Ordering::Less => return TakenIn::No,
            // A repeated copy does not renew the lease.
            Ordering::Equal => return if bidder.live { TakenIn::AGAIN } else { TakenIn::No },
            Ordering::Greater => {}
        }
        let refused_before = std::mem::take(&mut bidder.refused);
        bidder.renew(now, record);
        bidder.released.clear();
        bidder.knows_this_life |= for_this_life;
        let mut taken = BTreeMap::new();
        #[cfg(feature = "mutants")]
        if self.rights.mutant == Some(Mutant::G2) {
            taken = bidder.bids.clone();
        }
        for (place, bid) in record.bids.iter().enumerate() {
            let (honoured, reasons) = self.rights.judge(&record.node, bid, place, bidder.lease);
            bidder.refuse(bid, reasons);
            let Some(mut honoured) = honoured else { continue };
            // What has occurred since the bidder stated this resumes its b-thread, which asks no more (G4).
            let resumed = since.iter().any(|event| bid.requests.contains(event));
            let over = bidder.has_been_served(bid) || resumed;
            #[cfg(feature = "mutants")]
            let over = over && self.rights.mutant != Some(Mutant::G4);
            let astray =
                record.term != past.term && bid.requests.iter().any(|e| Roster::joint_events().contains(e));
            honoured.open &= for_this_life && !over && !astray;
            if honoured.keep && bidder.lifted.get(&bid.bthread).is_some_and(|sync| bid.block_since <= *sync) {
                honoured.block = EventSet::None;
                honoured.keep = false;
                bidder.refuse(bid, vec![RefusalReason::Lifted]);
            }
            taken.insert(bid.bthread.clone(), honoured);
        }
        bidder.served.retain(|bthread, _| taken.contains_key(bthread));
        bidder.lifted.retain(|bthread, _| taken.contains_key(bthread));
        for (bthread, orphan) in bidder.bids.iter().filter(|(_, bid)| bid.orphaned) {
            let heir = taken.entry(bthread.clone()).or_insert_with(|| orphan.clone());
            // The b-thread's new life takes the block over if it states all of it, and then may withdraw it. What this home
            // honours of the two may differ, when it has become the coordinator between them, or is it no more.
            if !(heir.keep && orphan.asked_block.is_within(&heir.asked_block)) {
                heir.block = joined(&heir.block, &orphan.block);
                heir.asked_block = joined(&heir.asked_block, &orphan.asked_block);
                heir.keep = true;
                heir.orphaned = true;
            }
        }
        self.unsaved |= kept_blocks(&bidder.bids).ne(kept_blocks(&taken));
        let before = std::mem::replace(&mut bidder.bids, taken);
        let denied = bidder.refused.iter().filter(|refusal| !refused_before.contains(refusal));
        TakenIn::Yes {
            proxies: changes(&record.node, &before, &bidder.bids),
            denied: denied.cloned().collect(),
        }
    }

    /// What the last record of `node` asked for in vain.
    pub(crate) fn refused(&self, node: &NodeName) -> &[Refusal] {
        self.bidders.get(node).map_or(&[], |bidder| &bidder.refused)
    }

    /// Whether all that `node` blocks here is known: a record that it made for this home's present life has come.
    pub(crate) fn knows(&self, node: &NodeName) -> bool {
        self.bidders.get(node).is_some_and(|bidder| bidder.knows_this_life)
    }

    /// `node` lives in `incarnation`: what it bid in another life is void. A block that was kept over a restart of this
    /// home may be of the life that its holder still leads, and then is its own to withdraw.
    pub(crate) fn drop_life(&mut self, node: &NodeName, incarnation: u64) -> Vec<ProxyChange> {
        let Some(bidder) = self.bidders.get_mut(node) else { return Vec::new() };
        if bidder.incarnation == incarnation {
            return Vec::new();
        }
        let before = bidder.bids.clone();
        *bidder = bidder.reborn(incarnation);
        changes(node, &before, &bidder.bids)
    }

    /// Lets go of the bids whose lease has run out (G5).
    pub(crate) fn expire(&mut self, now: Duration) -> Vec<ProxyChange> {
        let mut gone = Vec::new();
        for (node, bidder) in &mut self.bidders {
            if bidder.live && now >= self.rights.lapses_at(bidder) {
                bidder.live = false;
                bidder.released = bidder.releasing().collect();
                let before = std::mem::take(&mut bidder.bids);
                let left = before.iter().filter(|(_, bid)| bid.keep);
                bidder.bids = left.map(|(bthread, bid)| (bthread.clone(), bid.left_over())).collect();
                gone.extend(changes(node, &before, &bidder.bids));
            }
        }
        gone
    }

    /// The b-threads of `node` whose blocks here end, or did end, with its lease.
    pub(crate) fn released_by(&self, node: &NodeName) -> BTreeSet<String> {
        let bidder = self.bidders.get(node);
        bidder
            .map(|bidder| bidder.releasing().chain(bidder.released.iter().cloned()).collect())
            .unwrap_or_default()
    }

    /// The b-threads of `node` whose blocks here stay when it is lost.
    pub(crate) fn held_for(&self, node: &NodeName) -> BTreeSet<String> {
        let bids = self.bidders.get(node).into_iter().flat_map(|bidder| &bidder.bids);
        bids.filter(|(_, bid)| bid.keep).map(|(bthread, _)| bthread.clone()).collect()
    }

    /// When the next lease runs out.
    pub(crate) fn next_deadline(&self) -> Option<Duration> {
        self.bidders
            .values()
            .filter(|bidder| bidder.live && !bidder.bids.is_empty())
            .map(|bidder| self.rights.lapses_at(bidder))
            .min()
    }

    /// An event was selected at the request of these b-threads: the remote ones among them are served, and only
    /// their blocks stay until the next record.
    pub(crate) fn serve(&mut self, requested_by: &[Arc<str>]) -> (Vec<ServedRequest>, Vec<ProxyChange>) {
        let (mut served, mut proxies) = (Vec::new(), Vec::new());
        for name in requested_by {
            let Some((node, bthread)) = name.split_once('#') else { continue };
            let Ok(node) = NodeName::new(node) else { continue };
            let Some(bidder) = self.bidders.get_mut(&node) else { continue };
            let Some(bid) = bidder.bids.get_mut(bthread) else { continue };
            bid.open = false;
            bidder.served.insert(bthread.into(), bid.sync);
            proxies.push((name.clone(), Some(bid.to_bid())));
            served.push(ServedRequest {
                node,
                incarnation: bidder.incarnation,
                bthread: bthread.into(),
                sync: bid.sync,
            });
        }
        (served, proxies)
    }

    /// All requests from afar that may still be served.
    pub(crate) fn open_requests(&self) -> impl Iterator<Item = &Event> {
        let bids = self.bidders.values().flat_map(|bidder| bidder.bids.values());
        bids.filter(|bid| bid.open).flat_map(|bid| &bid.requests)
    }

    /// Whether anything is blocked from afar.
    pub(crate) fn has_blocks(&self) -> bool {
        self.bidders.values().flat_map(|bidder| bidder.bids.values()).any(|bid| !bid.block.is_none())
    }

    /// The proxies that block `event`.
    pub(crate) fn blockers_of(&self, event: &Event) -> impl Iterator<Item = String> {
        self.bidders.iter().flat_map(move |(node, bidder)| {
            let blockers = bidder.bids.iter().filter(move |(_, bid)| bid.block.contains(event));
            blockers.map(move |(bthread, _)| format!("{node}#{bthread}"))
        })
    }

    /// What the b-thread behind a proxy asked to block, if it blocks anything here.
    pub(crate) fn asked_block(&self, proxy: &str) -> Option<&EventSet> {
        let (node, bthread) = proxy.split_once('#')?;
        let bid = self.bidders.get(node)?.bids.get(bthread)?;
        (!bid.block.is_none()).then_some(&bid.asked_block)
    }

    /// Who stands behind a proxy.
    pub(crate) fn party(&self, proxy: &str, now: Duration) -> Option<RemoteParty> {
        let (node, bthread) = proxy.split_once('#')?;
        let (node, bidder) = self.bidders.get_key_value(node)?;
        bidder.bids.contains_key(bthread).then(|| RemoteParty {
            node: node.clone(),
            bthread: bthread.into(),
            lease_age: now.saturating_sub(bidder.heard_at),
            lease: bidder.lease,
        })
    }
}

impl Bidder {
    /// Its b-threads whose blocks end with its lease.
    fn releasing(&self) -> impl Iterator<Item = String> + '_ {
        let releasing = |bid: &TakenBid| !bid.block.is_none() && !bid.keep;
        self.bids.iter().filter(move |(_, bid)| releasing(bid)).map(|(bthread, _)| bthread.clone())
    }

    /// The same node in a new life: of the old one, only the blocks that are kept count.
    fn reborn(&mut self, incarnation: u64) -> Self {
        let mut bids = std::mem::take(&mut self.bids);
        bids.retain(|_, bid| bid.keep);
        bids.values_mut().for_each(|bid| *bid = TakenBid { orphaned: true, ..bid.left_over() });
        Self { incarnation, bids, ..Self::default() }
    }

    /// Takes over a newer copy's number, age and lease.
    fn renew(&mut self, now: Duration, record: &BidRecord) {
        self.epoch = record.epoch;
        self.sent_at = record.sent_at;
        self.heard_at = now;
        self.lease = Duration::from_millis(record.lease_ms);
        self.live = true;
    }

    fn has_been_served(&self, bid: &RemoteBid) -> bool {
        self.served.get(&bid.bthread).is_some_and(|served| bid.sync <= *served)
    }

    fn refuse(&mut self, bid: &RemoteBid, reasons: Vec<RefusalReason>) {
        let refusals = reasons.into_iter().map(|reason| Refusal {
            bthread: bid.bthread.clone(),
            sync: bid.sync,
            reason,
        });
        self.refused.extend(refusals);
    }
}

impl Rights {
    /// When the lease of a bidder runs out, on this home's clock.
    fn lapses_at(&self, bidder: &Bidder) -> Duration {
        #[cfg(feature = "mutants")]
        match self.mutant {
            Some(Mutant::G3) => return bidder.heard_at + bidder.lease * 8 / 10,
            Some(Mutant::G5) => return Duration::MAX,
            _ => {}
        }
        bidder.heard_at + bidder.lease
    }

    /// From now on, these events have their home here.
    pub(crate) fn set_home(&mut self, home: EventSet) {
        let never = EventSet::any_of([&self.facts, &self.safety, &self.gateway, &self.orders]);
        #[cfg(feature = "mutants")]
        let never = if self.mutant == Some(Mutant::G6) { self.facts.clone() } else { never };
        self.blockable = home.clone().and(never.not());
        self.home = home;
    }

    /// What of a bid at this place of a record is honoured, and why not the rest.
    fn judge(
        &self,
        node: &NodeName,
        bid: &RemoteBid,
        place: usize,
        lease: Duration,
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
        let mut reasons: Vec<_> = bid.requests.iter().filter_map(denial).collect();
        // A b-thread blocks with one set what it wants to block at all homes together.
        let block = match self.authority.may_block(node, &bid.bthread, &bid.block.about(&self.home)) {
            true => self.honoured_block(bid),
            false => {
                reasons.push(RefusalReason::MayNotBlock);
                EventSet::None
            }
        };
        if bid.on_loss == OnLoss::Hold && !self.durable {
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

    /// The block without what may not be blocked from afar.
    fn honoured_block(&self, bid: &RemoteBid) -> EventSet {
        if bid.block.is_none() || (bid.on_loss == OnLoss::Hold && !self.durable) {
            return EventSet::None;
        }
        bid.block.clone().and(self.blockable.clone())
    }
}

impl TakenBid {
    /// A block that is kept, and nothing else.
    fn kept() -> Self {
        Self {
            sync: 0,
            requests: Vec::new(),
            block: EventSet::None,
            asked_block: EventSet::None,
            priority: None,
            open: false,
            keep: true,
            orphaned: false,
        }
    }

    /// What stays of a bid whose holder is lost.
    fn left_over(&self) -> Self {
        let (block, asked_block) = (self.block.clone(), self.asked_block.clone());
        Self { sync: self.sync, block, asked_block, orphaned: self.orphaned, ..Self::kept() }
    }

    /// The bid of the proxy.
    fn to_bid(&self) -> Bid {
        let mut bid = Bid::new().block(self.block.clone());
        if self.open {
            bid = self.requests.iter().fold(bid, |bid, event| bid.request(event));
        }
        match self.priority {
            Some(priority) => bid.priority(priority),
            None => bid,
        }
    }
}

/// The events of both sets; no larger a tree each time that the same ones are joined.
fn joined(more: &EventSet, set: &EventSet) -> EventSet {
    if more.is_within(set) { set.clone() } else { more.clone().or(set.clone()) }
}

/// What of these bids must outlive this home's life.
fn kept_blocks(bids: &BTreeMap<String, TakenBid>) -> impl Iterator<Item = (&String, u64, bool, &EventSet)> {
    let kept = bids.iter().filter(|(_, bid)| bid.keep);
    kept.map(|(bthread, bid)| (bthread, bid.sync, bid.orphaned, &bid.block))
}

/// How the proxies of `node` change from one set of bids to the next.
fn changes(
    node: &NodeName,
    before: &BTreeMap<String, TakenBid>,
    after: &BTreeMap<String, TakenBid>,
) -> Vec<ProxyChange> {
    let proxy = |bthread: &String| -> Arc<str> { format!("{node}#{bthread}").into() };
    let gone =
        before.keys().filter(|bthread| !after.contains_key(*bthread)).map(|bthread| (proxy(bthread), None));
    let put = after.iter().filter(|(bthread, bid)| before.get(*bthread) != Some(bid));
    gone.chain(put.map(|(bthread, bid)| (proxy(bthread), Some(bid.to_bid())))).collect()
}
