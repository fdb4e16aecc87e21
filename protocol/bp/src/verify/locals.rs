//! The local states of a program's b-threads and proxies, and what each means for each event.

use std::collections::BTreeSet;
use std::hash::Hasher;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHasher};

use super::BidRule;
use super::interner::Interner;
use crate::bid::Bid;
use crate::board::{Owner, rank};
use crate::bthread::Context;
use crate::event::Event;
use crate::event_set::EventSet;
use crate::program::Strategy;

/// Number of a local state. None is 0.
pub(super) type LocalId = u32;
/// In place of a local state: the b-thread has ended.
pub(super) const ENDED: LocalId = 0;

/// The cause that moves a local state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    /// An event, by number, that it requests, waits for or is interrupted by.
    Event(u32),
    Deadline,
}

/// The outcome of a cause for a local state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    /// The next local state, or [`ENDED`].
    pub(super) next: LocalId,
    /// Whether there is nothing else to it: no effect on the rest of the program.
    pub(super) plain: bool,
}

/// One local state: a b-thread at a synchronisation point, or a proxy with its bid.
#[derive(Clone, Debug)]
pub(super) struct Local {
    /// Number of the name.
    pub(super) slot: u32,
    pub(super) name: Arc<str>,
    pub(super) owner: Owner,
    pub(super) bid: Bid,
    /// Priority of its requests under the program's strategy.
    pub(super) rank: Option<i32>,
    /// Numbers of the requested events that have their home here, in order.
    pub(super) requests: Vec<u32>,
    /// Whether it stands for the world, so that what it requests counts as external.
    pub(super) is_world: bool,
    /// The rule that the bid breaks, and how.
    pub(super) fault: Option<(String, String)>,
    /// Known outcomes, sorted by cause.
    outcomes: Vec<(Cause, Outcome)>,
}

impl Local {
    pub(super) fn is_proxy(&self) -> bool {
        matches!(self.owner, Owner::Proxy)
    }
}

/// The settings of a program about events.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) strategy: Strategy,
    /// Events that proxies cannot block.
    pub(super) protected: EventSet,
    /// Events that may be selected here.
    pub(super) home: EventSet,
    /// The b-threads that stand for the world.
    pub(super) world: BTreeSet<Arc<str>>,
    /// The rules for every bid.
    pub(super) of_bids: Vec<BidRule>,
}

/// The sets of events that a local state has to do with.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Requests, of events that have their home here.
    Requests,
    Blocks,
    /// Is moved by.
    Wakes,
}

const KINDS: usize = 3;

/// All local states met so far, and all events that may be selected in them.
#[derive(Clone, Debug)]
pub(super) struct Locals {
    pub(super) rules: Rules,
    pub(super) events: Interner<Event>,
    /// Names of b-threads and proxies; a b-thread and a proxy may share one.
    slots: Interner<(Arc<str>, bool)>,
    locals: Vec<Local>,
    /// Local states by a hash of their slot and state.
    found: FxHashMap<u64, Vec<LocalId>>,
    /// For each local state and kind, a set of event numbers as bits; `width` words each.
    bits: Vec<u64>,
    width: usize,
}

impl Locals {
    pub(super) fn new(rules: Rules) -> Self {
        Self {
            rules,
            events: Interner::default(),
            slots: Interner::default(),
            locals: Vec::new(),
            found: FxHashMap::default(),
            bits: Vec::new(),
            width: 1,
        }
    }

    /// Words in a set of events.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn get(&self, id: LocalId) -> Option<&Local> {
        self.locals.get((id as usize).checked_sub(1)?)
    }

    /// The local states of a product state.
    pub(super) fn of<'a>(&'a self, state: &'a [u32]) -> impl Iterator<Item = &'a Local> + use<'a> {
        state.iter().skip(1).filter_map(|id| self.get(*id))
    }

    /// The slot of a local state. Earlier names have lower ones.
    pub(super) fn slot(&self, id: LocalId) -> u32 {
        self.get(id).map_or(u32::MAX, |local| local.slot)
    }

    pub(super) fn slot_name(&self, slot: u32) -> Option<&Arc<str>> {
        self.slots.get(slot).map(|(name, _)| name)
    }

    /// The names of the local states of a kind, each once.
    pub(super) fn names_of(&self, is: impl Fn(&Local) -> bool) -> Vec<Arc<str>> {
        let mut names: Vec<Arc<str>> =
            self.locals.iter().filter(|local| is(local)).map(|local| local.name.clone()).collect();
        names.sort();
        names.dedup();
        names
    }

    /// All local states met so far, each with what it was moved by.
    pub(super) fn all(&self) -> impl Iterator<Item = (&Local, impl Iterator<Item = Cause>)> {
        self.locals.iter().map(|local| (local, local.outcomes.iter().map(|(cause, _)| *cause)))
    }

    /// A set of events that a local state has to do with.
    pub(super) fn bits(&self, id: LocalId, kind: Kind) -> &[u64] {
        let start = ((id as usize).saturating_sub(1) * KINDS + kind as usize) * self.width;
        self.bits.get(start..start + self.width).unwrap_or_default()
    }

    /// The number of an event that may be selected.
    pub(super) fn event(&mut self, event: &Event) -> u32 {
        let known = self.events.len();
        let number = self.events.number(event.clone());
        if self.events.len() > known {
            if number as usize >= self.width * 64 {
                self.widen();
            }
            for at in 0..self.locals.len() {
                self.mark(at, number);
            }
        }
        number
    }

    /// The number of a local state: an owner at a synchronisation point with its bid.
    pub(super) fn intern(&mut self, name: &Arc<str>, owner: Owner, bid: &Bid) -> LocalId {
        let is_proxy = matches!(owner, Owner::Proxy);
        let slot = self.slots.number((name.clone(), is_proxy));
        let key = key(slot, &owner, bid);
        let same = |id: &&LocalId| {
            self.get(**id).is_some_and(|local| local.slot == slot && same_state(local, &owner, bid))
        };
        if let Some(id) = self.found.get(&key).and_then(|ids| ids.iter().find(same)) {
            return *id;
        }
        let home: Vec<&Event> =
            bid.requests().iter().filter(|event| self.rules.home.contains(event)).collect();
        let requests = home.into_iter().map(|event| self.event(event)).collect();
        let rank = rank(self.rules.strategy, &owner, bid);
        let local = Local {
            is_world: self.rules.world.contains(name),
            fault: self.rules.of_bids.iter().find_map(|rule| rule.broken_by(name, bid)),
            slot,
            name: name.clone(),
            owner,
            bid: bid.clone(),
            rank,
            requests,
            outcomes: Vec::new(),
        };
        let at = self.locals.len();
        self.locals.push(local);
        self.bits.resize(self.locals.len() * KINDS * self.width, 0);
        for event in 0..self.events.len() as u32 {
            self.mark(at, event);
        }
        let id = at as LocalId + 1;
        self.found.entry(key).or_default().push(id);
        id
    }

    pub(super) fn outcome(&mut self, id: LocalId, cause: Cause) -> Outcome {
        let Some(local) = self.get(id) else { return Outcome { next: ENDED, plain: true } };
        match local.outcomes.binary_search_by_key(&cause, |(known, _)| *known) {
            Ok(at) => {
                local.outcomes.get(at).map_or(Outcome { next: ENDED, plain: true }, |(_, outcome)| *outcome)
            }
            Err(at) => {
                let outcome = self.compute(id, cause);
                if let Some(local) = self.locals.get_mut(id as usize - 1) {
                    local.outcomes.insert(at, (cause, outcome));
                }
                outcome
            }
        }
    }

    /// Runs the b-thread, as [`Program`](crate::Program) does.
    fn compute(&mut self, id: LocalId, cause: Cause) -> Outcome {
        let ended = Outcome { next: ENDED, plain: true };
        let Some(local) = self.get(id) else { return ended };
        let (event, may_interrupt) = match cause {
            Cause::Event(number) => match self.events.get(number) {
                Some(event) => (event.clone(), true),
                None => return ended,
            },
            Cause::Deadline => (Event::timeout(), false),
        };
        let interrupted = may_interrupt && local.bid.interrupts().contains(&event);
        let name = local.name.clone();
        let Owner::BThread(bthread) = &local.owner else {
            // A proxy that is served has an empty bid.
            return Outcome { next: self.intern(&name, Owner::Proxy, &Bid::new()), plain: true };
        };
        let mut bthread = bthread.clone();
        let mut cx = Context::at(std::time::Duration::ZERO);
        let bid = if interrupted {
            bthread.interrupted(&event, &mut cx);
            None
        } else {
            bthread.resume(&event, &mut cx);
            bthread.bid()
        };
        let effects = cx.effects.is_some();
        match bid {
            None => Outcome { next: ENDED, plain: !effects },
            // A deadline that has passed at once fires before the next selection.
            Some(bid) => {
                let overdue = bid.given_deadline().is_some_and(|at| at.is_zero());
                Outcome {
                    next: self.intern(&name, Owner::BThread(bthread), &bid),
                    plain: !effects && !overdue,
                }
            }
        }
    }

    /// Notes what a local state has to do with an event.
    fn mark(&mut self, at: usize, event: u32) {
        let (Some(local), Some(value)) = (self.locals.get(at), self.events.get(event)) else { return };
        let bid = &local.bid;
        let requested = bid.requests().contains(value);
        let is = [
            requested && self.rules.home.contains(value),
            bid.blocks().contains(value) && !(local.is_proxy() && self.rules.protected.contains(value)),
            requested || bid.waits().contains(value) || bid.interrupts().contains(value),
        ];
        let (word, bit) = (event as usize / 64, 1_u64 << (event % 64));
        for (kind, is) in is.into_iter().enumerate() {
            let place = (at * KINDS + kind) * self.width + word;
            if is && let Some(word) = self.bits.get_mut(place) {
                *word |= bit;
            }
        }
    }

    fn widen(&mut self) {
        let (narrow, wide) = (self.width, self.width * 2);
        let mut bits = vec![0; self.bits.len() * 2];
        for (from, to) in self.bits.chunks_exact(narrow).zip(bits.chunks_exact_mut(wide)) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        }
        self.bits = bits;
        self.width = wide;
    }
}

fn key(slot: u32, owner: &Owner, bid: &Bid) -> u64 {
    let mut hasher = FxHasher::default();
    hasher.write_u32(slot);
    match owner {
        Owner::BThread(bthread) => bthread.hash_into(&mut hasher),
        Owner::Proxy => std::hash::Hash::hash(bid, &mut hasher),
    }
    hasher.finish()
}

/// A b-thread's bid follows from its state; a proxy's state is its bid.
fn same_state(local: &Local, owner: &Owner, bid: &Bid) -> bool {
    match (&local.owner, owner) {
        (Owner::BThread(one), Owner::BThread(other)) => one.equals(&**other),
        (Owner::Proxy, Owner::Proxy) => local.bid == *bid,
        _ => false,
    }
}
