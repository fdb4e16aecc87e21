//! A node coupled to its link.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_dbp::{Board, Caused, Kept, Message, Node, NodeError, NodeName, Recipient};

use crate::decode_error::DecodeError;
use crate::key::{Fleet, Key};
use crate::link::Link;
use crate::mailbox::{Mailbox, Owner};
use crate::message::{Payload, Readiness, Record, State};
use crate::saver::Saver;
use crate::share::Shares;
use crate::store::Store;

/// One pump takes over so many messages from the link at most, so that a flood cannot keep a node from going on. Which of
/// them it reads is a matter of each sender's share.
const MOST_PER_PUMP: usize = 4096;

/// Messages that wait in all; of each sender there may be far fewer.
const MOST_WAITING: usize = 1 << 16;

/// A node looks this often at its board.
const BOARD_PERIOD: Duration = Duration::from_millis(200);
/// A board that has changed is told of no more often than this, unless something is newly blocked or free.
const BOARD_CHANGED: Duration = Duration::from_millis(600);
/// A board that has not changed is told of this often, for those who have come since.
const BOARD_UNCHANGED: Duration = Duration::from_secs(3);

/// A node, its fleet, and what has come in beside the protocol: other vehicles' states, and other nodes' boards.
///
/// [`pump`](Self::pump) is the whole loop of a node: take in what has arrived, go on, send what is to be sent. A
/// message under a key that its sender may not use, or that is no message, is counted and dropped.
#[derive(Debug)]
pub struct NodeLink {
    node: Node,
    fleet: Fleet,
    store: Option<Saver<Kept>>,
    /// Messages that depend on what the store has not taken yet.
    withheld: Vec<(Recipient, Message)>,
    /// When it last took something in.
    now: Duration,
    states: Vec<State>,
    readiness: Vec<Readiness>,
    /// Other members' newest boards, for who reads them.
    boards: Option<BTreeMap<NodeName, Board>>,
    board_due: Duration,
    told_board: Option<Board>,
    stats: NodeLinkStats,
    skewed: BTreeMap<NodeName, u32>,
    mailbox: Mailbox,
    shares: Shares,
    /// The messages of each member, and of all others together.
    senders: BTreeMap<Owner, SenderStats>,
    has_met: bool,
    /// Whether there are other members, so that all others are strangers.
    has_roster: bool,
}

/// Counts of what has come from one member, or from all outside the roster together, since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SenderStats {
    /// Messages taken in.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Messages that had to go because more had come than may wait.
    pub dropped: u64,
    /// Messages longer than any of their kind may be.
    pub oversized: u64,
    /// Payloads that could not be decoded, or were beyond a bound.
    pub undecodable: u64,
    /// Messages whose content claims another sender, receiver or kind than their key.
    pub forged: u64,
    /// Messages of nodes outside the roster, where there is one: nobody reads them.
    pub strange: u64,
    /// States whose numbers were brought to what is believed.
    pub implausible: u64,
    /// Messages that wait now for their share of the node's time.
    pub waiting: usize,
    /// Their bytes.
    pub waiting_bytes: usize,
    /// What it has made the node do and keep beside.
    pub caused: Caused,
    /// Event sets looked at while its messages were taken in.
    #[cfg(feature = "mutants")]
    pub nodes: u64,
}

impl SenderStats {
    /// The messages that came to nothing, for whatever reason, and the facts that were not told.
    pub fn passed_over(&self) -> u64 {
        self.dropped
            + self.strange
            + self.implausible
            + self.oversized
            + self.undecodable
            + self.forged
            + self.caused.facts_withheld
            + self.caused.lives_refused
    }
}

/// Counts of the messages that have come and gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeLinkStats {
    /// Messages taken in.
    pub received: u64,
    pub sent: u64,
    /// Payloads that could not be decoded.
    pub undecodable: u64,
    /// Messages whose content claims another sender, receiver or kind than their key.
    pub forged: u64,
    /// Messages longer than any of their kind may be.
    pub oversized: u64,
    /// Messages that had to go because more had come from their sender than may wait.
    pub dropped: u64,
    /// Messages of nodes outside the roster.
    pub strange: u64,
    /// States whose numbers were brought to what is believed.
    pub implausible: u64,
    /// Own messages that were not put, because no other node would take in one so long.
    pub unsendable: u64,
    /// Messages that were not sent because the store did not take what they depend on.
    pub unsaved: u64,
}

impl NodeLink {
    /// Couples `node` to its fleet.
    pub fn new(node: Node, fleet: Fleet) -> Self {
        Self {
            node,
            fleet,
            store: None,
            withheld: Vec::new(),
            now: Duration::ZERO,
            states: Vec::new(),
            readiness: Vec::new(),
            boards: None,
            board_due: Duration::ZERO,
            told_board: None,
            stats: NodeLinkStats::default(),
            skewed: BTreeMap::new(),
            mailbox: Mailbox::new(MOST_WAITING),
            shares: Shares::default(),
            senders: BTreeMap::new(),
            has_met: false,
            has_roster: false,
        }
    }

    /// Couples a node that is configured to be durable to its fleet and to where it keeps what it promises.
    pub fn durable(node: Node, fleet: Fleet, store: Box<dyn Store>) -> Self {
        Self { store: Some(Saver::new(store)), ..Self::new(node, fleet) }
    }

    /// A node that also reads what other nodes have on their boards.
    #[must_use]
    pub fn reading_boards(self) -> Self {
        Self { boards: Some(BTreeMap::new()), ..self }
    }

    /// Takes in what has arrived, lets the node go on, and sends what it has to say.
    ///
    /// # Errors
    /// Those of [`Node::step`]; what the node has to say is sent all the same.
    pub fn pump(&mut self, now: Duration, link: &mut dyn Link) -> Result<(), NodeError> {
        self.receive(now, link);
        let outcome = self.node.step(now);
        self.send(link);
        outcome
    }

    /// Tells all what state this node's vehicle is in.
    pub fn put_state(&mut self, state: &State, link: &mut dyn Link) {
        self.put_to_all::<State>(Payload::State(state.clone()), link);
    }

    /// Tells all how this node's vehicle passes its checks before take-off.
    pub fn put_readiness(&mut self, readiness: &Readiness, link: &mut dyn Link) {
        self.put_to_all::<Readiness>(Payload::Readiness(readiness.clone()), link);
    }

    fn put_to_all<R: Record>(&mut self, payload: Payload, link: &mut dyn Link) {
        link.put(&Key::to_all::<R>(&self.fleet, self.node.name().clone()), payload.encode());
        self.stats.sent += 1;
    }

    /// Tells all what is on this node's board, if that is due: when it has changed, but at most a few times a second,
    /// and now and then when it has not. Returns the board if so.
    pub fn put_board(&mut self, now: Duration, link: &mut dyn Link) -> Option<&Board> {
        if now < self.board_due {
            return None;
        }
        self.board_due = now + BOARD_PERIOD;
        let board = self.node.board();
        let due = self.told_board.as_ref().is_none_or(|told| {
            let pause = match (board.stalls_as(told), board.repeats(told)) {
                (false, _) => BOARD_PERIOD,
                (true, false) => BOARD_CHANGED,
                (true, true) => BOARD_UNCHANGED,
            };
            now >= told.at + pause
        });
        if !due {
            return None;
        }
        let key = Key::to_all::<Board>(&self.fleet, self.node.name().clone());
        link.put(&key, Payload::Board(board.clone()).encode());
        self.stats.sent += 1;
        Some(self.told_board.insert(board))
    }

    /// The newest board of each other member that has sent one since the last call; none unless this node
    /// [reads them](Self::reading_boards).
    pub fn take_boards(&mut self) -> Vec<Board> {
        self.boards.as_mut().map(|boards| std::mem::take(boards).into_values().collect()).unwrap_or_default()
    }

    /// The states of other vehicles that have arrived since the last call, in order.
    pub fn take_states(&mut self) -> Vec<State> {
        std::mem::take(&mut self.states)
    }

    /// The checks of other vehicles that have arrived since the last call, in order.
    pub fn take_readiness(&mut self) -> Vec<Readiness> {
        std::mem::take(&mut self.readiness)
    }

    pub fn node(&self) -> &Node {
        &self.node
    }

    /// The node, to feed it and to take its selections.
    pub fn node_mut(&mut self) -> &mut Node {
        &mut self.node
    }

    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    pub fn stats(&self) -> NodeLinkStats {
        NodeLinkStats { dropped: self.mailbox.dropped().values().sum(), ..self.stats }
    }

    /// Takes in what has arrived, of each sender as much as is its share; the rest waits.
    pub fn receive(&mut self, now: Duration, link: &mut dyn Link) {
        self.now = now;
        if !std::mem::replace(&mut self.has_met, true) {
            let members: Vec<NodeName> = self.node.peers().map(|(name, _)| name.clone()).collect();
            link.meet(&members);
            self.has_roster = !members.is_empty();
            self.mailbox.meet(members);
        }
        for (key, payload) in std::iter::from_fn(|| link.poll()).take(MOST_PER_PUMP) {
            self.stats.received += 1;
            if self.boards.is_none() && key.is_of::<Board>() {
                continue;
            }
            if self.has_roster && self.node.member(key.sender()).is_none() && key.sender() != self.node.name()
            {
                self.stats.strange += 1;
                self.sender(key.sender()).strange += 1;
                continue;
            }
            if payload.len() > key.most_bytes() {
                self.stats.oversized += 1;
                self.sender(key.sender()).oversized += 1;
                continue;
            }
            self.mailbox.push(key, payload);
        }
        self.shares.begin(now);
        let (shares, node) = (&mut self.shares, &self.node);
        let due = self.mailbox.take(|key, bytes| shares.take(now, node.member(key.sender()), key, bytes));
        for (key, payload) in due {
            self.take_in(now, &key, &payload);
        }
    }

    fn take_in(&mut self, now: Duration, key: &Key, bytes: &[u8]) {
        #[cfg(feature = "mutants")]
        let nodes = skein_bp::bound::mutants::nodes();
        let payload = Payload::decode(bytes);
        self.note_version(key.sender(), &payload);
        let before = self.stats;
        match payload {
            Err(_) => self.stats.undecodable += 1,
            Ok(payload) if !key.fits(&payload) => self.stats.forged += 1,
            Ok(Payload::State(state)) if state.node == *self.node.name() => {}
            Ok(Payload::State(state)) => self.note_state(state),
            Ok(Payload::Readiness(readiness)) if readiness.node == *self.node.name() => {}
            Ok(Payload::Readiness(readiness)) => self.readiness.push(readiness),
            Ok(Payload::Board(board)) => self.note_board(board),
            Ok(Payload::Message(message)) => self.node.handle(now, message),
            // Not for a node: a sensor's and a world's words have listeners of their own.
            Ok(_) => self.stats.forged += 1,
        }
        let after = self.stats;
        let sender = self.sender(key.sender());
        sender.messages += 1;
        sender.bytes += bytes.len() as u64;
        sender.undecodable += after.undecodable - before.undecodable;
        sender.forged += after.forged - before.forged;
        sender.implausible += after.implausible - before.implausible;
        #[cfg(feature = "mutants")]
        {
            sender.nodes += skein_bp::bound::mutants::nodes() - nodes;
        }
    }

    /// The counts of a member, or those of all others.
    fn sender(&mut self, name: &NodeName) -> &mut SenderStats {
        let owner = self.node.member(name).cloned();
        self.senders.entry(owner).or_default()
    }

    /// The messages from each member, and, under no name, from all others together.
    pub fn senders(&self) -> impl Iterator<Item = (Option<&NodeName>, SenderStats)> {
        self.senders.iter().map(|(owner, stats)| {
            let dropped = self.mailbox.dropped().get(owner).copied().unwrap_or(0);
            let caused = owner.as_ref().map_or(Caused::default(), |name| self.node.caused_by(name));
            let (waiting, waiting_bytes) = self.mailbox.waiting_of(owner);
            (owner.as_ref(), SenderStats { dropped, caused, waiting, waiting_bytes, ..*stats })
        })
    }

    /// The messages that wait for their share of the node's time.
    pub fn mailbox(&self) -> &Mailbox {
        &self.mailbox
    }

    /// The nodes whose messages this build cannot read, each with the version it speaks.
    pub fn skewed(&self) -> impl Iterator<Item = (&NodeName, u32)> {
        self.skewed.iter().map(|(node, version)| (node, *version))
    }

    /// Whoever says that it is huge is kept away from, but not as far as it likes.
    fn note_state(&mut self, mut state: State) {
        self.stats.implausible += u64::from(state.bring_to_what_is_believed());
        self.states.push(state);
    }

    fn note_board(&mut self, board: Board) {
        if self.node.member(&board.node).is_some()
            && let Some(boards) = &mut self.boards
        {
            boards.insert(board.node.clone(), board);
        }
    }

    fn note_version(&mut self, sender: &NodeName, payload: &Result<Payload, DecodeError>) {
        match payload {
            Err(DecodeError::Version { given }) if self.node.member(sender).is_some() => {
                self.skewed.insert(sender.clone(), *given);
            }
            Err(_) => {}
            Ok(_) => drop(self.skewed.remove(sender)),
        }
    }

    /// Sends what the node has to say; what depends on a promise, once that is kept.
    pub fn send(&mut self, link: &mut dyn Link) {
        let is_kept = self.keep();
        let mut outgoing = std::mem::take(&mut self.withheld);
        outgoing.extend(self.node.take_outgoing());
        let free = if is_kept { outgoing } else { self.withhold(outgoing) };
        for (recipient, message) in free {
            let recipient = match recipient {
                Recipient::Node(recipient) => Some(recipient),
                Recipient::All => None,
            };
            let payload = Payload::Message(message);
            let key = Key::of(&payload, &self.fleet, self.node.name(), recipient);
            let payload = payload.encode();
            if payload.len() > key.most_bytes() {
                self.stats.unsendable += 1;
                continue;
            }
            link.put(&key, payload);
            self.stats.sent += 1;
        }
    }

    /// Why the node's promises are not kept, if the store is in trouble. It gives none meanwhile.
    pub fn trouble(&self) -> Option<&str> {
        self.store.as_ref().and_then(Saver::trouble)
    }

    /// Keeps the promises; returns whether all of them are kept.
    fn keep(&mut self) -> bool {
        let Some(store) = &mut self.store else { return true };
        if let Some(kept) = self.node.take_unsaved() {
            store.put(self.now, kept);
        }
        let had_to = !store.is_done();
        let is_kept = store.go_on(self.now);
        self.node.note_disk("promises", store.trouble());
        if is_kept && had_to {
            self.node.saved();
        } else if store.trouble().is_some() {
            self.node.store_fails();
        }
        is_kept
    }

    /// Holds back what depends on what is not kept, and gives the rest. If the store is in trouble, it is to
    /// the others as if the network had lost it: they ask again.
    fn withhold(&mut self, mut outgoing: Vec<(Recipient, Message)>) -> Vec<(Recipient, Message)> {
        let free = self.node.sort_out(&mut outgoing);
        if self.trouble().is_some() {
            self.stats.unsaved += outgoing.len() as u64;
        } else {
            self.withheld = outgoing;
        }
        free
    }
}

#[cfg(test)]
mod tests {
    use prost::Message as _;
    use skein_bp::{Program, ProgramConfig};
    use skein_dbp::NodeConfig;

    use super::*;
    use crate::network::{Network, NetworkConfig};
    use crate::proto::{self, VERSION};

    #[test]
    fn a_node_that_speaks_another_version_is_named_until_it_does_not() {
        let name = |text| NodeName::new(text).unwrap();
        let (me, other) = (name("uav/1"), name("uav/2"));
        let fleet = Fleet::new("demo").unwrap();
        let network = Network::new(NetworkConfig::default(), 1);
        let (mut mine, mut theirs) = (network.join(&me), network.join(&other));
        let node =
            Node::new(NodeConfig::new(me, 1, vec![other.clone()]), Program::new(ProgramConfig::default()));
        let mut node = NodeLink::new(node, fleet.clone());
        let key = Key::to_all::<State>(&fleet, other.clone());
        let newer = proto::Packet { version: VERSION + 1, body: None }.encode_to_vec();
        let current = Payload::State(State::new(other.clone())).encode();
        for (sent, named) in [(newer, vec![(&other, VERSION + 1)]), (current, vec![])] {
            let before = node.stats().received;
            theirs.put(&key, sent);
            for tick in 0..50 {
                let now = Duration::from_millis(20 * (before * 50 + tick));
                network.advance(now);
                node.receive(now, &mut mine);
            }
            assert_eq!(node.stats().received, before + 1);
            assert_eq!(node.skewed().collect::<Vec<_>>(), named);
        }
    }
}
