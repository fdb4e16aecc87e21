//! The board: every bid on the table, and the questions a program asks of them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use crate::bid::Bid;
use crate::bthread::{AnyBThread, DEFAULT_BTHREAD_PRIORITY};
use crate::event::Event;
use crate::event_set::EventSet;
use crate::index::{Index, Place};
use crate::program::Strategy;

/// Most bids that stay in the indexes after they were replaced; an event has at most as many candidates too many.
const BIDS_LEFT_FILED: usize = 16;

/// The owner of a bid.
#[derive(Clone, Debug)]
pub(crate) enum Owner {
    /// A b-thread that runs here.
    BThread(Box<dyn AnyBThread>),
    /// A channel, on behalf of a b-thread that runs elsewhere.
    Proxy,
}

/// One bid and its owner.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) name: Arc<str>,
    pub(crate) owner: Owner,
    pub(crate) bid: Bid,
    /// Synchronisation points reached so far.
    pub(crate) sync: u64,
    /// Priority of its requests under the program's strategy; none is lowest.
    rank: Option<i32>,
}

impl Entry {
    pub(crate) fn is_proxy(&self) -> bool {
        matches!(self.owner, Owner::Proxy)
    }
}

/// Bids in the order their owners came, with indexes kept up to date, so that idle b-threads cost nothing.
#[derive(Clone, Debug)]
pub(crate) struct Board {
    strategy: Strategy,
    /// Events that proxies cannot block.
    protected: EventSet,
    /// Events that may be selected here.
    pub(crate) home: EventSet,
    entries: Vec<Option<Entry>>,
    vacant: usize,
    bthreads: BTreeMap<Arc<str>, Place>,
    proxies: BTreeMap<Arc<str>, Place>,
    indexes: Indexes,
}

impl Board {
    pub(crate) fn new(strategy: Strategy, protected: EventSet) -> Self {
        Self {
            strategy,
            protected,
            home: EventSet::All,
            entries: Vec::new(),
            vacant: 0,
            bthreads: BTreeMap::new(),
            proxies: BTreeMap::new(),
            indexes: Indexes::default(),
        }
    }

    /// Adds an owner with an empty bid. `sync` is how many synchronisation points its name has seen before.
    pub(crate) fn add(&mut self, name: Arc<str>, owner: Owner, sync: u64) -> Place {
        let place = self.entries.len() as Place;
        let names = if matches!(owner, Owner::Proxy) { &mut self.proxies } else { &mut self.bthreads };
        names.insert(name.clone(), place);
        self.entries.push(Some(Entry { name, owner, bid: Bid::new(), sync, rank: None }));
        place
    }

    pub(crate) fn remove(&mut self, place: Place) -> Option<Entry> {
        let entry = self.entries.get_mut(place as usize)?.take()?;
        self.indexes.remove(place, &entry.bid);
        let names = if entry.is_proxy() { &mut self.proxies } else { &mut self.bthreads };
        names.remove(&entry.name);
        self.vacant += 1;
        Some(entry)
    }

    /// Replaces the bid at `place` and gives back the old one.
    pub(crate) fn restate(&mut self, place: Place, bid: Bid) -> Option<Bid> {
        let entry = self.entries.get_mut(place as usize)?.as_mut()?;
        entry.rank = rank(self.strategy, &entry.owner, &bid);
        entry.sync += 1;
        self.indexes.replace(place, &entry.bid, &bid);
        Some(std::mem::replace(&mut entry.bid, bid))
    }

    pub(crate) fn get(&self, place: Place) -> Option<&Entry> {
        self.entries.get(place as usize)?.as_ref()
    }

    pub(crate) fn get_mut(&mut self, place: Place) -> Option<&mut Entry> {
        self.entries.get_mut(place as usize)?.as_mut()
    }

    pub(crate) fn bthread(&self, name: &str) -> Option<Place> {
        self.bthreads.get(name).copied()
    }

    pub(crate) fn proxy(&self, name: &str) -> Option<Place> {
        self.proxies.get(name).copied()
    }

    /// B-threads by name, with their states.
    pub(crate) fn bthreads(&self) -> impl Iterator<Item = (&Entry, &dyn AnyBThread)> {
        self.bthreads.values().filter_map(|place| self.get(*place)).filter_map(|entry| match &entry.owner {
            Owner::BThread(bthread) => Some((entry, &**bthread)),
            Owner::Proxy => None,
        })
    }

    /// Proxies by name.
    pub(crate) fn proxies(&self) -> impl Iterator<Item = &Entry> {
        self.proxies.values().filter_map(|place| self.get(*place))
    }

    /// B-threads and proxies in the order they came.
    pub(crate) fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().flatten()
    }

    pub(crate) fn has_bthreads(&self) -> bool {
        !self.bthreads.is_empty()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bthreads.is_empty() && self.proxies.is_empty()
    }

    /// Requests for events whose home is here.
    pub(crate) fn requests(&self) -> impl Iterator<Item = (&Entry, &Event)> {
        let entries = self.indexes.requesters.iter().filter_map(|place| self.get(*place));
        entries
            .flat_map(|entry| entry.bid.requests().iter().map(move |event| (entry, event)))
            .filter(|(_, e)| self.is_home(e))
    }

    /// Whether somebody requests `event`.
    pub(crate) fn is_requested(&self, event: &Event) -> bool {
        self.any_candidate(&self.indexes.wakes, event, |entry| entry.bid.requests().contains(event))
    }

    /// Whether `event` may be selected here.
    pub(crate) fn is_home(&self, event: &Event) -> bool {
        self.home.contains(event)
    }

    pub(crate) fn is_blocked(&self, event: &Event) -> bool {
        self.any_candidate(&self.indexes.blockers, event, |entry| self.blocks(entry, event))
    }

    /// Whether a b-thread that runs here blocks `event`.
    pub(crate) fn is_blocked_by_bthread(&self, event: &Event) -> bool {
        self.any_candidate(&self.indexes.blockers, event, |entry| {
            !entry.is_proxy() && self.blocks(entry, event)
        })
    }

    fn any_candidate(&self, index: &Index, event: &Event, is_it: impl Fn(&Entry) -> bool) -> bool {
        let is_it = |place: &Place| self.get(*place).is_some_and(&is_it);
        index.candidates(event).iter().any(|places| places.iter().any(is_it))
    }

    /// Whether this bid counts as a block of `event`.
    pub(crate) fn blocks(&self, entry: &Entry, event: &Event) -> bool {
        entry.bid.blocks().contains(event) && !(entry.is_proxy() && self.protected.contains(event))
    }

    /// Fills `offers` with the distinct events that may be selected under the strategy, in a fixed order.
    pub(crate) fn offers(&self, offers: &mut Vec<Event>) {
        offers.clear();
        let mut best = None;
        for entry in self.indexes.requesters.iter().filter_map(|place| self.get(*place)) {
            if entry.rank < best {
                continue;
            }
            for event in entry.bid.requests() {
                if !self.is_home(event) || self.is_blocked(event) {
                    continue;
                }
                if entry.rank > best {
                    best = entry.rank;
                    offers.clear();
                }
                offers.push(event.clone());
                if self.strategy == Strategy::Ordered {
                    break;
                }
            }
        }
        if offers.len() > 1 {
            offers.sort_unstable_by(Event::cmp_by_key);
            offers.dedup();
        }
    }

    /// Fills `places` with those whom `event` may concern, in the order they came.
    pub(crate) fn listeners(&self, event: &Event, places: &mut Vec<Place>) {
        places.clear();
        self.indexes.wakes.candidates(event).iter().for_each(|list| places.extend_from_slice(list));
        // One list alone is in order.
        if !places.is_sorted_by(|a, b| a < b) {
            places.sort_unstable();
            places.dedup();
        }
    }

    pub(crate) fn next_deadline(&self) -> Option<Duration> {
        self.indexes.deadlines.first().map(|(at, _)| *at)
    }

    /// Those whose deadline has passed, earliest first.
    pub(crate) fn overdue(&self, now: Duration) -> Vec<Place> {
        self.indexes.deadlines.iter().take_while(|(at, _)| *at <= now).map(|(_, place)| *place).collect()
    }

    /// Closes the gaps that ended b-threads left, once they are many and most. Every place changes.
    pub(crate) fn compact(&mut self) {
        if self.vacant < 64 || self.vacant * 2 < self.entries.len() {
            return;
        }
        let entries = std::mem::take(&mut self.entries);
        let mut fresh = Self::new(self.strategy, std::mem::take(&mut self.protected));
        fresh.home = std::mem::take(&mut self.home);
        for entry in entries.into_iter().flatten() {
            let Entry { name, owner, bid, sync, rank } = entry;
            let place = fresh.add(name, owner, sync);
            fresh.indexes.add(place, &bid);
            if let Some(entry) = fresh.get_mut(place) {
                entry.bid = bid;
                entry.rank = rank;
            }
        }
        *self = fresh;
    }
}

/// An index of the bids that a question is about.
///
/// A b-thread that goes round a loop states the same few bids again and again. So a replaced bid stays filed until
/// others have been replaced after it, and is found there when it comes back. Who asks looks at the present bid itself.
#[derive(Clone, Debug, Default)]
struct Indexes {
    /// The bids that request, wait for or are interrupted by an event.
    wakes: Index,
    /// The bids that block an event.
    blockers: Index,
    /// Replaced bids that are still filed, the one replaced first in front.
    left_filed: VecDeque<(Place, Bid)>,
    /// Places of bids with requests, sorted.
    requesters: Vec<Place>,
    deadlines: BTreeSet<(Duration, Place)>,
}

impl Indexes {
    fn add(&mut self, place: Place, bid: &Bid) {
        self.file(place, bid);
        self.restate_requests(place, false, !bid.requests().is_empty());
        self.restate_deadline(place, None, bid.given_deadline());
    }

    fn remove(&mut self, place: Place, bid: &Bid) {
        self.unfile(place, bid);
        while let Some(at) = self.left_filed.iter().position(|(of, _)| *of == place) {
            self.unfile_left(at);
        }
        self.restate_requests(place, !bid.requests().is_empty(), false);
        self.restate_deadline(place, bid.given_deadline(), None);
    }

    fn replace(&mut self, place: Place, old: &Bid, new: &Bid) {
        if old.is_the_same(new) {
            return;
        }
        let filed = self.left_filed.iter_mut().find(|(of, bid)| *of == place && bid.concerns_as(new));
        if let Some((_, bid)) = filed {
            *bid = old.clone();
        } else if !old.concerns_as(new) {
            self.file(place, new);
            self.left_filed.push_back((place, old.clone()));
            if self.left_filed.len() > BIDS_LEFT_FILED {
                self.unfile_left(0);
            }
        }
        self.restate_requests(place, !old.requests().is_empty(), !new.requests().is_empty());
        self.restate_deadline(place, old.given_deadline(), new.given_deadline());
    }

    fn file(&mut self, place: Place, bid: &Bid) {
        bid.requests().iter().for_each(|event| self.wakes.file_event(event, place));
        self.wakes.file(bid.waits(), place);
        self.wakes.file(bid.interrupts(), place);
        self.blockers.file(bid.blocks(), place);
    }

    fn unfile(&mut self, place: Place, bid: &Bid) {
        bid.requests().iter().for_each(|event| self.wakes.unfile_event(event, place));
        self.wakes.unfile(bid.waits(), place);
        self.wakes.unfile(bid.interrupts(), place);
        self.blockers.unfile(bid.blocks(), place);
    }

    fn unfile_left(&mut self, at: usize) {
        if let Some((place, bid)) = self.left_filed.remove(at) {
            self.unfile(place, &bid);
        }
    }

    fn restate_requests(&mut self, place: Place, before: bool, after: bool) {
        match (before, after) {
            (false, true) => {
                if let Err(at) = self.requesters.binary_search(&place) {
                    self.requesters.insert(at, place);
                }
            }
            (true, false) => {
                if let Ok(at) = self.requesters.binary_search(&place) {
                    self.requesters.remove(at);
                }
            }
            _ => {}
        }
    }

    fn restate_deadline(&mut self, place: Place, before: Option<Duration>, after: Option<Duration>) {
        if before != after {
            before.map(|at| self.deadlines.remove(&(at, place)));
            after.map(|at| self.deadlines.insert((at, place)));
        }
    }
}

/// Priority of a bid's requests under a strategy; none is lowest.
pub(crate) fn rank(strategy: Strategy, owner: &Owner, bid: &Bid) -> Option<i32> {
    match (strategy, owner) {
        (Strategy::Simple | Strategy::Ordered, _) => None,
        (Strategy::SyncPriority, _) => bid.given_priority(),
        (Strategy::BThreadPriority, Owner::BThread(bthread)) => Some(bthread.priority()),
        (Strategy::BThreadPriority, Owner::Proxy) => {
            Some(bid.given_priority().unwrap_or(DEFAULT_BTHREAD_PRIORITY))
        }
    }
}
