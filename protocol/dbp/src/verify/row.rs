//! A state of a network as a row of numbers.
//!
//! Counters that grow for ever would make every state a new one. Only their order counts, so each family of them is
//! counted anew, by those that are in use.

use std::collections::{BTreeMap, BTreeSet};

use skein_bp::verify::Interner;
use skein_bp::{Event, EventSet, Program};

use crate::message::{Refusal, RemoteBid};
use crate::name::NodeName;

/// Something that is equal or not.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Part {
    Program(Box<Program>),
    Text(String),
    Homes(Vec<NodeName>),
    Event(Event),
    /// Requests, block, priority.
    Bid(Vec<Event>, EventSet, Option<i32>),
    Stalls(BTreeMap<String, BTreeSet<String>>),
}

/// Numbers that are compared with one another and with no others.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Family {
    /// Synchronisation points of a b-thread in one life of its node.
    Sync(NodeName, u64, String),
    /// Contents that a bidder has stated to a home in one of the bidder's lives.
    Epoch(NodeName, u64, NodeName),
    /// Occurrences of a home in one of its lives.
    Seq(NodeName, u64),
}

/// A row that is being written.
#[derive(Debug)]
pub(crate) struct Row<'a> {
    parts: &'a mut Interner<Part>,
    families: &'a mut Interner<Family>,
    words: Vec<u32>,
    /// The numbers in the row: family, number, place.
    numbers: Vec<(u32, u64, usize)>,
}

impl<'a> Row<'a> {
    pub(crate) fn new(parts: &'a mut Interner<Part>, families: &'a mut Interner<Family>) -> Self {
        Self { parts, families, words: Vec::new(), numbers: Vec::new() }
    }

    pub(crate) fn part(&mut self, part: Part) {
        let number = self.parts.number(part);
        self.words.push(number);
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.part(Part::Text(text.into()));
    }

    pub(crate) fn flag(&mut self, flag: bool) {
        self.words.push(flag.into());
    }

    /// A number that stays small.
    pub(crate) fn plain(&mut self, number: u64) {
        self.words.push(u32::try_from(number).unwrap_or(u32::MAX));
    }

    pub(crate) fn optional(&mut self, number: Option<u64>) {
        self.plain(number.map_or(0, |number| number + 1));
    }

    pub(crate) fn number(&mut self, family: Family, number: u64) {
        let family = self.families.number(family);
        self.numbers.push((family, number, self.words.len()));
        self.words.push(0);
    }

    pub(crate) fn list<T>(&mut self, items: impl IntoIterator<Item = T>, write: impl Fn(&mut Self, T)) {
        let place = self.words.len();
        self.words.push(0);
        let mut count = 0;
        for item in items {
            write(self, item);
            count += 1;
        }
        if let Some(word) = self.words.get_mut(place) {
            *word = count;
        }
    }

    /// A bid of `node` elsewhere, in one of its lives.
    pub(crate) fn bid(&mut self, node: &NodeName, life: u64, bid: &RemoteBid) {
        self.text(&bid.bthread);
        self.number(Family::Sync(node.clone(), life, bid.bthread.clone()), bid.sync);
        self.number(Family::Sync(node.clone(), life, bid.bthread.clone()), bid.block_since);
        self.part(Part::Bid(bid.requests.clone(), bid.block.clone(), bid.priority));
    }

    pub(crate) fn refusal(&mut self, node: &NodeName, life: u64, refusal: &Refusal) {
        self.text(&refusal.bthread);
        self.number(Family::Sync(node.clone(), life, refusal.bthread.clone()), refusal.sync);
        self.text(refusal.reason.word());
    }

    /// The whole row, its numbers counted anew.
    pub(crate) fn finish(mut self) -> Vec<u32> {
        self.numbers.sort_unstable();
        let mut last = None;
        let mut rank = 0;
        for (family, number, place) in self.numbers {
            // Zero is where all of them begin again after a restart, so it keeps its place.
            rank = match last {
                Some((before, same)) if before == family && same == number => rank,
                Some((before, _)) if before == family => rank + 1,
                _ => u32::from(number > 0),
            };
            last = Some((family, number));
            if let Some(word) = self.words.get_mut(place) {
                *word = rank;
            }
        }
        self.words
    }
}
