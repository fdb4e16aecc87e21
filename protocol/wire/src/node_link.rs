//! A node coupled to its link.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use skein_dbp::{Board, Kept, Message, Node, NodeError, NodeName, Recipient};

use crate::decode_error::DecodeError;
use crate::key::{Fleet, Key};
use crate::link::Link;
use crate::message::{Payload, Readiness, Record, State};
use crate::saver::Saver;
use crate::store::Store;

/// One pump takes in so many messages at most, so that a flood cannot keep a node from going on.
const MOST_PER_PUMP: usize = 4096;

/// Of how many nodes it is remembered that they speak another version.
const MOST_SKEWED: usize = 256;

/// A node looks this often at its board.
const BOARD_PERIOD: Duration = Duration::from_millis(200);
/// A board that has changed is told of no more often than this, unless something is newly blocked or free.
const BOARD_CHANGED: Duration = Duration::from_millis(600);
/// A board that has not changed is told of this often, for those who have come since.
const BOARD_UNCHANGED: Duration = Duration::from_secs(3);
/// Boards that wait to be taken; of more, the oldest go.
const MOST_BOARDS: usize = 1024;

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
    /// Other nodes' boards, for who reads them.
    boards: Option<VecDeque<Board>>,
    board_due: Duration,
    told_board: Option<Board>,
    stats: NodeLinkStats,
    skewed: BTreeMap<NodeName, u32>,
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
        }
    }

    /// Couples a node that is configured to be durable to its fleet and to where it keeps what it promises.
    pub fn durable(node: Node, fleet: Fleet, store: Box<dyn Store>) -> Self {
        Self { store: Some(Saver::new(store)), ..Self::new(node, fleet) }
    }

    /// A node that also reads what other nodes have on their boards.
    #[must_use]
    pub fn reading_boards(self) -> Self {
        Self { boards: Some(VecDeque::new()), ..self }
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

    /// The boards of other nodes that have arrived since the last call, in order; none unless this node
    /// [reads them](Self::reading_boards).
    pub fn take_boards(&mut self) -> Vec<Board> {
        self.boards.as_mut().map(|boards| boards.drain(..).collect()).unwrap_or_default()
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
        self.stats
    }

    /// Takes in what has arrived.
    pub fn receive(&mut self, now: Duration, link: &mut dyn Link) {
        self.now = now;
        for (key, payload) in std::iter::from_fn(|| link.poll()).take(MOST_PER_PUMP) {
            self.stats.received += 1;
            if self.boards.is_none() && key.is_of::<Board>() {
                continue;
            }
            let payload = Payload::decode(&payload);
            self.note_version(key.sender(), &payload);
            match payload {
                Err(_) => self.stats.undecodable += 1,
                Ok(payload) if !key.fits(&payload) => self.stats.forged += 1,
                Ok(Payload::State(state)) if state.node == *self.node.name() => {}
                Ok(Payload::State(state)) => self.states.push(state),
                Ok(Payload::Readiness(readiness)) if readiness.node == *self.node.name() => {}
                Ok(Payload::Readiness(readiness)) => self.readiness.push(readiness),
                Ok(Payload::Board(board)) => self.note_board(board),
                Ok(Payload::Message(message)) => self.node.handle(now, message),
                // Not for a node: a sensor's and a world's words have listeners of their own.
                Ok(_) => self.stats.forged += 1,
            }
        }
    }

    /// The nodes whose messages this build cannot read, each with the version it speaks.
    pub fn skewed(&self) -> impl Iterator<Item = (&NodeName, u32)> {
        self.skewed.iter().map(|(node, version)| (node, *version))
    }

    fn note_board(&mut self, board: Board) {
        let Some(boards) = self.boards.as_mut().filter(|_| board.node != *self.node.name()) else { return };
        if boards.len() == MOST_BOARDS {
            boards.pop_front();
        }
        boards.push_back(board);
    }

    fn note_version(&mut self, sender: &NodeName, payload: &Result<Payload, DecodeError>) {
        match payload {
            Err(DecodeError::Version { given }) if self.skewed.len() < MOST_SKEWED => {
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
            link.put(&key, payload.encode());
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
