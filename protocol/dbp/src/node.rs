//! One node of the fleet: its b-program and what joins it to the others.

mod hearing;
mod orders;
mod standing;
mod stepping;

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use skein_bp::{Bound, Event, EventSet, Explanation, Program, ProgramError, Selection};

use crate::board::{Board, BoardLease, BoardRow};
use crate::channel::Channel;
use crate::channel::peers::Peer;
use crate::clock::Clock;
use crate::config::NodeConfig;
use crate::error::NodeError;
use crate::facts::{DiskFails, DiskWorks, Misdirected};
use crate::guest::Guest;
use crate::home::Home;
use crate::home::table::RemoteParty;
use crate::joint::Joint;
use crate::joint::roster::Roster;
use crate::kept::Kept;
use crate::message::{Message, Recipient};
use crate::name::NodeName;
use crate::routes::{Route, Routes};
use crate::run::{ChannelMove, Happened, Run};

/// Counts of what a node has done so far.
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
    clock: Clock,
    /// Its own program.
    run: Run,
    /// The events that it decides, on its own bids and those of others.
    pub(crate) home: Home,
    /// Its bids for the events that others decide.
    pub(crate) guest: Guest,
    /// The events that all decide together.
    joint: Joint,
    /// The others, and what is heard from and sent to them.
    pub(crate) channel: Channel,
    /// The things that the disk does not take, as far as that has been told.
    disk_fails: BTreeSet<String>,
    stats: NodeStats,
}

/// The work that one member has made for a node since the start, and the entries that it makes it keep at present.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Caused {
    /// Facts that were told to all.
    pub facts_told: u64,
    /// Facts beyond its share, which were not told.
    pub facts_withheld: u64,
    /// Lives that it has begun more often than a process can.
    pub lives_refused: u64,
    /// Bids, refusals and served requests that are kept of it.
    pub entries: usize,
    /// About how many bytes these are.
    pub entry_bytes: usize,
    /// Its occurrences that wait behind a hole.
    pub pending: usize,
    /// About how many bytes these are.
    pub pending_bytes: usize,
}

/// Takes the next step of a program that has been told all: selects an event, or finds that there is none to select.
pub(crate) type Select<'a> =
    dyn FnMut(&mut Program, Duration) -> Result<Option<Selection>, ProgramError> + 'a;

/// Making and feeding a node.
impl Node {
    /// A node that runs `program`. Settings out of their range are brought into it.
    pub fn new(config: NodeConfig, program: Program) -> Self {
        let mut config = config.in_range();
        let Kept { blocks, roster, term, mut decisions } = std::mem::take(&mut config.kept);
        let mut run = Run::new(config.name.clone(), program);
        let mut node = Self {
            clock: Clock::default(),
            home: Home::new(&config, blocks, &mut run),
            guest: Guest::new(&config),
            joint: Joint::default(),
            channel: Channel::new(&config),
            disk_fails: BTreeSet::new(),
            stats: NodeStats::default(),
            run,
            config,
        };
        if let Some(roster) =
            roster.into_iter().chain(node.config.joint.clone()).max_by_key(|roster| roster.term)
        {
            if roster.term != term {
                decisions.clear();
            }
            node.joint.begin(roster, decisions, &node.config, &mut node.run);
        }
        node.take_up_roster();
        node
    }

    /// Puts an event from outside at the end of the program's queue. One that has its home elsewhere is not taken in
    /// but reported as `misdirected`: it can only be requested there.
    pub fn enqueue(&mut self, event: impl Into<Event>) {
        let event = event.into();
        match self.routes().of(&event) {
            Route::Here | Route::Local => self.run.program.enqueue(event),
            Route::Elsewhere(_) | Route::Unroutable => {
                self.run.fact(Misdirected { event: event.name().into() })
            }
        }
    }

    /// Takes in a message. What comes of it shows at the next [`step`](Self::step).
    pub fn handle(&mut self, now: Duration, message: Message) {
        self.clock.set(now);
        self.run.now = self.clock.now();
        self.stats.ignored += u64::from(!self.take_in(message));
    }

    /// Goes on: lets go of what has lapsed, tells the program what has happened elsewhere, lets it select until it
    /// settles, and states its new bids to the other homes.
    ///
    /// # Errors
    /// When the program fails or does not settle, or breaks the rule of one home. The node can go on after any of them.
    pub fn step(&mut self, now: Duration) -> Result<(), NodeError> {
        self.step_by(now, &mut |program, now| program.step(now))
    }

    /// The messages to send, in order. Acknowledgements come last, so that no occurrence that a b-thread waits for
    /// elsewhere goes behind one.
    pub fn take_outgoing(&mut self) -> Vec<(Recipient, Message)> {
        self.channel.take_outgoing()
    }

    /// The promises that must outlive this node, if they have changed since the last call: to be on disk
    /// before what depends on them is [sent](Self::sort_out).
    pub fn take_unsaved(&mut self) -> Option<Kept> {
        let blocks = self.home.table.take_unsaved();
        (self.joint.take_unsaved() || blocks).then(|| self.kept())
    }

    /// All that [`take_unsaved`](Self::take_unsaved) gave is on disk; the store works.
    pub fn saved(&mut self) {
        self.home.table.saved();
        self.joint.saved();
    }

    /// The store does not take what it is given. From now until it has [`saved`](Self::saved), no new promise
    /// is given: a block that would have to be kept is refused, nothing is decided together, and no new
    /// roster is taken on. What was on disk before stays promised.
    pub fn store_fails(&mut self) {
        let proxies = self.home.table.store_fails();
        self.run.change_proxies(proxies);
        self.joint.store_fails(&self.clock, self.config.lease, &mut self.run);
    }

    /// Tells the program once when the disk does not take `what` must be kept, and once when it does again.
    pub fn note_disk(&mut self, what: &str, trouble: Option<&str>) {
        let was_told = self.disk_fails.contains(what);
        match trouble {
            Some(why) if !was_told => {
                self.disk_fails.insert(what.to_owned());
                self.run.fact(DiskFails { what: what.into(), why: why.into() });
            }
            None if was_told => {
                self.disk_fails.remove(what);
                self.run.fact(DiskWorks { what: what.into() });
            }
            _ => {}
        }
    }

    /// Sorts out of some messages those that would let others rely on what is not on disk yet: they are left
    /// in `messages`, and the rest is given back, to be sent at once. A sign of life is sent without its word
    /// about joint events.
    pub fn sort_out(&self, messages: &mut Vec<(Recipient, Message)>) -> Vec<(Recipient, Message)> {
        let (depending, mut free): (Vec<_>, Vec<_>) =
            std::mem::take(messages).into_iter().partition(|(_, message)| match message {
                Message::Ack(ack) => self.home.table.owes(&ack.node),
                Message::Occurrence(occurrence) => occurrence.term > 0 && self.joint.owes(),
                Message::Bid(_) | Message::Repair(_) | Message::Presence(_) => false,
            });
        *messages = depending;
        for (_, message) in free.iter_mut().filter(|_| self.joint.owes()) {
            if let Message::Presence(presence) = message {
                presence.joint = None;
            }
        }
        free
    }

    /// The promises that must outlive this node.
    pub fn kept(&self) -> Kept {
        let roster = self.joint.roster();
        Kept {
            blocks: self.home.table.kept(),
            roster: roster.filter(|roster| self.config.joint.as_ref() != Some(*roster)).cloned(),
            term: self.joint.number(),
            decisions: self.joint.events(),
        }
    }

    /// The roster of joint events in the present term.
    pub fn roster(&self) -> Option<&Roster> {
        self.joint.roster()
    }

    /// The events that have happened since the last call, here and elsewhere, in the order in which the program saw
    /// them.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.run.selections)
    }

    /// Records from now on what the channel changes on the program's board, for one who replays the run; see
    /// [`take_channel_moves`](Self::take_channel_moves).
    pub fn record_channel(&mut self) {
        self.run.channel_moves.get_or_insert_default();
    }

    /// The channel's changes since the last call, in order; to be taken together with the selections.
    pub fn take_channel_moves(&mut self) -> Vec<ChannelMove> {
        self.run.channel_moves.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// When [`step`](Self::step) is due even if no message comes.
    pub fn next_deadline(&self) -> Duration {
        if self.clock.started.is_none() || !self.run.news.is_empty() {
            return self.clock.now();
        }
        let lease = self.config.lease;
        [
            self.run.program.next_deadline().filter(|_| self.clock.held.is_none()),
            self.home.next_deadline(&self.clock, &self.config),
            self.guest.next_deadline(lease),
            self.joint.next_deadline(&self.clock, lease),
        ]
        .into_iter()
        .flatten()
        .fold(self.channel.next_deadline(), Duration::min)
    }
}

/// Asking a node.
impl Node {
    pub fn name(&self) -> &NodeName {
        &self.config.name
    }

    pub fn incarnation(&self) -> u64 {
        self.config.incarnation
    }

    /// Who knows this node in a later life than this one, and in which: then nothing it says counts there. Another
    /// process has its name, or it has lost count of its lives.
    pub fn outlived(&self) -> Option<(&NodeName, u64)> {
        self.channel.outlived()
    }

    pub fn program(&self) -> &Program {
        &self.run.program
    }

    /// Its program, to add b-threads to.
    pub fn program_mut(&mut self) -> &mut Program {
        &mut self.run.program
    }

    /// The other members of the fleet, and how they do.
    pub fn peers(&self) -> impl Iterator<Item = (&NodeName, &Peer)> {
        self.channel.peers.iter()
    }

    pub fn stats(&self) -> NodeStats {
        self.stats
    }

    /// Another member of this name, if it is one.
    pub fn member(&self, name: &NodeName) -> Option<&NodeName> {
        self.channel.peers.name(name.as_str())
    }

    /// The work that a member has made for this node, and the entries that it makes it keep.
    pub fn caused_by(&self, member: &NodeName) -> Caused {
        let telling = self.run.telling(member);
        let (entries, entry_bytes) = self.home.table.entries_of(member);
        let (pending, pending_bytes) = self.channel.waiting_of(member);
        Caused {
            facts_told: telling.told,
            facts_withheld: telling.withheld,
            lives_refused: self.channel.peers.lives_refused(member),
            entries,
            entry_bytes,
            pending,
            pending_bytes,
        }
    }

    /// The other homes that the present block of `bthread` concerns, each with whether it surely keeps the block now.
    pub fn kept_by(&self, bthread: &str) -> impl Iterator<Item = (&NodeName, bool)> {
        self.guest.kept_by(bthread, self.clock.now(), self.config.lease)
    }

    /// What each b-thread of another node blocks here, as it was asked for; of that the part counts that concerns this
    /// home, and may be blocked from afar.
    pub fn blocks_from_afar(&self) -> impl Iterator<Item = (&NodeName, &str, &EventSet)> {
        self.home.table.blocks()
    }

    /// The b-threads that request, block and wait for the events of a set, and behind each remote one its node and the
    /// age of its lease: `node.explain("uav/3/takeoff")`.
    pub fn explain(&self, question: impl Into<EventSet>) -> NodeExplanation {
        let local = self.run.program.explain(question);
        let requesters = local.requested.iter().map(|(name, _)| name);
        let others = local.blocked.iter().chain(&local.waiting).map(|(name, _)| name);
        let names: BTreeSet<&Arc<str>> = requesters.chain(others).collect();
        let party = |name| self.home.table.party(name, self.clock.now());
        let remote = names.into_iter().filter_map(|name| party(name)).collect();
        NodeExplanation { local, remote }
    }

    /// The weight of the own occurrences that are kept for those who missed them, bytes.
    pub fn history_bytes(&self) -> usize {
        self.home.history.bytes()
    }

    /// Every bid on this node's table now.
    pub fn board(&self) -> Board {
        let (program, now) = (&self.run.program, self.clock.now());
        let blockers = |event: &Event| match self.routes().of(event) {
            // One more than there is room for shows that there is no room.
            Route::Here | Route::Local => {
                program.blockers(event).take(Board::MAX_REQUESTS + 1).map(Into::into).collect()
            }
            Route::Elsewhere(_) | Route::Unroutable => Vec::new(),
        };
        let own = program.bids().map(|(bthread, bid, _)| BoardRow::new(bthread, bid, blockers));
        let mut of_one = (None, 0);
        let mut left_out = 0;
        let shown = program.proxies().filter(|(name, _)| {
            let node = name.split_once('#').map(|(node, _)| node);
            of_one = (node, if of_one.0 == node { of_one.1 + 1 } else { 1 });
            let is_shown = of_one.1 <= Bound::BoardRows.most();
            left_out += u32::from(!is_shown);
            is_shown
        });
        let remote = shown.map(|(name, bid)| {
            let mut row = BoardRow::new(name, bid, blockers);
            if let Some(party) = self.home.table.party(name, now) {
                row.blocks = self.home.table.asked_block(name).cloned().unwrap_or_default();
                row.lease = Some(BoardLease { age: party.lease_age, length: party.lease });
            }
            row
        });
        let rows = own.chain(remote.filter(|row| !(row.requests.is_empty() && row.blocks.is_none())));
        let rows = rows.collect();
        let board = Board::new(self.config.name.clone(), self.config.incarnation, now, rows);
        Board { left_out: board.left_out.saturating_add(left_out), ..board }
    }

    fn routes(&self) -> Routes<'_> {
        Routes { here: &self.home.events, roster: self.joint.roster(), peers: &self.channel.peers }
    }
}

/// The program's explanation, and the remote b-threads behind the proxies in it.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeExplanation {
    /// The b-threads that request, block and wait for the events asked about; remote ones as `node#bthread`.
    pub local: Explanation,
    /// The remote b-threads among them.
    pub remote: Vec<RemoteParty>,
}

impl fmt::Display for NodeExplanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.local.fmt(f)?;
        for RemoteParty { node, bthread, lease_age, lease } in &self.remote {
            let (age, lease) = (lease_age.as_secs_f64(), lease.as_secs_f64());
            writeln!(f, "  {node}#{bthread} was renewed {age:.2} s ago and lapses at {lease:.2} s")?;
        }
        Ok(())
    }
}
