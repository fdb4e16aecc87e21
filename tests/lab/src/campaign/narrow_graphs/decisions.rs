//! The b-thread that decides the right of way, state by state: what it states in each, and what follows from what it
//! hears. Each state, event and block is kept once, and known by its number.

use std::collections::HashMap;
use std::hash::Hash;
use std::time::Duration;

use skein_agent::bthreads::RightOfWay;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_wire::event::{Advance, Declared as _, Enter, OutOfTheWay, Right, of_every_vehicle};

/// A rule by which a vehicle shares narrow places, as a b-thread.
pub trait Rule: BThread {
    /// The vehicle's right to go first.
    fn right(&self) -> Right;
}

impl Rule for RightOfWay {
    fn right(&self) -> Right {
        RightOfWay::right(self)
    }
}

/// Things that are each kept once.
#[derive(Debug)]
struct Kept<T> {
    things: Vec<T>,
    numbers: HashMap<T, u32>,
}

impl<T: Clone + Eq + Hash> Kept<T> {
    fn new() -> Self {
        Self { things: Vec::new(), numbers: HashMap::new() }
    }

    fn number(&mut self, thing: T) -> u32 {
        if let Some(number) = self.numbers.get(&thing) {
            return *number;
        }
        let number = self.things.len() as u32;
        self.things.push(thing.clone());
        self.numbers.insert(thing, number);
        number
    }

    fn get(&self, number: u32) -> &T {
        &self.things[number as usize]
    }
}

/// The bid of a b-thread in one of its states.
#[derive(Clone, Debug)]
pub struct Stated {
    bid: Bid,
    /// Its request that it does not block itself.
    pub requests: Vec<u32>,
    /// All that it blocks of others.
    pub claim: u32,
    /// It has leave to move.
    pub may_move: bool,
    /// It is making way, or about to.
    pub makes_way: bool,
    pub has_deadline: bool,
    pub right: Right,
}

/// The states of the b-threads of a fleet.
#[derive(Debug)]
pub struct Decisions<R> {
    states: Kept<R>,
    stated: Vec<Stated>,
    events: Kept<Event>,
    claims: Kept<EventSet>,
    follows: HashMap<(u32, u32), u32>,
    keeps_out: HashMap<(u32, u32), bool>,
}

impl<R: Rule> Decisions<R> {
    pub fn new() -> Self {
        Self {
            states: Kept::new(),
            stated: Vec::new(),
            events: Kept::new(),
            claims: Kept::new(),
            follows: HashMap::new(),
            keeps_out: HashMap::new(),
        }
    }

    pub fn state(&mut self, rule: R, name: &str) -> u32 {
        let number = self.states.number(rule);
        if number as usize == self.stated.len() {
            let rule = self.states.get(number);
            let (bid, right) = (rule.bid().unwrap_or_default(), rule.right());
            let allowed = bid.requests().iter().filter(|event| !bid.blocks().contains(event)).cloned();
            let requests =
                allowed.collect::<Vec<_>>().into_iter().map(|event| self.events.number(event)).collect();
            let stated = Stated {
                requests,
                claim: self.claims.number(bid.blocks().about(&of_every_vehicle::<Enter>())),
                may_move: !bid.blocks().contains(&Advance::ANYWHERE.at(name)),
                makes_way: bid.waits().contains(&OutOfTheWay.at(name)),
                has_deadline: bid.given_deadline().is_some(),
                right,
                bid,
            };
            self.stated.push(stated);
        }
        number
    }

    pub fn stated(&self, state: u32) -> &Stated {
        &self.stated[state as usize]
    }

    pub fn number(&mut self, event: Event) -> u32 {
        self.events.number(event)
    }

    pub fn event(&self, number: u32) -> &Event {
        self.events.get(number)
    }

    /// No claim at all.
    pub fn nothing(&mut self) -> u32 {
        self.claims.number(EventSet::None)
    }

    /// Whether a claim keeps out an event.
    pub fn keeps_out(&mut self, claim: u32, event: u32) -> bool {
        let (claims, events) = (&self.claims, &self.events);
        *self.keeps_out.entry((claim, event)).or_insert_with(|| claims.get(claim).contains(events.get(event)))
    }

    /// The state of vehicle `name` that follows when it hears an event, the same if it does not wait for it. In a
    /// verification no time passes that could be told.
    pub fn after(&mut self, state: u32, event: u32, name: &str) -> u32 {
        if let Some(next) = self.follows.get(&(state, event)) {
            return *next;
        }
        let (stated, heard) = (self.stated(state), self.events.get(event).clone());
        let concerns = stated.requests.contains(&event)
            || stated.bid.waits().contains(&heard)
            || stated.has_deadline && heard == Event::timeout();
        let next = if concerns {
            let mut rule = self.states.get(state).clone();
            rule.resume(&heard, &mut Context::at(Duration::ZERO));
            self.state(rule, name)
        } else {
            state
        };
        self.follows.insert((state, event), next);
        next
    }
}
