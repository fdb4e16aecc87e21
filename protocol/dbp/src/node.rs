//! One node of the fleet: its b-program and what joins it to the others.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use skein_bp::{Bid, Event, EventSet, Origin, Program, ProgramError, Selection};

use crate::explain::NodeExplanation;
use crate::facts::{self, count, tell};
use crate::held_blocks::{BlockNews, HeldBlocks};
use crate::history::History;
use crate::outbox::{Outbox, Sender};
use crate::peers::{Peer, Peers, Word};
use crate::stalls::{StallNews, Stalls};
use crate::stream::{Heard, REPAIR_CHUNK, Stream};
use crate::table::{BidTable, ProxyChange, Rights, TakenIn};
use crate::{
    BidAck, BidRecord, Message, NodeConfig, NodeName, Occurrence, OnLoss, Presence, Recipient, RemoteBid,
    Repair, first_two_chunks,
};

/// The shortest lease.
const LEAST_LEASE: Duration = Duration::from_millis(10);
/// First chunk of the events that the coordinator is home to.
const SWARM: &str = "swarm/";
/// The proxy that keeps `guarded` events back after a start.
const RESTART_GUARD: &str = "restart guard";
/// How often one step comes back to facts that its own selections have brought about.
const MOST_ROUNDS: usize = 16;
/// How many of its own last presences a node can tell from another's.
const PRESENCES_KNOWN: usize = 16;

/// An event that has happened, here or elsewhere, in the order in which this node's b-threads saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct Happened {
    /// What.
    pub event: Event,
    /// Where.
    pub home: NodeName,
    /// Its number there, from 1; 0 for an event without home, which does not travel.
    pub seq: u64,
    /// [`Origin::Occurred`] for what was selected elsewhere and for [`facts`].
    pub origin: Origin,
    /// The b-threads that requested it, remote ones as `node#bthread`.
    pub requested_by: Vec<Arc<str>>,
    /// When, on this node's clock.
    pub at: Duration,
}

/// Why a step did not go well. What happened in it counts all the same.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NodeError {
    /// The program cannot go on.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The b-threads kept requesting.
    #[error("{node}: the step did not settle within {limit} selections; look at the b-threads that kept requesting: {}", .bthreads.join(", "))]
    Unsettled {
        /// The node.
        node: NodeName,
        /// The limit, from [`NodeConfig::settle_limit`].
        limit: usize,
        /// Who requested the last events.
        bthreads: Vec<Arc<str>>,
    },
    /// A b-thread requests events of two homes at one synchronisation point, so that both could occur.
    #[error("{node}: b-thread `{bthread}` requests events of {} at one synchronisation point; request at one home only", .homes.join(" and "))]
    TwoHomes {
        /// The node.
        node: NodeName,
        /// The b-thread at fault.
        bthread: String,
        /// The homes.
        homes: Vec<String>,
    },
}

/// What a node has done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeStats {
    /// Events that occurred here.
    pub occurred: u64,
    /// Events of other homes that were delivered here.
    pub heard: u64,
    /// Messages that counted for nothing: from strangers, from lives that are over, or for someone else.
    pub ignored: u64,
}

/// One node: a program, and the protocol that joins it to the programs of the other nodes.
///
/// It has no clock and no socket. Hand it each message with [`handle`](Self::handle), let it go on with
/// [`step`](Self::step) after messages and no later than [`next_deadline`](Self::next_deadline), and then send what
/// [`take_outgoing`](Self::take_outgoing) gives. Times are those since the run began, on this node's clock.
#[derive(Clone, Debug)]
pub struct Node {
    config: NodeConfig,
    program: Program,
    /// The events that are selected here and told to others.
    home: EventSet,
    now: Duration,
    started: Option<Duration>,
    peers: Peers,
    /// As a home: the others' bids, and the own occurrences.
    table: BidTable,
    history: History,
    /// As a guest: what is bid elsewhere, and what occurs there.
    outboxes: BTreeMap<NodeName, Outbox>,
    streams: BTreeMap<NodeName, Stream>,
    held: HeldBlocks,
    stalls: Stalls,
    deliveries: VecDeque<Delivery>,
    presence_due: Duration,
    presences: VecDeque<Duration>,
    doubles: BTreeSet<u64>,
    guarding: bool,
    seen_revision: Option<u64>,
    stalls_due: bool,
    /// B-threads that request what can go nowhere, or at two homes: at which synchronisation point that was reported.
    unroutable: BTreeMap<String, u64>,
    two_homed: BTreeMap<String, u64>,
    outgoing: Vec<(Recipient, Message)>,
    selections: Vec<Happened>,
    stats: NodeStats,
}

/// What the program is to be told before it goes on.
#[derive(Clone, Debug)]
enum Delivery {
    /// A fact of this node's own; with a b-thread, only while that is at the synchronisation point.
    Fact(Event, Option<(String, u64)>),
    /// What has occurred elsewhere.
    Occurrence(Occurrence),
}

/// Where an event is decided.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Home {
    /// Here.
    Here,
    /// Wherever it is selected: it has no home and does not travel.
    Local,
    /// At another member of the roster.
    Elsewhere(NodeName),
    /// At a node that is not in the roster.
    Unroutable,
}

/// Making and feeding a node.
impl Node {
    /// A node that runs `program`. Settings out of their range are brought into it.
    #[must_use]
    pub fn new(mut config: NodeConfig, mut program: Program) -> Self {
        let lease = u64::try_from(config.lease.max(LEAST_LEASE).as_millis()).unwrap_or(u64::MAX);
        config.lease = Duration::from_millis(lease);
        config.roster.retain(|member| *member != config.name);
        config.roster.sort();
        config.roster.dedup();
        let mut home = EventSet::prefix(format!("{}/", config.name));
        if config.coordinator.as_ref() == Some(&config.name) {
            home = home.or(EventSet::prefix(SWARM));
        }
        let homeless = EventSet::from("*").or(EventSet::from("*/*").and(EventSet::prefix(SWARM).not()));
        program.set_home(home.clone().or(homeless));
        let guarding = !config.guarded.is_none();
        if guarding {
            program.put_proxy(RESTART_GUARD, &Bid::new().block(config.guarded.clone()));
        }
        let facts = facts::all(&config.name);
        let never = facts.clone().or(config.safety.clone()).or(config.gateway.clone());
        let rights = Rights {
            home: home.clone(),
            blockable: home.clone().and(never.not()),
            facts,
            safety: config.safety.clone(),
            gateway: config.gateway.clone(),
            priority: config.remote_priority.clone(),
            longest_lease: config.longest_lease.max(config.lease),
        };
        Self {
            peers: Peers::new(config.roster.iter().cloned(), config.lease),
            table: BidTable::new(config.incarnation, rights),
            history: History::new(config.history),
            outboxes: config.roster.iter().map(|member| (member.clone(), Outbox::new())).collect(),
            streams: config.roster.iter().map(|member| (member.clone(), Stream::default())).collect(),
            program,
            home,
            now: Duration::ZERO,
            started: None,
            held: HeldBlocks::default(),
            stalls: Stalls::default(),
            deliveries: VecDeque::new(),
            presence_due: Duration::ZERO,
            presences: VecDeque::new(),
            doubles: BTreeSet::new(),
            guarding,
            seen_revision: None,
            stalls_due: true,
            unroutable: BTreeMap::new(),
            two_homed: BTreeMap::new(),
            outgoing: Vec::new(),
            selections: Vec::new(),
            stats: NodeStats::default(),
            config,
        }
    }

    /// Puts an event from outside at the end of the program's queue. One that has its home elsewhere is not taken in
    /// but reported as `misdirected`: it can only be requested there.
    pub fn enqueue(&mut self, event: impl Into<Event>) {
        let event = event.into();
        match self.home_of(&event) {
            Home::Here | Home::Local => self.program.enqueue(event),
            Home::Elsewhere(_) | Home::Unroutable => {
                self.fact(facts::MISDIRECTED, |fact| fact.with("event", event.name()))
            }
        }
    }

    /// Takes in a message. What comes of it shows at the next [`step`](Self::step).
    pub fn handle(&mut self, now: Duration, message: Message) {
        self.set_clock(now);
        let counts = match message {
            message if *message.sender() == self.config.name => self.hear_own_name(&message),
            Message::Bid(record) => record.home == self.config.name && self.take_in_bids(&record),
            Message::Ack(ack) => {
                ack.node == self.config.name
                    && ack.incarnation == self.config.incarnation
                    && self.take_in_ack(ack)
            }
            Message::Occurrence(occurrence) => self.take_in_occurrence(occurrence),
            Message::Repair(repair) => {
                repair.home == self.config.name
                    && repair.incarnation == self.config.incarnation
                    && self.repeat_occurrences(&repair)
            }
            Message::Presence(presence) => self.take_in_presence(&presence),
        };
        self.stats.ignored += u64::from(!counts);
    }

    /// Goes on: lets go of what has lapsed, tells the program what has happened elsewhere, lets it select until it
    /// settles, and states its new bids to the other homes.
    ///
    /// # Errors
    /// When the program fails or does not settle, or breaks the rule of one home. The node can go on after any of them.
    pub fn step(&mut self, now: Duration) -> Result<(), NodeError> {
        self.set_clock(now);
        self.let_go_of_the_lapsed();
        let outcome = self.run();
        self.send_what_is_due();
        outcome
    }

    /// The messages to send, in order.
    pub fn take_outgoing(&mut self) -> Vec<(Recipient, Message)> {
        std::mem::take(&mut self.outgoing)
    }

    /// What has happened since the last call, here and elsewhere, in the order in which the program saw it.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    /// When [`step`](Self::step) is due even if no message comes.
    #[must_use]
    pub fn next_deadline(&self) -> Duration {
        if self.started.is_none() || !self.deliveries.is_empty() {
            return self.now;
        }
        let lease = self.config.lease;
        let guard = self.guarding.then(|| self.guard_ends());
        [self.program.next_deadline(), self.peers.next_deadline(), self.table.next_deadline(), guard]
            .into_iter()
            .chain(self.outboxes.values().map(|outbox| outbox.next_deadline(lease)))
            .chain(self.streams.values().map(Stream::next_deadline))
            .chain([self.held.next_deadline(|home, bthread, sync| {
                self.outboxes.get(home)?.kept_until(bthread, sync, lease)
            })])
            .flatten()
            .fold(self.presence_due, Duration::min)
    }
}

/// Asking a node.
impl Node {
    /// Its name.
    #[must_use]
    pub fn name(&self) -> &NodeName {
        &self.config.name
    }

    /// Its incarnation.
    #[must_use]
    pub fn incarnation(&self) -> u64 {
        self.config.incarnation
    }

    /// Its program.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Its program, to add b-threads to.
    pub fn program_mut(&mut self) -> &mut Program {
        &mut self.program
    }

    /// The other members of the roster, and how they do.
    pub fn peers(&self) -> impl Iterator<Item = (&NodeName, &Peer)> {
        self.peers.iter()
    }

    /// What it has done so far.
    #[must_use]
    pub fn stats(&self) -> NodeStats {
        self.stats
    }

    /// Who requests, blocks and waits for the events of a set, and behind each remote b-thread its node and the age
    /// of its lease: `node.explain("uav/3/takeoff")`.
    #[must_use]
    pub fn explain(&self, question: impl Into<EventSet>) -> NodeExplanation {
        let local = self.program.explain(question);
        let requesters = local.requested.iter().map(|(name, _)| name);
        let others = local.blocked.iter().chain(&local.waiting).map(|(name, _)| name);
        let names: BTreeSet<&Arc<str>> = requesters.chain(others).collect();
        let remote = names.into_iter().filter_map(|name| self.table.party(name, self.now)).collect();
        NodeExplanation { local, remote }
    }

    fn home_of(&self, event: &Event) -> Home {
        if self.home.contains(event) {
            return Home::Here;
        }
        let home = if event.name().starts_with(SWARM) {
            self.config.coordinator.as_ref()
        } else {
            let Some(prefix) = first_two_chunks(event.name()) else { return Home::Local };
            self.outboxes.get_key_value(prefix).map(|(name, _)| name)
        };
        home.map_or(Home::Unroutable, |name| Home::Elsewhere(name.clone()))
    }

    /// The synchronisation point at which a b-thread of this node is.
    fn sync_of(&self, bthread: &str) -> Option<u64> {
        self.program.bids().find(|(name, _, _)| *name == bthread).map(|(_, _, sync)| sync)
    }
}

/// Taking in messages. Each function says whether the message counted.
impl Node {
    fn set_clock(&mut self, now: Duration) {
        self.now = self.now.max(now);
        self.started.get_or_insert(self.now);
    }

    /// How long this node has been up.
    fn up(&self) -> Duration {
        self.now - self.started.unwrap_or(self.now)
    }

    fn fact(&mut self, what: &str, data: impl FnOnce(Event) -> Event) {
        self.deliveries.push_back(Delivery::Fact(data(tell(&self.config.name, what)), None));
    }

    /// Notes that `node` lives in `incarnation`; false if that life is over.
    fn hear(&mut self, node: &NodeName, incarnation: u64) -> bool {
        let word = self.peers.hear(self.now, node, incarnation);
        match word {
            Word::Fenced => return false,
            Word::Alive => return true,
            Word::Back => {}
            Word::Born { was_alive } => {
                if was_alive {
                    self.fact(facts::PEER_LOST, |fact| fact.with("node", node.as_str()));
                }
                self.begin_life(node, incarnation);
            }
        }
        self.fact(facts::PEER_JOINED, |fact| {
            fact.with("node", node.as_str()).with("incarnation", count(incarnation))
        });
        // So that the other one need not wait for the next sign of life.
        self.presence_due = self.now;
        true
    }

    /// `node` lives in a new incarnation: nothing of the old one goes on.
    fn begin_life(&mut self, node: &NodeName, incarnation: u64) {
        let changes = self.table.drop_life(node);
        self.change_proxies(changes);
        let mut heard = VecDeque::new();
        if let Some(stream) = self.streams.get_mut(node) {
            stream.restart(incarnation, &mut heard);
        }
        self.deliver(node, heard);
        self.address_home(node, incarnation);
    }

    /// Addresses requests to the present life of `node`, once it is known from where on its occurrences are heard: what
    /// it serves then cannot be missed.
    fn address_home(&mut self, node: &NodeName, incarnation: u64) {
        let Some(outbox) = self.outboxes.get_mut(node) else { return };
        if !self.streams.get(node).is_some_and(Stream::has_begun)
            || outbox.home_incarnation() == Some(incarnation)
        {
            return;
        }
        for bid in outbox.home_restarted(incarnation) {
            for event in &bid.requests {
                self.fact(facts::UNKNOWN, |fact| {
                    fact.with("event", event.name())
                        .with("bthread", bid.bthread.as_str())
                        .with("home", node.as_str())
                });
            }
        }
    }

    fn change_proxies(&mut self, changes: Vec<ProxyChange>) {
        self.stalls_due |= !changes.is_empty();
        for (proxy, bid) in changes {
            match bid {
                Some(bid) => self.program.put_proxy(proxy, &bid),
                None => {
                    self.program.remove_proxy(&proxy);
                }
            }
        }
    }

    fn deliver(&mut self, home: &NodeName, heard: VecDeque<Heard>) {
        for heard in heard {
            match heard {
                Heard::Occurrence(occurrence) => self.deliveries.push_back(Delivery::Occurrence(occurrence)),
                Heard::Gap { from, to } => self.fact(facts::GAP, |fact| {
                    fact.with("home", home.as_str()).with("from", count(from)).with("to", count(to))
                }),
            }
        }
    }

    fn take_in_bids(&mut self, record: &BidRecord) -> bool {
        if !self.hear(&record.node, record.incarnation) {
            return false;
        }
        let (taken, changes) = self.table.take_in(self.now, record, &self.history);
        self.change_proxies(changes);
        if taken == TakenIn::No {
            return false;
        }
        let ack = BidAck {
            home: self.config.name.clone(),
            home_incarnation: self.config.incarnation,
            node: record.node.clone(),
            incarnation: record.incarnation,
            epoch: record.epoch,
            sent_at: record.sent_at,
            latest_seq: self.history.latest_seq(),
            refused: self.table.refused(&record.node).to_vec(),
        };
        self.outgoing.push((Recipient::Node(record.node.clone()), Message::Ack(ack)));
        true
    }

    fn take_in_ack(&mut self, ack: BidAck) -> bool {
        if !self.hear(&ack.home, ack.home_incarnation) {
            return false;
        }
        if let Some(stream) = self.streams.get_mut(&ack.home) {
            stream.latest_is(ack.latest_seq);
        }
        let home = ack.home.clone();
        let refused = self.outboxes.get_mut(&home).map(|outbox| outbox.acknowledged(self.now, ack).to_vec());
        for refusal in refused.into_iter().flatten() {
            self.fact(facts::REFUSED, |fact| {
                fact.with("bthread", refusal.bthread.as_str())
                    .with("home", home.as_str())
                    .with("reason", refusal.reason.as_str())
            });
        }
        true
    }

    fn take_in_occurrence(&mut self, occurrence: Occurrence) -> bool {
        let home = occurrence.home.clone();
        if !self.hear(&home, occurrence.incarnation) {
            return false;
        }
        let mut heard = VecDeque::new();
        if let Some(stream) = self.streams.get_mut(&home) {
            stream.occurrence(occurrence, &mut heard);
        }
        self.deliver(&home, heard);
        true
    }

    fn take_in_presence(&mut self, presence: &Presence) -> bool {
        if !self.hear(&presence.node, presence.incarnation) {
            return false;
        }
        let lease = Duration::from_millis(presence.lease_ms);
        let longest = self.config.longest_lease.max(self.config.lease);
        self.peers.set_lease(&presence.node, lease.clamp(LEAST_LEASE, longest));
        // Whoever started within a lease of this node counts as having started with it.
        let from_start = presence.up <= self.up() + self.config.lease;
        let mut heard = VecDeque::new();
        if let Some(stream) = self.streams.get_mut(&presence.node) {
            stream.presence(presence, from_start, &mut heard);
        }
        self.deliver(&presence.node, heard);
        self.address_home(&presence.node, presence.incarnation);
        true
    }

    fn repeat_occurrences(&mut self, repair: &Repair) -> bool {
        if !self.outboxes.contains_key(&repair.requester) {
            return false;
        }
        let to = repair.to_seq.min(repair.from_seq.saturating_add(REPAIR_CHUNK - 1));
        let again = self.history.range(repair.from_seq, to).cloned();
        let again = again
            .map(|occurrence| (Recipient::Node(repair.requester.clone()), Message::Occurrence(occurrence)));
        self.outgoing.extend(again);
        if repair.from_seq < self.history.oldest_seq() {
            // The presence tells what cannot be had any more.
            self.presence_due = self.now;
        }
        true
    }

    /// A message under this node's own name: its own, a late one of its former life, or another process's.
    fn hear_own_name(&mut self, message: &Message) -> bool {
        let Message::Presence(presence) = message else { return true };
        let own = presence.incarnation == self.config.incarnation && self.presences.contains(&presence.up);
        let of_a_former_life =
            presence.incarnation < self.config.incarnation && self.up() < self.config.lease;
        if !own && !of_a_former_life && self.doubles.insert(presence.incarnation) {
            self.fact(facts::DUPLICATE_NAME, |fact| fact.with("incarnation", count(presence.incarnation)));
        }
        true
    }
}

/// Going on.
impl Node {
    fn let_go_of_the_lapsed(&mut self) {
        let lapsed = self.table.expire(self.now);
        self.change_proxies(lapsed);
        for node in self.peers.take_lost(self.now) {
            self.fact(facts::PEER_LOST, |fact| fact.with("node", node.as_str()));
        }
        if self.guarding
            && (self.now >= self.guard_ends() || self.peers.names().all(|member| self.table.knows(member)))
        {
            self.guarding = false;
            self.program.remove_proxy(RESTART_GUARD);
        }
    }

    fn guard_ends(&self) -> Duration {
        self.started.unwrap_or(self.now) + self.config.longest_lease.max(self.config.lease)
    }

    /// Lets the program run until it has settled and knows all facts that this brought about.
    fn run(&mut self) -> Result<(), NodeError> {
        let before = self.selections.len();
        let mut outcome = Ok(());
        for _ in 0..MOST_ROUNDS {
            self.check_held_blocks();
            if let Err(error) = self.run_program(before) {
                outcome = Err(error);
            }
            if let Err(error) = self.state_bids() {
                outcome = outcome.and(Err(error));
            }
            self.check_held_blocks();
            self.check_stalls();
            if self.deliveries.is_empty() || outcome.is_err() {
                break;
            }
        }
        outcome
    }

    fn run_program(&mut self, before: usize) -> Result<(), NodeError> {
        while let Some(delivery) = self.deliveries.pop_front() {
            match delivery {
                Delivery::Fact(_, Some((bthread, sync))) if self.sync_of(&bthread) != Some(sync) => {}
                Delivery::Fact(event, _) => {
                    self.program.occurred(event);
                    if let Some(selection) = self.program.step(self.now)? {
                        self.publish(selection);
                    }
                }
                Delivery::Occurrence(occurrence) => self.apply(occurrence)?,
            }
        }
        while let Some(selection) = self.program.step(self.now)? {
            self.publish(selection);
            let limit = self.config.settle_limit;
            if self.selections.len() - before > limit {
                let recent = self
                    .selections
                    .iter()
                    .rev()
                    .take(limit / 2)
                    .flat_map(|happened| happened.requested_by.iter().cloned());
                let bthreads = recent.collect::<BTreeSet<_>>().into_iter().collect();
                return Err(NodeError::Unsettled { node: self.config.name.clone(), limit, bthreads });
            }
        }
        Ok(())
    }

    /// Tells the program what has occurred elsewhere.
    fn apply(&mut self, occurrence: Occurrence) -> Result<(), NodeError> {
        let Occurrence { home, seq, event, requests_served, .. } = occurrence;
        if self.home_of(&event) != Home::Elsewhere(home.clone()) {
            // A home decides on its own events only.
            self.stats.ignored += 1;
            return Ok(());
        }
        for request in &requests_served {
            let ours = request.node == self.config.name;
            let wanted = request.incarnation == self.config.incarnation
                && self.sync_of(&request.bthread) == Some(request.sync);
            if ours && !wanted {
                self.fact(facts::ORPHAN, |fact| {
                    fact.with("event", event.name())
                        .with("home", home.as_str())
                        .with("bthread", request.bthread.as_str())
                });
            }
        }
        self.program.occurred(event.clone());
        self.program.step(self.now)?;
        self.stats.heard += 1;
        self.stalls_due = true;
        let requested_by = requests_served
            .iter()
            .map(|request| format!("{}#{}", request.node, request.bthread).into())
            .collect();
        self.selections.push(Happened {
            event,
            home,
            seq,
            origin: Origin::Occurred,
            requested_by,
            at: self.now,
        });
        Ok(())
    }

    /// Numbers what was selected here and tells it to all.
    fn publish(&mut self, selection: Selection) {
        let Selection { event, origin, requested_by, .. } = selection;
        let (served, proxies) = self.table.serve(&requested_by);
        self.change_proxies(proxies);
        self.stalls_due = true;
        self.stats.occurred += 1;
        let travels = self.home.contains(&event);
        let seq = if travels { self.history.next_seq() } else { 0 };
        if travels {
            let occurrence = Occurrence {
                home: self.config.name.clone(),
                incarnation: self.config.incarnation,
                seq,
                event: event.clone(),
                requests_served: served,
                at: self.now,
            };
            self.history.push(occurrence.clone());
            self.outgoing.push((Recipient::All, Message::Occurrence(occurrence)));
        }
        self.selections.push(Happened {
            event,
            home: self.config.name.clone(),
            seq,
            origin,
            requested_by,
            at: self.now,
        });
    }

    /// States to each other home what the b-threads now bid for its events.
    fn state_bids(&mut self) -> Result<(), NodeError> {
        let revision = self.program.revision();
        if self.seen_revision.replace(revision) == Some(revision) {
            return Ok(());
        }
        self.stalls_due = true;
        let mut outcome = Ok(());
        let mut by_home: BTreeMap<NodeName, Vec<RemoteBid>> = BTreeMap::new();
        let mut stated = BTreeMap::new();
        let bids: Vec<(String, Bid, u64)> =
            self.program.bids().map(|(name, bid, sync)| (name.into(), bid.clone(), sync)).collect();
        for (bthread, bid, sync) in bids.iter().filter(|(_, _, sync)| *sync > 0) {
            let requests = self.requests_by_home(bthread, bid, *sync);
            if let Err(error) = self.check_one_home(bthread, bid, *sync) {
                outcome = Err(error);
            }
            let blocked_homes = self.homes_concerned(bid.blocks());
            if !blocked_homes.is_empty() || self.awaits_confirmation(bthread, bid, *sync) {
                stated.insert(bthread.clone(), *sync);
                self.held.state(bthread, *sync, blocked_homes.clone());
            }
            for home in requests.keys().chain(&blocked_homes).collect::<BTreeSet<_>>() {
                let block = if blocked_homes.contains(home) { bid.blocks().clone() } else { EventSet::None };
                by_home.entry(home.clone()).or_default().push(RemoteBid {
                    bthread: bthread.clone(),
                    sync: *sync,
                    requests: requests.get(home).cloned().unwrap_or_default(),
                    block,
                    priority: bid.given_priority(),
                    on_loss: OnLoss::Release,
                });
            }
        }
        self.held.retain(&stated);
        for (home, outbox) in &mut self.outboxes {
            outbox.state(by_home.remove(home).unwrap_or_default());
        }
        outcome
    }

    /// What a b-thread requests elsewhere. Requests that can go nowhere are reported once.
    fn requests_by_home(&mut self, bthread: &str, bid: &Bid, sync: u64) -> BTreeMap<NodeName, Vec<Event>> {
        let mut requests: BTreeMap<NodeName, Vec<Event>> = BTreeMap::new();
        for event in bid.requests() {
            match self.home_of(event) {
                Home::Here | Home::Local => {}
                Home::Elsewhere(home) => requests.entry(home).or_default().push(event.clone()),
                Home::Unroutable => {
                    if self.unroutable.insert(bthread.into(), sync) != Some(sync) {
                        self.fact(facts::UNROUTABLE, |fact| {
                            fact.with("event", event.name()).with("bthread", bthread)
                        });
                    }
                }
            }
        }
        requests
    }

    /// One synchronisation point requests at one home only; a breach is reported once.
    fn check_one_home(&mut self, bthread: &str, bid: &Bid, sync: u64) -> Result<(), NodeError> {
        let homes: BTreeSet<String> = bid
            .requests()
            .iter()
            .filter_map(|event| match self.home_of(event) {
                Home::Here => Some(self.config.name.to_string()),
                Home::Elsewhere(home) => Some(home.to_string()),
                Home::Local | Home::Unroutable => None,
            })
            .collect();
        if homes.len() > 1 && self.two_homed.insert(bthread.into(), sync) != Some(sync) {
            let homes = homes.into_iter().collect();
            return Err(NodeError::TwoHomes {
                node: self.config.name.clone(),
                bthread: bthread.into(),
                homes,
            });
        }
        Ok(())
    }

    /// The other homes whose events a set may hold.
    fn homes_concerned(&self, set: &EventSet) -> Vec<NodeName> {
        if set.is_none() {
            return Vec::new();
        }
        let concerns = |home: &NodeName| {
            set.could_match_home(home.as_str())
                || (self.config.coordinator.as_ref() == Some(home)
                    && set.may_overlap(&EventSet::prefix(SWARM)))
        };
        self.peers.names().filter(|home| concerns(home)).cloned().collect()
    }

    /// Whether a b-thread blocks something and waits to hear that this is sure. Then it hears so even if no other home
    /// is concerned, as in a fleet of one.
    fn awaits_confirmation(&self, bthread: &str, bid: &Bid, sync: u64) -> bool {
        !bid.blocks().is_none() && bid.waits().contains(&confirmation(&self.config.name, bthread, sync))
    }

    fn check_held_blocks(&mut self) {
        let (outboxes, lease) = (&self.outboxes, self.config.lease);
        let news = self
            .held
            .check(self.now, |home, bthread, sync| outboxes.get(home)?.kept_until(bthread, sync, lease));
        for news in news {
            let (fact, bthread, sync) = match news {
                BlockNews::Confirmed { bthread, sync } => {
                    (confirmation(&self.config.name, &bthread, sync), bthread, sync)
                }
                BlockNews::Lapsed { bthread, sync, home } => {
                    let fact = tell(&self.config.name, facts::BLOCK_LAPSED);
                    (fact.with("bthread", bthread.as_str()).with("home", home.as_str()), bthread, sync)
                }
            };
            self.deliveries.push_back(Delivery::Fact(fact, Some((bthread, sync))));
        }
    }

    fn check_stalls(&mut self) {
        if !std::mem::take(&mut self.stalls_due) {
            return;
        }
        let mut stalled: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        if self.table.has_blocks() {
            let local = self
                .program
                .bids()
                .flat_map(|(_, bid, _)| bid.requests())
                .filter(|event| self.home.contains(event));
            for event in local.chain(self.table.open_requests()) {
                for by in self.table.blockers_of(event) {
                    stalled.entry(event.name().into()).or_default().insert(by);
                }
            }
        }
        for news in self.stalls.update(stalled) {
            match news {
                StallNews::Stalled { event, by } => {
                    self.fact(facts::STALLED, |fact| fact.with("event", event).with("by", by))
                }
                StallNews::Unstalled { event } => {
                    self.fact(facts::UNSTALLED, |fact| fact.with("event", event))
                }
            }
        }
    }

    fn send_what_is_due(&mut self) {
        let sender = Sender {
            node: &self.config.name,
            incarnation: self.config.incarnation,
            lease: self.config.lease,
        };
        for (home, outbox) in &mut self.outboxes {
            let applied = self.streams.get(home).map_or(0, Stream::applied);
            if let Some(record) = outbox.due(self.now, &sender, home, applied) {
                self.outgoing.push((Recipient::Node(home.clone()), Message::Bid(record)));
            }
        }
        for (home, stream) in &mut self.streams {
            let Some((incarnation, holes)) = stream.repair(self.now, self.config.lease / 10) else {
                continue;
            };
            for (from_seq, to_seq) in holes {
                let requester = self.config.name.clone();
                let repair = Repair { home: home.clone(), incarnation, from_seq, to_seq, requester };
                self.outgoing.push((Recipient::Node(home.clone()), Message::Repair(repair)));
            }
        }
        if self.now >= self.presence_due {
            self.presence_due = self.now + self.config.lease / 3;
            self.send_presence();
        }
    }

    fn send_presence(&mut self) {
        let up = self.up();
        if self.presences.len() == PRESENCES_KNOWN {
            self.presences.pop_front();
        }
        self.presences.push_back(up);
        let presence = Presence {
            node: self.config.name.clone(),
            incarnation: self.config.incarnation,
            up,
            latest_seq: self.history.latest_seq(),
            oldest_seq: self.history.oldest_seq(),
            lease_ms: u64::try_from(self.config.lease.as_millis()).unwrap_or(u64::MAX),
        };
        self.outgoing.push((Recipient::All, Message::Presence(presence)));
    }
}

/// The fact that a b-thread's block is confirmed.
fn confirmation(node: &NodeName, bthread: &str, sync: u64) -> Event {
    tell(node, facts::CONFIRMED).with("bthread", bthread).with("sync", count(sync))
}
