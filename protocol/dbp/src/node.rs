//! One node of the fleet: its b-program and what joins it to the others.

mod bidding;
mod deciding;
mod receiving;
mod running;
mod sending;
mod standing;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use skein_bp::catalogue::Declared;
use skein_bp::{Bid, Event, EventSet, Origin, Program, ProgramError, Selection};

use crate::explain::NodeExplanation;
use crate::facts::{self, Confirmed, Misdirected};
use crate::held_blocks::{BlockNews, HeldBlocks};
use crate::history::History;
use crate::joint::Joint;
use crate::outbox::Outbox;
use crate::peers::{Peer, Peers};
use crate::stalls::Stalls;
use crate::stream::Stream;
use crate::table::{BidTable, Rights};
use crate::{
    Board, BoardLease, BoardRow, Kept, Message, NodeConfig, NodeName, Occurrence, Recipient, Roster, SWARM,
    first_two_chunks,
};

pub use deciding::LIFT;

/// The shortest lease.
const LEAST_LEASE: Duration = Duration::from_millis(10);
/// The proxy that keeps `guarded` events back after a start.
const RESTART_GUARD: &str = "restart guard";
/// How often one step comes back to facts that its own selections have brought about.
const MOST_ROUNDS: usize = 16;
/// A node whose name another process has is told so again after this long, while that goes on.
const REPEAT_DOUBLE: Duration = Duration::from_secs(2);
/// How many of its own last presences a node can tell from another's.
const PRESENCES_KNOWN: usize = 16;

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
    /// Why this event and no other, as its home tells it.
    pub choice: Option<Arc<str>>,
    /// When, on this node's clock.
    pub at: Duration,
}

/// The channel's part in the run: what it has changed on the program's board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelMove {
    /// How many of the selections that [`Node::take_selections`] gives next came before it.
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

/// Why a step did not go well. What happened in it counts all the same.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NodeError {
    /// The program cannot go on.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The b-threads kept requesting.
    #[error("{node}: the step did not settle within {limit} selections; look at the b-threads that kept requesting: {}", .bthreads.join(", "))]
    Unsettled {
        node: NodeName,
        /// The limit, from [`NodeConfig::settle_limit`].
        limit: usize,
        /// Who requested the last events.
        bthreads: Vec<Arc<str>>,
    },
    /// A b-thread requests events of two homes at one synchronisation point, so that both could occur.
    #[error("{node}: b-thread `{bthread}` requests events of {} at one synchronisation point; request at one home only", .homes.join(" and "))]
    TwoHomes {
        node: NodeName,
        /// The b-thread at fault.
        bthread: String,
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
    /// What the clock of its b-threads shows, where a verifier holds that; else it is this node's own.
    held_clock: Option<Duration>,
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
    /// Joint events: none if there are none.
    joint: Option<Joint>,
    /// Whether joint events are kept back.
    guards_joint: bool,
    /// Whether the coordinator has asked for word since it wants to decide.
    asking: bool,
    /// Whether what this node must keep has changed, but for the table's blocks.
    unsaved: bool,
    deliveries: VecDeque<Delivery>,
    presence_due: Duration,
    presences: VecDeque<Duration>,
    /// When it was last told that another process has this node's name.
    double_told: Option<Duration>,
    guarding: bool,
    seen_revision: Option<u64>,
    stalls_due: bool,
    /// B-threads that request what can go nowhere, or at two homes: at which synchronisation point that was reported.
    unroutable: BTreeMap<String, u64>,
    two_homed: BTreeMap<String, u64>,
    outgoing: Vec<(Recipient, Message)>,
    selections: Vec<Happened>,
    /// What the channel has changed on the program's board, where that is recorded.
    channel_moves: Option<Vec<ChannelMove>>,
    stats: NodeStats,
}

/// Takes the next step of a program that has been told all: selects an event, or finds that there is none to select.
pub(crate) type Select<'a> =
    dyn FnMut(&mut Program, Duration) -> Result<Option<Selection>, ProgramError> + 'a;

/// What the program is to be told before it goes on.
#[derive(Clone, Debug)]
enum Delivery {
    /// A fact of this node's own.
    Fact(Event),
    /// Whether a b-thread's block is sure.
    Block(BlockNews),
    /// What has occurred elsewhere.
    Occurrence(Occurrence),
    /// What a former life of this node has decided.
    Recalled(Occurrence),
}

/// Where an event is decided.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Home {
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
        let home = EventSet::prefix(format!("{}/", config.name));
        program.set_home(home.clone().or(deciding::homeless()));
        let guarding = !config.guarded.is_none();
        if guarding {
            program.put_proxy(RESTART_GUARD, &Bid::new().block(config.guarded.clone()));
        }
        let facts = facts::all(&config.name);
        let mut rights = Rights {
            home: EventSet::None,
            blockable: EventSet::None,
            facts,
            safety: config.safety.clone(),
            gateway: config.gateway.clone(),
            orders: deciding::orders(&config.name),
            authority: config.authority.clone(),
            priority: config.remote_priority.clone(),
            longest_lease: config.longest_lease.max(config.lease),
            durable: config.durable,
            #[cfg(feature = "mutants")]
            mutant: config.mutant,
        };
        rights.set_home(home.clone());
        let Kept { blocks, roster, term, mut decisions } = std::mem::take(&mut config.kept);
        let known = |name: &NodeName| config.roster.contains(name);
        let (table, kept) = BidTable::new(
            config.incarnation,
            rights,
            blocks.into_iter().filter(|block| known(&block.node)).collect(),
        );
        let roster = roster.into_iter().chain(config.joint.clone()).max_by_key(|roster| roster.term);
        let mut node = Self {
            peers: Peers::new(config.roster.iter().cloned(), config.lease),
            table,
            history: History::new(config.history),
            outboxes: config.roster.iter().map(|member| (member.clone(), Outbox::new())).collect(),
            streams: config.roster.iter().map(|member| (member.clone(), Stream::default())).collect(),
            program,
            home,
            now: Duration::ZERO,
            held_clock: None,
            started: None,
            held: HeldBlocks::default(),
            stalls: Stalls::default(),
            joint: None,
            guards_joint: false,
            asking: false,
            unsaved: false,
            deliveries: VecDeque::new(),
            presence_due: Duration::ZERO,
            presences: VecDeque::new(),
            double_told: None,
            guarding,
            seen_revision: None,
            stalls_due: true,
            unroutable: BTreeMap::new(),
            two_homed: BTreeMap::new(),
            outgoing: Vec::new(),
            selections: Vec::new(),
            channel_moves: None,
            stats: NodeStats::default(),
            config,
        };
        node.change_proxies(kept);
        if roster.as_ref().is_none_or(|roster| roster.term != term) {
            decisions.clear();
        }
        node.begin_term(roster, decisions);
        node
    }

    /// Puts an event from outside at the end of the program's queue. One that has its home elsewhere is not taken in
    /// but reported as `misdirected`: it can only be requested there.
    pub fn enqueue(&mut self, event: impl Into<Event>) {
        let event = event.into();
        match self.home_of(&event) {
            Home::Here | Home::Local => self.program.enqueue(event),
            Home::Elsewhere(_) | Home::Unroutable => self.fact(Misdirected { event: event.name().into() }),
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
        self.step_by(now, &mut |program, now| program.step(now))
    }

    /// The same, with every selection made by `select`.
    pub(crate) fn step_by(&mut self, now: Duration, select: &mut Select<'_>) -> Result<(), NodeError> {
        self.set_clock(now);
        self.let_go_of_the_lapsed();
        let outcome = self.run(select);
        self.send_what_is_due();
        outcome
    }

    /// The messages to send, in order. Acknowledgements come last, so that no occurrence that a b-thread waits for
    /// elsewhere goes behind one.
    pub fn take_outgoing(&mut self) -> Vec<(Recipient, Message)> {
        let mut outgoing = std::mem::take(&mut self.outgoing);
        outgoing.sort_by_key(|(_, message)| matches!(message, Message::Ack(_)));
        outgoing
    }

    /// What this node must not forget, if that has changed since the last call: to be on disk before
    /// [`take_outgoing`](Self::take_outgoing) is sent.
    pub fn take_unsaved(&mut self) -> Option<Kept> {
        let blocks = self.table.take_unsaved();
        (std::mem::take(&mut self.unsaved) || blocks).then(|| self.kept())
    }

    /// What this node must not forget.
    #[must_use]
    pub fn kept(&self) -> Kept {
        let ordered = self.joint.as_ref().filter(|joint| self.config.joint.as_ref() != Some(&joint.roster));
        Kept {
            blocks: self.table.kept(),
            roster: ordered.map(|joint| joint.roster.clone()),
            term: self.term(),
            decisions: self.joint.as_ref().map(Joint::events).unwrap_or_default(),
        }
    }

    /// The roster of joint events in the present term.
    #[must_use]
    pub fn roster(&self) -> Option<&Roster> {
        self.joint.as_ref().map(|joint| &joint.roster)
    }

    /// What has happened since the last call, here and elsewhere, in the order in which the program saw it.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    /// Records from now on what the channel changes on the program's board, for one who replays the run; see
    /// [`take_channel_moves`](Self::take_channel_moves).
    pub fn record_channel(&mut self) {
        self.channel_moves.get_or_insert_default();
    }

    /// What the channel has changed since the last call, in order; to be taken together with the selections.
    pub fn take_channel_moves(&mut self) -> Vec<ChannelMove> {
        self.channel_moves.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// When [`step`](Self::step) is due even if no message comes.
    #[must_use]
    pub fn next_deadline(&self) -> Duration {
        if self.started.is_none() || !self.deliveries.is_empty() {
            return self.now;
        }
        let lease = self.config.lease;
        let guard = self.guarding.then(|| self.guard_ends());
        let decisions = self.joint.as_ref().filter(|joint| !joint.leads());
        let decisions = decisions.and_then(|joint| joint.stream.next_deadline());
        let program = self.program.next_deadline().filter(|_| self.held_clock.is_none());
        [program, self.peers.next_deadline(), self.table.next_deadline(), guard]
            .into_iter()
            .chain(self.outboxes.values().map(|outbox| outbox.next_deadline(lease)))
            .chain(self.streams.values().map(Stream::next_deadline))
            .chain([self
                .held
                .next_deadline(|home, bthread, sync| self.outboxes.get(home)?.upheld(bthread, sync, lease))])
            .chain([self.guard_due(), decisions])
            .flatten()
            .fold(self.presence_due, Duration::min)
    }
}

/// Asking a node.
impl Node {
    #[must_use]
    pub fn name(&self) -> &NodeName {
        &self.config.name
    }

    #[must_use]
    pub fn incarnation(&self) -> u64 {
        self.config.incarnation
    }

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

    /// The other homes that the present block of `bthread` concerns, each with whether it surely keeps the block now.
    pub fn kept_by(&self, bthread: &str) -> impl Iterator<Item = (&NodeName, bool)> {
        let held = self.held.get(bthread);
        let lease = self.config.lease;
        held.into_iter().flat_map(|(sync, homes)| homes.iter().map(move |home| (home, sync))).map(
            move |(home, sync)| {
                let upheld = self.outboxes.get(home).and_then(|outbox| outbox.upheld(bthread, sync, lease));
                (home, upheld.is_some_and(|upheld| self.now < upheld.until))
            },
        )
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

    /// Every bid on this node's table now.
    #[must_use]
    pub fn board(&self) -> Board {
        let blockers = |event: &Event| match self.home_of(event) {
            Home::Here | Home::Local => self.program.blockers(event).map(Into::into).collect(),
            Home::Elsewhere(_) | Home::Unroutable => Vec::new(),
        };
        let own = self.program.bids().map(|(bthread, bid, _)| BoardRow::new(bthread, bid, blockers));
        let remote = self.program.proxies().map(|(name, bid)| {
            let mut row = BoardRow::new(name, bid, blockers);
            if let Some(party) = self.table.party(name, self.now) {
                row.blocks = self.table.asked_block(name).cloned().unwrap_or_default();
                row.lease = Some(BoardLease { age: party.lease_age, length: party.lease });
            }
            row
        });
        let rows = own.chain(remote.filter(|row| !(row.requests.is_empty() && row.blocks.is_none())));
        Board::new(self.config.name.clone(), self.config.incarnation, self.now, rows.collect())
    }

    fn home_of(&self, event: &Event) -> Home {
        if self.home.contains(event) {
            return Home::Here;
        }
        let home = if event.name().starts_with(SWARM) {
            self.joint.as_ref().map(|joint| &joint.roster.coordinator)
        } else {
            let Some(prefix) = first_two_chunks(event.name()) else { return Home::Local };
            self.outboxes.get_key_value(prefix).map(|(name, _)| name)
        };
        home.map_or(Home::Unroutable, |name| Home::Elsewhere(name.clone()))
    }

    /// The synchronisation point at which a b-thread of this node is.
    pub(crate) fn sync_of(&self, bthread: &str) -> Option<u64> {
        self.program.bids().find(|(name, _, _)| *name == bthread).map(|(_, _, sync)| sync)
    }
}

/// What all parts of a node do.
impl Node {
    fn set_clock(&mut self, now: Duration) {
        self.now = self.now.max(now);
        self.started.get_or_insert(self.now);
    }

    /// What the clock of its b-threads shows.
    fn program_now(&self) -> Duration {
        self.held_clock.unwrap_or(self.now)
    }

    /// How long this node has been up.
    fn up(&self) -> Duration {
        self.now - self.started.unwrap_or(self.now)
    }

    /// Changes the program's board.
    fn change_board(&mut self, change: BoardChange) {
        self.stalls_due = true;
        change.apply(&mut self.program);
        if let Some(moves) = &mut self.channel_moves {
            moves.push(ChannelMove { after: self.selections.len(), change });
        }
    }

    fn fact(&mut self, fact: impl Declared) {
        self.deliveries.push_back(Delivery::Fact(fact.at(&self.config.name)));
    }
}

/// The fact that a b-thread's block is confirmed.
fn confirmation(node: &NodeName, bthread: &str, sync: u64) -> Event {
    Confirmed { bthread: bthread.into(), sync }.at(node)
}
