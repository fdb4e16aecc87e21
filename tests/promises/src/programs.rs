//! The b-threads of a story.

use std::fmt;
use std::time::Duration;

use serde::Serialize;
use skein_bp::catalogue::Events as _;
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program};
use skein_dbp::facts::{Gap, Unknown};
use skein_dbp::{NodeName, facts};

use crate::seconds::Seconds;

/// The behaviour of one b-thread, for ever.
#[derive(Clone, Debug, PartialEq)]
pub enum Role {
    /// Requests one event after another, numbered.
    Asks {
        /// Their name; the home may be anywhere.
        event: String,
        /// Rest after each.
        every: Duration,
        /// After how long it gives up one, to try it again after the rest.
        patience: Option<Duration>,
    },
    /// Blocks a set, now and then.
    Blocks {
        set: EventSet,
        /// For how long.
        on: Duration,
        /// After how long a pause.
        off: Duration,
        /// Whether the block is to stay when this node is lost.
        hold: bool,
    },
    /// Requests an event of its own node each time that a block is confirmed, unless it lapses before.
    Acts { holder: String, event: String },
    /// Answers an event, of any home, with another.
    Echoes {
        /// What is waited for.
        of: EventSet,
        /// What is requested then.
        event: String,
        /// Rest after each.
        rest: Duration,
    },
    /// Requests two events of one home in turn, and blocks the other one all the while.
    Alternates {
        events: [String; 2],
        /// Rest after each.
        every: Duration,
    },
}

impl Role {
    /// Adds the b-thread to a program of node `me`.
    pub fn load(&self, name: &str, me: &NodeName, program: &mut Program) {
        let told = Told { me: me.clone(), bthread: name.into() };
        match self.clone() {
            Self::Asks { event, every, patience } => program
                .add(name, Asker { event, every, patience, next: 1, phase: Phase::Resting(every), told }),
            Self::Blocks { set, on, off, hold } => {
                program.add(name, Blocker { set, on, off, hold, blocking: false, until: off })
            }
            Self::Acts { holder, event } => {
                let told = Told { me: me.clone(), bthread: holder };
                program.add(name, Actor { told, event, next: 1, acting: false })
            }
            Self::Echoes { of, event, rest } => program
                .add(name, Echo { of, event, rest, next: 1, phase: Phase::Asking(rest), told, heard: false }),
            Self::Alternates { events, every } => {
                program.add(name, Alternator { events, every, turn: 0, phase: Phase::Resting(every), told })
            }
        };
    }
}

impl Role {
    /// Whether it blocks `event` at some time.
    #[must_use]
    pub fn ever_blocks(&self, event: &Event) -> bool {
        match self {
            Self::Blocks { set, .. } => set.contains(event),
            Self::Alternates { events, .. } => events.iter().any(|name| name == event.name()),
            Self::Asks { .. } | Self::Acts { .. } | Self::Echoes { .. } => false,
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Asks { event, every, patience } => {
                write!(f, "asks for {event}, resting {}", Seconds(*every))?;
                patience.map_or(Ok(()), |patience| write!(f, ", giving up after {}", Seconds(patience)))
            }
            Self::Blocks { set, on, off, hold } => {
                let kept = if *hold { ", even when it is lost" } else { "" };
                write!(f, "blocks {set} for {} after {}{kept}", Seconds(*on), Seconds(*off))
            }
            Self::Acts { holder, event } => write!(f, "does {event} when the block of {holder} is confirmed"),
            Self::Echoes { of, event, rest } => {
                write!(f, "answers {of} with {event}, resting {}", Seconds(*rest))
            }
            Self::Alternates { events: [a, b], every } => {
                write!(f, "asks for {a} and {b} in turn, blocking the other, resting {}", Seconds(*every))
            }
        }
    }
}

/// What a b-thread wants to be told about itself.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Told {
    me: NodeName,
    bthread: String,
}

impl Told {
    /// The facts after which a request may stay open for ever: who meets them has to ask anew.
    fn in_vain(&self) -> EventSet {
        let unknown = Unknown::any_at(&self.me).and(Unknown::bthread(&*self.bthread));
        unknown.or(Gap::any_at(&self.me))
    }
}

/// Where a b-thread that requests now and then stands; until when on its node's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Resting(Duration),
    Asking(Duration),
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Asker {
    event: String,
    every: Duration,
    patience: Option<Duration>,
    next: i64,
    phase: Phase,
    told: Told,
}

impl BThread for Asker {
    fn bid(&self) -> Option<Bid> {
        Some(match self.phase {
            Phase::Resting(until) => Bid::new().deadline(until),
            Phase::Asking(until) => {
                let event = Event::new(self.event.as_str()).with("n", self.next);
                let bid = Bid::new().request(event).wait_for(self.told.in_vain());
                if self.patience.is_some() { bid.deadline(until) } else { bid }
            }
        })
    }

    fn start(&mut self, cx: &mut Context) {
        self.phase = Phase::Resting(cx.now() + self.every);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match self.phase {
            Phase::Resting(_) => Phase::Asking(cx.now() + self.patience.unwrap_or_default()),
            Phase::Asking(_) => {
                self.next += i64::from(event.name() == self.event);
                Phase::Resting(cx.now() + self.every)
            }
        };
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Blocker {
    set: EventSet,
    on: Duration,
    off: Duration,
    hold: bool,
    blocking: bool,
    until: Duration,
}

impl BThread for Blocker {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().deadline(self.until);
        let bid = if self.hold { bid.hold_when_lost() } else { bid };
        Some(if self.blocking { bid.block(self.set.clone()) } else { bid })
    }

    fn start(&mut self, cx: &mut Context) {
        self.until = cx.now() + self.off;
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.blocking = !self.blocking;
        self.until = cx.now() + if self.blocking { self.on } else { self.off };
    }
}

/// See [`Role::Acts`]; `told` is about the block's holder.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Actor {
    told: Told,
    event: String,
    next: i64,
    acting: bool,
}

impl BThread for Actor {
    fn bid(&self) -> Option<Bid> {
        let Told { me, bthread } = &self.told;
        Some(if self.acting {
            let event = Event::new(self.event.as_str()).with("n", self.next);
            Bid::new().request(event).wait_for(facts::block_lapsed(me, bthread))
        } else {
            Bid::new().wait_for(facts::confirmed(me, bthread))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.next += i64::from(event.name() == self.event);
        self.acting = !self.acting;
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Echo {
    of: EventSet,
    event: String,
    rest: Duration,
    next: i64,
    phase: Phase,
    heard: bool,
    told: Told,
}

impl BThread for Echo {
    fn bid(&self) -> Option<Bid> {
        Some(match self.phase {
            Phase::Resting(until) => Bid::new().deadline(until),
            Phase::Asking(_) if self.heard => {
                let event = Event::new(self.event.as_str()).with("n", self.next);
                Bid::new().request(event).wait_for(self.told.in_vain())
            }
            Phase::Asking(_) => Bid::new().wait_for(self.of.clone()),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        match self.phase {
            Phase::Resting(until) => self.phase = Phase::Asking(until),
            Phase::Asking(_) if self.heard => {
                self.heard = false;
                self.next += i64::from(event.name() == self.event);
                self.phase = Phase::Resting(cx.now() + self.rest);
            }
            Phase::Asking(_) => self.heard = true,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Alternator {
    events: [String; 2],
    every: Duration,
    turn: i64,
    phase: Phase,
    told: Told,
}

impl Alternator {
    fn wanted_and_other(&self) -> (&str, &str) {
        let [a, b] = &self.events;
        if self.turn % 2 == 0 { (a, b) } else { (b, a) }
    }
}

impl BThread for Alternator {
    fn bid(&self) -> Option<Bid> {
        let (wanted, other) = self.wanted_and_other();
        let bid = Bid::new().block(EventSet::named(other));
        Some(match self.phase {
            Phase::Resting(until) => bid.deadline(until),
            Phase::Asking(_) => {
                bid.request(Event::new(wanted).with("n", self.turn)).wait_for(self.told.in_vain())
            }
        })
    }

    fn start(&mut self, cx: &mut Context) {
        self.phase = Phase::Resting(cx.now() + self.every);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match self.phase {
            Phase::Resting(until) => Phase::Asking(until),
            Phase::Asking(_) => {
                self.turn += i64::from(event.name() == self.wanted_and_other().0);
                Phase::Resting(cx.now() + self.every)
            }
        };
    }
}
