//! The run of a node's b-program: what the program is told, and what happens in it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use skein_bp::catalogue::Declared;
use skein_bp::{Bid, Bound, Event, Origin, Program};

use crate::allowance::Allowance;
use crate::channel::stream::Heard;
use crate::facts::{BlockLapsed, Confirmed, Gap};
use crate::guest::held_blocks::BlockNews;
use crate::message::Occurrence;
use crate::name::NodeName;

/// An event that has happened, here or elsewhere, in the order in which this node's b-threads saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct Happened {
    pub event: Event,
    pub home: NodeName,
    /// Its number there, from 1; 0 for an event without home, which does not travel.
    pub seq: u64,
    /// For a joint event its term, and then the number counts that term's decisions; else 0.
    pub term: u64,
    /// [`Origin::Occurred`] for what was selected elsewhere and for [`facts`].
    pub origin: Origin,
    /// The b-threads that requested it, remote ones as `node#bthread`.
    pub requested_by: Vec<Arc<str>>,
    /// Why its home selected this event and no other.
    pub choice: Option<Arc<str>>,
    /// When, on this node's clock.
    pub at: Duration,
}

/// A change that the channel has made on the program's board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelMove {
    /// The number of selections before it, of those that [`Node::take_selections`](crate::Node::take_selections) gives
    /// next.
    pub after: usize,
    pub change: BoardChange,
}

/// A change that a channel makes on a program's board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BoardChange {
    /// This proxy, `node#bthread`, states this bid from now on.
    Put(Arc<str>, Bid),
    /// This proxy is gone.
    Gone(Arc<str>),
    /// This b-thread's requests count no more at its synchronisation point.
    Withdrawn(Arc<str>),
}

impl BoardChange {
    /// Makes the change on the board of `program`.
    pub fn apply(&self, program: &mut Program) {
        match self {
            Self::Put(proxy, bid) => program.put_proxy(proxy.clone(), bid),
            Self::Gone(proxy) => {
                program.remove_proxy(proxy);
            }
            Self::Withdrawn(bthread) => program.withdraw_requests(bthread),
        }
    }
}

/// The change of a proxy: its new bid, or none if it goes.
pub(crate) type ProxyChange = (Arc<str>, Option<Bid>);

/// News that the program is told before it goes on.
#[derive(Clone, Debug)]
pub(crate) enum Delivery {
    /// A fact of this node's own.
    Fact(Event),
    /// Whether a b-thread's block is sure.
    Block(BlockNews),
    /// An occurrence at another home.
    Occurrence(Occurrence),
    /// A decision of this node's former life.
    Recalled(Occurrence),
}

/// The program, its news, and a record of what happens.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) program: Program,
    /// The node whose program it is: facts are told under its name.
    node: NodeName,
    pub(crate) news: VecDeque<Delivery>,
    pub(crate) selections: Vec<Happened>,
    /// The channel's changes on the board, where they are recorded.
    pub(crate) channel_moves: Option<Vec<ChannelMove>>,
    /// Whether bids have changed since it was last looked which requests are stalled.
    pub(crate) bids_changed: bool,
    pub(crate) now: Duration,
    /// The facts that were told because of each other member.
    tellings: BTreeMap<NodeName, Telling>,
}

/// The facts because of one other member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Telling {
    allowance: Allowance,
    pub(crate) told: u64,
    /// Those that it has caused beyond its share.
    pub(crate) withheld: u64,
}

impl Run {
    pub(crate) fn new(node: NodeName, program: Program) -> Self {
        Self {
            program,
            node,
            news: VecDeque::new(),
            selections: Vec::new(),
            channel_moves: None,
            bids_changed: true,
            now: Duration::ZERO,
            tellings: BTreeMap::new(),
        }
    }

    /// Tells a fact about the fleet.
    pub(crate) fn fact(&mut self, fact: impl Declared) {
        self.news.push_back(Delivery::Fact(fact.at(&self.node)));
    }

    /// Tells a fact that `member` has caused, unless it has caused too many: each is told to all.
    pub(crate) fn fact_because_of(&mut self, member: &NodeName, fact: impl Declared) {
        if !self.tellings.contains_key(member) {
            self.tellings.insert(member.clone(), Telling::default());
        }
        let Some(telling) = self.tellings.get_mut(member) else { return };
        if telling.allowance.take(self.now, Bound::FactsAtOnce, Bound::FactsPerSecond) {
            telling.told += 1;
            self.fact(fact);
        } else {
            telling.withheld += 1;
        }
    }

    pub(crate) fn telling(&self, member: &NodeName) -> Telling {
        self.tellings.get(member).copied().unwrap_or_default()
    }

    /// Delivers the occurrences and gaps that `listen` hears of the stream of `home`.
    pub(crate) fn hear(&mut self, home: &NodeName, listen: impl FnOnce(&mut VecDeque<Heard>)) {
        let mut heard = VecDeque::new();
        listen(&mut heard);
        for heard in heard {
            match heard {
                Heard::Occurrence(occurrence) => self.news.push_back(Delivery::Occurrence(occurrence)),
                Heard::Gap { from, to } => self.fact_because_of(home, Gap { home: home.clone(), from, to }),
            }
        }
    }

    pub(crate) fn change_board(&mut self, change: BoardChange) {
        self.bids_changed = true;
        change.apply(&mut self.program);
        if let Some(moves) = &mut self.channel_moves {
            moves.push(ChannelMove { after: self.selections.len(), change });
        }
    }

    pub(crate) fn change_proxies(&mut self, changes: Vec<ProxyChange>) {
        for (proxy, bid) in changes {
            self.change_board(match bid {
                Some(bid) => BoardChange::Put(proxy, bid),
                None => BoardChange::Gone(proxy),
            });
        }
    }

    /// Puts on record that `occurrence` has happened.
    pub(crate) fn record(&mut self, occurrence: Occurrence, origin: Origin, at: Duration) {
        let Occurrence { home, seq, term, event, requested_by, choice, .. } = occurrence;
        self.bids_changed = true;
        self.selections.push(Happened { event, home, seq, term, origin, requested_by, choice, at });
    }

    /// The synchronisation point at which a b-thread is.
    pub(crate) fn sync_of(&self, bthread: &str) -> Option<u64> {
        self.program.bids().find(|(name, _, _)| *name == bthread).map(|(_, _, sync)| sync)
    }

    /// The fact that the block of `bthread` at its synchronisation point `sync` is confirmed.
    pub(crate) fn confirmation(&self, bthread: &str, sync: u64) -> Event {
        Confirmed { bthread: bthread.into(), sync }.at(&self.node)
    }

    /// The fact that a block is confirmed or has lapsed, if it still concerns the holder. One that has moved on has
    /// left the synchronisation point that a confirmation is for, but a lapse concerns it for as long as it blocks
    /// anything.
    pub(crate) fn block_fact(&self, news: BlockNews) -> Option<Event> {
        match news {
            BlockNews::Confirmed { bthread, sync } => {
                (self.sync_of(&bthread) == Some(sync)).then(|| self.confirmation(&bthread, sync))
            }
            BlockNews::Lapsed { bthread, home } => {
                let blocks = self.program.bid(&bthread).is_some_and(|bid| !bid.blocks().is_none());
                blocks.then(|| BlockLapsed { bthread: bthread.into(), home }.at(&self.node))
            }
        }
    }
}
