//! The channel to the other nodes: who lives, what has been heard of each, and what goes out (G1, G5).

pub(crate) mod peers;
mod standing;
pub(crate) mod stream;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::channel::peers::{MOST_LIVES_AHEAD, Peers};
#[cfg(feature = "mutants")]
use crate::channel::stream::Heard;
use crate::channel::stream::{Hole, Stream};
use crate::clock::Clock;
use crate::config::{LEAST_LEASE, NodeConfig};
use crate::facts::DuplicateName;
use crate::history::History;
use crate::message::{JointWord, Message, Occurrence, Presence, Recipient, Repair};
use crate::name::NodeName;
use crate::run::Run;

/// A node whose name another process has is told so again after this long, while that goes on.
const REPEAT_DOUBLE: Duration = Duration::from_secs(2);
/// Most of its own last presences that a node can tell from another's.
const PRESENCES_KNOWN: usize = 16;

#[derive(Clone, Debug)]
pub(crate) struct Channel {
    pub(crate) peers: Peers,
    /// The occurrences of each peer, as far as they are heard.
    streams: BTreeMap<NodeName, Stream>,
    presence_due: Duration,
    /// `up` of the last presences that were sent.
    presences: VecDeque<Duration>,
    /// When the node was last told that another process has its name.
    double_told: Option<Duration>,
    /// When each peer that lives in a life before the last was last told so.
    former_told: BTreeMap<NodeName, Duration>,
    /// The nodes that know this one in a later life, and in which.
    outlived: Option<(NodeName, u64)>,
    outgoing: Vec<(Recipient, Message)>,
    #[cfg(feature = "mutants")]
    mutant: Option<crate::mutant::Mutant>,
}

impl Channel {
    pub(crate) fn new(config: &NodeConfig) -> Self {
        Self {
            peers: Peers::new(config.roster.iter().cloned(), config.lease),
            streams: config.roster.iter().map(|member| (member.clone(), Stream::default())).collect(),
            presence_due: Duration::ZERO,
            presences: VecDeque::new(),
            double_told: None,
            former_told: BTreeMap::new(),
            outlived: None,
            outgoing: Vec::new(),
            #[cfg(feature = "mutants")]
            mutant: config.mutant,
        }
    }

    pub(crate) fn send(&mut self, node: &NodeName, message: Message) {
        self.outgoing.push((Recipient::Node(node.clone()), message));
    }

    pub(crate) fn send_to_all(&mut self, message: Message) {
        self.outgoing.push((Recipient::All, message));
    }

    /// The messages to send, in order. Acknowledgements come last, so that no occurrence that a b-thread waits for
    /// elsewhere goes behind one.
    pub(crate) fn take_outgoing(&mut self) -> Vec<(Recipient, Message)> {
        let mut outgoing = std::mem::take(&mut self.outgoing);
        outgoing.sort_by_key(|(_, message)| matches!(message, Message::Ack(_)));
        outgoing
    }

    /// The number up to which the occurrences of `home` have been given out.
    pub(crate) fn applied(&self, home: &NodeName) -> u64 {
        self.streams.get(home).map_or(0, Stream::applied)
    }

    /// The occurrences of `home` that wait behind a hole, and their bytes.
    pub(crate) fn waiting_of(&self, home: &NodeName) -> (usize, usize) {
        self.streams.get(home).map_or((0, 0), Stream::waiting)
    }

    /// Whether it is known from where on `home` is heard.
    pub(crate) fn hears_from(&self, home: &NodeName) -> bool {
        self.streams.get(home).is_some_and(Stream::has_begun)
    }

    /// `home` has said that its occurrences have come to `latest`.
    pub(crate) fn latest_is(&mut self, home: &NodeName, latest: u64) {
        if let Some(stream) = self.streams.get_mut(home) {
            stream.latest_is(latest);
        }
    }

    /// `home` lives in a new incarnation, and its occurrences begin anew.
    pub(crate) fn restart(&mut self, home: &NodeName, incarnation: u64, run: &mut Run) {
        if let Some(stream) = self.streams.get_mut(home) {
            run.hear(home, |heard| stream.restart(incarnation, heard));
        }
    }

    /// Takes in an occurrence elsewhere that is no joint decision.
    pub(crate) fn take_in_occurrence(&mut self, occurrence: Occurrence, run: &mut Run) {
        let home = occurrence.home.clone();
        let Some(stream) = self.streams.get_mut(&home) else { return };
        run.hear(&home, |heard| {
            #[cfg(feature = "mutants")]
            if self.mutant == Some(crate::mutant::Mutant::G1) {
                heard.push_back(Heard::Occurrence(occurrence.clone()));
            }
            stream.occurrence(occurrence, heard);
        });
    }

    /// Takes in how far a peer's stream has come, and how long it counts as alive without a word.
    pub(crate) fn take_in_presence(
        &mut self,
        presence: &Presence,
        clock: &Clock,
        config: &NodeConfig,
        run: &mut Run,
    ) {
        let lease = Duration::from_millis(presence.lease_ms);
        // One that is lost and back all the time would be told to all each time.
        let least = LEAST_LEASE.max(config.lease / 4);
        self.peers.set_lease(&presence.node, lease.clamp(least, config.longest_lease));
        // Whoever started within a lease of this node counts as having started with it.
        let from_start = presence.up <= clock.up() + config.lease;
        if let Some(stream) = self.streams.get_mut(&presence.node) {
            run.hear(&presence.node, |heard| {
                stream.presence(presence.latest_seq, presence.oldest_seq, from_start, heard);
            });
        }
    }

    /// Takes in a message under this node's own name: its own, a late one of its former life, or another process's.
    pub(crate) fn take_in_own_name(
        &mut self,
        message: &Message,
        clock: &Clock,
        config: &NodeConfig,
        run: &mut Run,
    ) {
        let Message::Presence(presence) = message else { return };
        let own = presence.incarnation == config.incarnation && self.presences.contains(&presence.up);
        let of_a_former_life = presence.incarnation < config.incarnation && clock.up() < config.lease;
        if own || of_a_former_life {
            return;
        }
        if self.double_told.is_none_or(|at| clock.now() >= at + REPEAT_DOUBLE) {
            self.double_told = Some(clock.now());
            run.fact(DuplicateName { incarnation: presence.incarnation });
        }
    }

    /// Lets `node`, of which a sign of life in the life `given` has come, know that it was heard in a later one: it asks
    /// that one to begin anew.
    pub(crate) fn tell_former_life(&mut self, now: Duration, me: &NodeName, node: &NodeName, given: u64) {
        let Some(known) = self.peers.incarnation(node).filter(|known| given < *known) else { return };
        if self.former_told.get(node).is_none_or(|at| now >= *at + REPEAT_DOUBLE) {
            self.former_told.insert(node.clone(), now);
            self.outgoing.extend(repairs(me, node, known, 0, vec![(1, 1)]));
        }
    }

    /// A peer wants something of the life `other` of this node, which lives in `incarnation`.
    pub(crate) fn note_other_life(&mut self, peer: &NodeName, other: u64, incarnation: u64) {
        let known = self.outlived.as_ref().map_or(incarnation, |(_, known)| *known);
        if self.peers.name(peer.as_str()).is_some()
            && other > known
            && other - incarnation <= MOST_LIVES_AHEAD
        {
            self.outlived = Some((peer.clone(), other));
        }
    }

    /// Who knows this node in a later life than this, and in which.
    pub(crate) fn outlived(&self) -> Option<(&NodeName, u64)> {
        self.outlived.as_ref().map(|(peer, life)| (peer, *life))
    }

    /// Sends again what is missed of `history`.
    pub(crate) fn repeat(&mut self, now: Duration, repair: &Repair, history: &History) {
        let peers = &mut self.peers;
        let may_repeat = |_: &&Occurrence| peers.may_be_repeated_to(now, &repair.requester);
        let again = history.repeat(repair.from_seq, repair.to_seq).take_while(may_repeat).cloned();
        let recipient = Recipient::Node(repair.requester.clone());
        self.outgoing.extend(again.map(|occurrence| (recipient.clone(), Message::Occurrence(occurrence))));
    }

    /// Asks peers for the occurrences that are missed of their streams.
    pub(crate) fn ask_for_missed(&mut self, now: Duration, config: &NodeConfig) {
        for (home, stream) in &mut self.streams {
            if let Some((incarnation, holes)) = stream.repair(now, config.lease / 10) {
                self.outgoing.extend(repairs(&config.name, home, incarnation, 0, holes));
            }
        }
    }

    /// Asks the coordinator for the decisions that are missed of a term.
    pub(crate) fn ask_for_decisions(
        &mut self,
        me: &NodeName,
        coordinator: &NodeName,
        term: u64,
        holes: Vec<Hole>,
    ) {
        if let Some(incarnation) = self.peers.incarnation(coordinator) {
            self.outgoing.extend(repairs(me, coordinator, incarnation, term, holes));
        }
    }

    /// Makes a sign of life due at the next step.
    pub(crate) fn speak_up(&mut self, now: Duration) {
        self.presence_due = now;
    }

    pub(crate) fn presence_is_due(&self, now: Duration) -> bool {
        now >= self.presence_due
    }

    /// Sends a sign of life; the next one is due sooner while the coordinator asks for every member's word.
    pub(crate) fn send_presence(
        &mut self,
        clock: &Clock,
        config: &NodeConfig,
        history: &History,
        joint: Option<JointWord>,
    ) {
        let beat = if joint.is_some_and(|word| word.asks) { 10 } else { 3 };
        self.presence_due = clock.now() + config.lease / beat;
        if self.presences.len() == PRESENCES_KNOWN {
            self.presences.pop_front();
        }
        self.presences.push_back(clock.up());
        self.send_to_all(Message::Presence(Presence {
            node: config.name.clone(),
            incarnation: config.incarnation,
            up: clock.up(),
            latest_seq: history.latest_seq(),
            oldest_seq: history.oldest_seq(),
            lease_ms: config.lease_ms(),
            joint,
        }));
    }

    /// When a sign of life, a loss or a wish for repair is due.
    pub(crate) fn next_deadline(&self) -> Duration {
        let streams = self.streams.values().filter_map(Stream::next_deadline);
        streams.chain(self.peers.next_deadline()).fold(self.presence_due, Duration::min)
    }
}

/// Wishes to hear again the numbers in `holes`, of a `term` or, if that is 0, of the home's other occurrences.
fn repairs(
    me: &NodeName,
    home: &NodeName,
    incarnation: u64,
    term: u64,
    holes: Vec<Hole>,
) -> impl Iterator<Item = (Recipient, Message)> {
    holes.into_iter().map(move |(from_seq, to_seq)| {
        let (home, requester) = (home.clone(), me.clone());
        let repair = Repair { home: home.clone(), incarnation, from_seq, to_seq, term, requester };
        (Recipient::Node(home), Message::Repair(repair))
    })
}
