//! A home's table of remote bids, each of which stands in the program as a proxy b-thread.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use rustc_hash::FxHashSet;
use skein_bp::{Bound, Event, EventSet};

use crate::board::{size_of_event, size_of_set};
use crate::history::History;
use crate::home::bidder::{Bidder, TakenBid};
use crate::home::rights::Rights;
use crate::joint::roster::Roster;
use crate::kept::KeptBlock;
use crate::message::{BidRecord, Refusal, RefusalReason, ServedRequest};
#[cfg(feature = "mutants")]
use crate::mutant::Mutant;
use crate::name::NodeName;
use crate::run::ProxyChange;

/// The occurrences at this home.
#[derive(Clone, Copy, Debug)]
pub(super) struct Past<'a> {
    pub(crate) history: &'a History,
    pub(crate) term: u64,
    /// The decisions of that term, if it makes them.
    pub(crate) decisions: Option<&'a History>,
}

/// The consequences of a record that counts; none if it is a repeated copy.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TakenIn {
    pub(super) proxies: Vec<ProxyChange>,
    /// The refusals that are not those of the record before.
    pub(super) denied: Vec<Refusal>,
}

/// All remote bids.
#[derive(Clone, Debug)]
pub(crate) struct BidTable {
    incarnation: u64,
    rights: Rights,
    pub(super) bidders: BTreeMap<NodeName, Bidder>,
    /// Whether the blocks to be kept are not saved as they are.
    unsaved: bool,
    /// The holders whose blocks are not on disk as they are, and all blocks that are.
    owed: BTreeSet<NodeName>,
    on_disk: Vec<KeptBlock>,
}

/// A remote b-thread that stands behind a proxy.
#[derive(Clone, Debug, PartialEq)]
pub struct RemoteParty {
    pub node: NodeName,
    pub bthread: String,
    /// The time since its bid was renewed, on this home's clock.
    pub lease_age: Duration,
    /// After what age it lapses.
    pub lease: Duration,
}

impl BidTable {
    /// A table with the blocks that a former life of this home has kept, and the proxies that stand for them.
    pub(super) fn new(incarnation: u64, rights: Rights, kept: Vec<KeptBlock>) -> (Self, Vec<ProxyChange>) {
        let mut bidders: BTreeMap<NodeName, Bidder> = BTreeMap::new();
        for KeptBlock { node, incarnation, .. } in &kept {
            let bidder = bidders.entry(node.clone()).or_default();
            bidder.incarnation = bidder.incarnation.max(*incarnation);
        }
        for KeptBlock { node, incarnation, bthread, sync, block } in kept {
            let bidder = bidders.entry(node).or_default();
            let (asked_block, orphaned) = (block.clone(), incarnation < bidder.incarnation);
            let bid = TakenBid { sync, block, asked_block, keep: true, orphaned, ..TakenBid::default() };
            bidder.bids.insert(bthread, bid);
        }
        let nothing = BTreeMap::new();
        let proxies =
            bidders.iter().flat_map(|(node, bidder)| changes(node, &nothing, &bidder.bids)).collect();
        let mut table =
            Self { incarnation, rights, bidders, unsaved: false, owed: BTreeSet::new(), on_disk: Vec::new() };
        table.saved();
        (table, proxies)
    }

    /// From now on, these events have their home here.
    pub(crate) fn set_home(&mut self, events: EventSet) {
        self.rights.set_home(events);
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

    /// All that must be kept is on disk.
    pub(crate) fn saved(&mut self) {
        self.owed.clear();
        self.on_disk = self.kept();
        self.rights.store_works = true;
    }

    /// Whether a block of `node` is not on disk as it is.
    pub(crate) fn owes(&self, node: &NodeName) -> bool {
        self.owed.contains(node)
    }

    /// From now on no block is kept that is not on disk already, and those that are not are void.
    pub(crate) fn store_fails(&mut self) -> Vec<ProxyChange> {
        self.rights.store_works = false;
        let mut gone = Vec::new();
        for node in &self.owed {
            let Some(bidder) = self.bidders.get_mut(node) else { continue };
            let before = bidder.bids.clone();
            for (bthread, bid) in bidder.bids.iter_mut().filter(|(_, bid)| bid.keep && !bid.orphaned) {
                if !is_on_disk(&self.on_disk, node, bthread, &bid.block) {
                    bid.block = EventSet::None;
                    bid.keep = false;
                }
            }
            gone.extend(changes(node, &before, &bidder.bids));
        }
        self.unsaved |= !gone.is_empty();
        gone
    }

    /// An authority lifts the block of `bthread` at `node`.
    pub(crate) fn lift(&mut self, node: &NodeName, bthread: &str) -> Vec<ProxyChange> {
        let Some(bidder) = self.bidders.get_mut(node) else { return Vec::new() };
        let Some(bid) = bidder.bids.get_mut(bthread).filter(|bid| bid.keep) else { return Vec::new() };
        self.unsaved = true;
        self.owed.insert(node.clone());
        bidder.lifted.insert(bthread.into(), bid.sync);
        let before = bidder.bids.clone();
        bidder.bids.remove(bthread);
        changes(node, &before, &bidder.bids)
    }

    /// Takes in a record of a roster member in its present life. One that is older than what is known, or whose
    /// sender has to catch up first, does not count.
    pub(super) fn take_in(&mut self, now: Duration, record: &BidRecord, past: &Past<'_>) -> Option<TakenIn> {
        let for_this_life = record.home_incarnation == Some(self.incarnation);
        let mut since = Vec::new();
        if for_this_life {
            let decided = if record.term == past.term { record.decided } else { 0 };
            match (past.history.after(record.applied), past.decisions.map(|made| made.after(decided))) {
                (Some(own), None) => since.extend(own.map(|occurrence| &occurrence.event)),
                (Some(own), Some(Some(joint))) => {
                    since.extend(own.chain(joint).map(|occurrence| &occurrence.event));
                }
                _ => return None,
            }
        }
        let bidder = self.bidders.entry(record.node.clone()).or_default();
        if record.incarnation != bidder.incarnation {
            *bidder = bidder.reborn(record.incarnation);
        }
        match (record.epoch, record.sent_at).cmp(&(bidder.epoch, bidder.sent_at)) {
            Ordering::Less => return None,
            // A repeated copy does not renew the lease.
            Ordering::Equal => return bidder.live.then(TakenIn::default),
            Ordering::Greater => {}
        }
        let requested: FxHashSet<&Event> = record.bids.iter().flat_map(|bid| &bid.requests).collect();
        let since: FxHashSet<&Event> = since.into_iter().filter(|event| requested.contains(*event)).collect();
        let refused_before = std::mem::take(&mut bidder.refused);
        bidder.renew(now, record);
        bidder.released.clear();
        bidder.knows_this_life |= for_this_life;
        let mut taken = BTreeMap::new();
        #[cfg(feature = "mutants")]
        if self.rights.mutant == Some(Mutant::G2) {
            taken = bidder.bids.clone();
        }
        // What is kept of former lives under other names takes up room: names are free, and lives are many.
        let named: FxHashSet<&String> = record.bids.iter().map(|bid| &bid.bthread).collect();
        let is_left = |(name, bid): &(&String, &TakenBid)| bid.orphaned && !named.contains(name);
        let left = bidder.bids.iter().filter(is_left).count();
        for (place, bid) in (left..).zip(&record.bids) {
            let known = bidder.bids.get(&bid.bthread).filter(|known| known.keep);
            let stays = known.is_some_and(|known| known.asked_block == bid.block);
            let (honoured, reasons) = self.rights.judge(&record.node, bid, place, bidder.lease, stays);
            bidder.refuse(bid, reasons);
            let Some(mut honoured) = honoured else { continue };
            // What has occurred since the bidder stated this resumes its b-thread, which asks no more (G4).
            let resumed = bid.requests.iter().any(|event| since.contains(event));
            let over = bidder.has_been_served(bid) || resumed;
            #[cfg(feature = "mutants")]
            let over = over && self.rights.mutant != Some(Mutant::G4);
            let astray = record.term != past.term && bid.requests.iter().any(Roster::is_joint);
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
            // The b-thread's new life takes the block over if it states all of it, and then may withdraw it. What this
            // home honours of the two may differ, when it has become the coordinator between them, or is it no more.
            if !(heir.keep && orphan.asked_block.is_within(&heir.asked_block)) {
                let block = joined(&heir.block, &orphan.block);
                let asked_block = joined(&heir.asked_block, &orphan.asked_block);
                if block.extent().check().and(asked_block.extent().check()).is_ok() {
                    (heir.block, heir.asked_block) = (block, asked_block);
                } else {
                    // Lives that each block something else must not fill the disk.
                    let reason = RefusalReason::Quota;
                    bidder.refused.push(Refusal { bthread: bthread.clone(), sync: heir.sync, reason });
                    (heir.block, heir.asked_block) = (orphan.block.clone(), orphan.asked_block.clone());
                }
                heir.keep = true;
                heir.orphaned = true;
            }
        }
        if kept_blocks(&bidder.bids).ne(kept_blocks(&taken)) {
            self.unsaved = true;
            self.owed.insert(record.node.clone());
        }
        if !self.rights.store_works {
            // What is kept now is on disk: what is withdrawn may come back in this home's next life, but
            // nothing is lost.
            self.owed.remove(&record.node);
        }
        let before = std::mem::replace(&mut bidder.bids, taken);
        let denied = bidder.refused.iter().filter(|refusal| !refused_before.contains(refusal));
        let proxies = changes(&record.node, &before, &bidder.bids);
        Some(TakenIn { proxies, denied: denied.cloned().collect() })
    }

    /// The refusals of the last record of `node`.
    pub(crate) fn refused(&self, node: &NodeName) -> &[Refusal] {
        self.bidders.get(node).map_or(&[], |bidder| &bidder.refused)
    }

    /// The entries kept of `node`, and about how many bytes they are.
    pub(crate) fn entries_of(&self, node: &NodeName) -> (usize, usize) {
        let Some(bidder) = self.bidders.get(node) else { return (0, 0) };
        let Bidder { bids, released, served, refused, lifted, .. } = bidder;
        let entries = bids.len() + released.len() + served.len() + refused.len() + lifted.len();
        let names = bids.keys().chain(released).chain(served.keys()).chain(lifted.keys());
        let names = names.chain(refused.iter().map(|refusal| &refusal.bthread)).map(String::len);
        let of_bid = |bid: &TakenBid| {
            let requests: usize = bid.requests.iter().map(size_of_event).sum();
            size_of::<TakenBid>() + requests + size_of_set(&bid.block) + size_of_set(&bid.asked_block)
        };
        (entries, names.chain(bids.values().map(of_bid)).sum())
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

    pub(crate) fn blockers_of(&self, event: &Event) -> impl Iterator<Item = String> {
        self.bidders.iter().flat_map(move |(node, bidder)| {
            let blockers = bidder.bids.iter().filter(move |(_, bid)| bid.block.contains(event));
            blockers.take(Bound::StallsNoted.most()).map(move |(bthread, _)| format!("{node}#{bthread}"))
        })
    }

    /// The block that the b-thread behind a proxy asked for, if it blocks anything here.
    pub(crate) fn asked_block(&self, proxy: &str) -> Option<&EventSet> {
        let (node, bthread) = proxy.split_once('#')?;
        let bid = self.bidders.get(node)?.bids.get(bthread)?;
        (!bid.block.is_none()).then_some(&bid.asked_block)
    }

    /// The blocks of each remote b-thread here, under its node and its name, as it was asked for.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = (&NodeName, &str, &EventSet)> {
        self.bidders.iter().flat_map(|(node, bidder)| {
            let blocking = bidder.bids.iter().filter(|(_, bid)| !bid.block.is_none());
            blocking.map(move |(bthread, bid)| (node, bthread.as_str(), &bid.asked_block))
        })
    }

    /// The node of the remote b-thread behind a proxy.
    pub(super) fn party_name(&self, proxy: &str) -> Option<&NodeName> {
        let (node, _) = proxy.split_once('#')?;
        self.bidders.get_key_value(node).map(|(node, _)| node)
    }

    /// The remote b-thread behind a proxy.
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

fn is_on_disk(on_disk: &[KeptBlock], node: &NodeName, bthread: &str, block: &EventSet) -> bool {
    on_disk.iter().any(|kept| kept.node == *node && kept.bthread == bthread && kept.block == *block)
}

/// The events of both sets; no larger a tree each time that the same ones are joined.
fn joined(more: &EventSet, set: &EventSet) -> EventSet {
    if more.is_within(set) { set.clone() } else { more.clone().or(set.clone()) }
}

/// The bids that must outlive this home's life.
fn kept_blocks(bids: &BTreeMap<String, TakenBid>) -> impl Iterator<Item = (&String, u64, bool, &EventSet)> {
    let kept = bids.iter().filter(|(_, bid)| bid.keep);
    kept.map(|(bthread, bid)| (bthread, bid.sync, bid.orphaned, &bid.block))
}

/// The changes of the proxies of `node` from one set of bids to the next.
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
