//! A small fleet over the in-memory network, and what its members say has happened.
#![allow(dead_code, missing_docs)] // Each test file uses a part of it.
#![allow(clippy::unwrap_used)] // A test fails by panicking.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeName};
use skein_wire::{Fleet, MemoryLink, MemoryStore, Network, NetworkConfig, NodeLink};

pub const TICK: Duration = Duration::from_millis(20);
pub const LEASE: Duration = Duration::from_secs(1);

pub fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

/// A hostile network: 30 % loss, repetition, reordering, and delays up to 300 ms.
pub fn hostile() -> NetworkConfig {
    NetworkConfig {
        latency: (Duration::from_millis(1), Duration::from_millis(300)),
        loss: 0.3,
        duplicate: 0.2,
        reorder: 0.5,
        range_m: None,
    }
}

/// One thing that a member has seen happen.
#[derive(Clone, Debug)]
pub struct Seen {
    pub at: Duration,
    pub node: NodeName,
    pub incarnation: u64,
    pub happened: Happened,
}

pub struct Member {
    pub node: NodeLink,
    pub link: MemoryLink,
}

/// The fleet. All members share one clock here; the protocol does not rely on that.
pub struct Swarm {
    pub network: Network,
    pub now: Duration,
    pub members: BTreeMap<NodeName, Member>,
    pub seen: Vec<Seen>,
    /// What each member must not forget.
    stores: BTreeMap<NodeName, MemoryStore>,
    roster: Vec<NodeName>,
}

impl Swarm {
    pub fn new(roster: &[&str], network: NetworkConfig, seed: u64) -> Self {
        let roster = roster.iter().map(|text| name(text)).collect();
        let network = Network::new(network, seed);
        Self {
            network,
            now: Duration::ZERO,
            members: BTreeMap::new(),
            seen: Vec::new(),
            stores: BTreeMap::new(),
            roster,
        }
    }

    pub fn config(&self, node: &str, incarnation: u64) -> NodeConfig {
        NodeConfig {
            lease: LEASE,
            longest_lease: LEASE,
            ..NodeConfig::new(name(node), incarnation, self.roster.clone())
        }
    }

    /// Starts a member; a second start is a restart, and finds what was kept if the member is durable.
    pub fn start_with(&mut self, mut config: NodeConfig, program: Program) {
        let node = config.name.clone();
        self.network.leave(&node);
        let link = self.network.join(&node);
        let fleet = Fleet::new("test").unwrap();
        let node_link = if config.durable {
            let store = self.stores.entry(node.clone()).or_default();
            config.kept = store.kept();
            NodeLink::durable(Node::new(config, program), fleet, Box::new(store.clone()))
        } else {
            NodeLink::new(Node::new(config, program), fleet)
        };
        self.members.insert(node, Member { node: node_link, link });
    }

    pub fn start(&mut self, node: &str, incarnation: u64, program: Program) {
        self.start_with(self.config(node, incarnation), program);
    }

    /// Stops a member at once, as a crash does.
    pub fn crash(&mut self, node: &str) {
        self.network.leave(&name(node));
        self.members.remove(&name(node));
    }

    pub fn node(&mut self, node: &str) -> &mut Node {
        self.members.get_mut(&name(node)).unwrap().node.node_mut()
    }

    /// One tick of every member; gives what was seen in it.
    pub fn tick(&mut self) -> &[Seen] {
        let before = self.seen.len();
        self.network.advance(self.now);
        for (node, member) in &mut self.members {
            member.node.pump(self.now, &mut member.link).unwrap();
            let incarnation = member.node.node().incarnation();
            for happened in member.node.node_mut().take_selections() {
                self.seen.push(Seen { at: self.now, node: node.clone(), incarnation, happened });
            }
            assert_eq!(member.node.stats().undecodable + member.node.stats().forged, 0);
        }
        self.now += TICK;
        &self.seen[before..]
    }

    pub fn run(&mut self, duration: Duration) {
        let end = self.now + duration;
        while self.now < end {
            self.tick();
        }
    }

    /// What `node` saw of the events of this name, with the times.
    pub fn saw<'a>(&'a self, node: &'a str, event: &'a str) -> impl Iterator<Item = &'a Seen> {
        self.seen.iter().filter(move |seen| seen.node.as_str() == node && seen.happened.event.name() == event)
    }

    /// What has occurred at `home` under this name.
    pub fn occurred<'a>(&'a self, home: &'a str, event: &'a str) -> impl Iterator<Item = &'a Seen> {
        self.saw(home, event).filter(move |seen| seen.happened.home.as_str() == home)
    }
}

pub fn program(seed: u64) -> Program {
    Program::new(ProgramConfig::vehicle(seed))
}

/// Requests `count` events of a kind, numbered, one after another, `every` so often; tells each by a local event.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Requester {
    pub event: String,
    pub count: i64,
    pub next: i64,
    pub every: Duration,
    pub resting_until: Option<Duration>,
}

impl Requester {
    pub fn new(event: &str, count: i64, every: Duration) -> Self {
        Self { event: event.into(), count, next: 1, every, resting_until: None }
    }
}

impl BThread for Requester {
    fn bid(&self) -> Option<Bid> {
        if self.next > self.count {
            return None;
        }
        Some(match self.resting_until {
            Some(until) => Bid::new().deadline(until),
            None => Bid::new().request(Event::new(self.event.as_str()).with("n", self.next)),
        })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        if self.resting_until.take().is_none() {
            self.next += 1;
            self.resting_until = (!self.every.is_zero()).then(|| cx.now() + self.every);
        }
    }
}

/// Blocks a set from one time to another, again and again.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Blocker {
    pub set: EventSet,
    pub on: Duration,
    pub off: Duration,
    pub blocking: bool,
    pub until: Duration,
}

impl Blocker {
    /// Begins with a pause of `off`, then blocks for `on`.
    pub fn new(set: impl Into<EventSet>, on: Duration, off: Duration) -> Self {
        Self { set: set.into(), on, off, blocking: false, until: off }
    }
}

impl BThread for Blocker {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().deadline(self.until);
        Some(if self.blocking { bid.block(self.set.clone()) } else { bid })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.blocking = !self.blocking;
        self.until = cx.now() + if self.blocking { self.on } else { self.off };
    }
}

/// States one bid for ever.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Always(pub Bid);

impl BThread for Always {
    fn bid(&self) -> Option<Bid> {
        Some(self.0.clone())
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {}
}
