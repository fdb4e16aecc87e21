//! Taking in messages.

use std::collections::VecDeque;
use std::time::Duration;

use crate::facts::{Denied, DuplicateName, Gap, PeerJoined, Refused, Unknown};
use crate::node::{BoardChange, Delivery, LEAST_LEASE, Node, REPEAT_DOUBLE};
use crate::peers::Word;
use crate::stream::{Heard, REPAIR_CHUNK, Stream};
use crate::table::{Past, ProxyChange, TakenIn};
use crate::{BidAck, BidRecord, Message, NodeName, Occurrence, Presence, Recipient, Repair};

/// Each function that takes in a message says whether it counted.
impl Node {
    /// Notes that `node` lives in `incarnation`; false if that life is over.
    fn hear(&mut self, node: &NodeName, incarnation: u64) -> bool {
        let word = self.peers.hear(self.now, node, incarnation);
        match word {
            Word::Fenced => return false,
            Word::Alive => return true,
            Word::Back => {}
            Word::Born { was_alive } => {
                if was_alive {
                    self.tell_loss(node);
                }
                if let Some(joint) = &mut self.joint {
                    joint.forget(node);
                }
                self.begin_life(node, incarnation);
            }
        }
        self.fact(PeerJoined { node: node.clone(), incarnation });
        // So that the other one need not wait for the next sign of life.
        self.presence_due = self.now;
        true
    }

    /// `node` lives in a new incarnation: nothing of the old one goes on.
    fn begin_life(&mut self, node: &NodeName, incarnation: u64) {
        let changes = self.table.drop_life(node, incarnation);
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
                let bthread = bid.bthread.as_str().into();
                self.fact(Unknown { event: event.name().into(), bthread, home: node.clone() });
            }
        }
    }

    pub(super) fn change_proxies(&mut self, changes: Vec<ProxyChange>) {
        for (proxy, bid) in changes {
            self.change_board(match bid {
                Some(bid) => BoardChange::Put(proxy, bid),
                None => BoardChange::Gone(proxy),
            });
        }
    }

    pub(super) fn deliver(&mut self, home: &NodeName, heard: VecDeque<Heard>) {
        for heard in heard {
            match heard {
                Heard::Occurrence(occurrence) => self.deliveries.push_back(Delivery::Occurrence(occurrence)),
                Heard::Gap { from, to } => self.fact(Gap { home: home.clone(), from, to }),
            }
        }
    }

    pub(super) fn take_in_bids(&mut self, record: &BidRecord) -> bool {
        let of_a_former_term = (1..self.term()).contains(&record.term);
        if !self.hear(&record.node, record.incarnation) || of_a_former_term {
            return false;
        }
        let decisions = self.joint.as_ref().filter(|joint| joint.leads()).map(|joint| &joint.decisions);
        let past = Past { history: &self.history, term: self.term(), decisions };
        let TakenIn::Yes { proxies, denied } = self.table.take_in(self.now, record, &past) else {
            return false;
        };
        self.change_proxies(proxies);
        for refusal in denied {
            let bthread = refusal.bthread.as_str().into();
            self.fact(Denied { node: record.node.clone(), bthread, reason: refusal.reason });
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

    pub(super) fn take_in_ack(&mut self, ack: BidAck) -> bool {
        if !self.hear(&ack.home, ack.home_incarnation) {
            return false;
        }
        if let Some(stream) = self.streams.get_mut(&ack.home) {
            stream.latest_is(ack.latest_seq);
        }
        let home = ack.home.clone();
        let refused = self.outboxes.get_mut(&home).map(|outbox| outbox.acknowledged(self.now, ack));
        for refusal in refused.into_iter().flatten() {
            let bthread = refusal.bthread.as_str().into();
            self.fact(Refused { bthread, home: home.clone(), reason: refusal.reason });
        }
        true
    }

    pub(super) fn take_in_occurrence(&mut self, occurrence: Occurrence) -> bool {
        let home = occurrence.home.clone();
        if !self.hear(&home, occurrence.incarnation) {
            return false;
        }
        if occurrence.term > 0 {
            return self.take_in_decision(occurrence);
        }
        let mut heard = VecDeque::new();
        #[cfg(feature = "mutants")]
        if self.config.mutant == Some(crate::Mutant::G1) {
            heard.push_back(Heard::Occurrence(occurrence.clone()));
        }
        if let Some(stream) = self.streams.get_mut(&home) {
            stream.occurrence(occurrence, &mut heard);
        }
        self.deliver(&home, heard);
        true
    }

    pub(super) fn take_in_presence(&mut self, presence: &Presence) -> bool {
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
            stream.presence(presence.latest_seq, presence.oldest_seq, from_start, &mut heard);
        }
        self.deliver(&presence.node, heard);
        if let Some(word) = &presence.joint {
            self.take_in_word(presence, word);
        }
        self.address_home(&presence.node, presence.incarnation);
        true
    }

    pub(super) fn repeat_occurrences(&mut self, repair: &Repair) -> bool {
        if !self.outboxes.contains_key(&repair.requester) {
            return false;
        }
        let to = repair.to_seq.min(repair.from_seq.saturating_add(REPAIR_CHUNK - 1));
        let history = match &self.joint {
            _ if repair.term == 0 => &self.history,
            Some(joint) if joint.term() == repair.term => &joint.decisions,
            _ => return false,
        };
        let again = history.range(repair.from_seq, to).cloned();
        let again = again
            .map(|occurrence| (Recipient::Node(repair.requester.clone()), Message::Occurrence(occurrence)));
        self.outgoing.extend(again);
        if repair.term == 0 && repair.from_seq < self.history.oldest_seq() {
            // The presence tells what cannot be had any more.
            self.presence_due = self.now;
        }
        true
    }

    /// A message under this node's own name: its own, a late one of its former life, or another process's.
    pub(super) fn hear_own_name(&mut self, message: &Message) -> bool {
        let Message::Presence(presence) = message else { return true };
        let own = presence.incarnation == self.config.incarnation && self.presences.contains(&presence.up);
        let of_a_former_life =
            presence.incarnation < self.config.incarnation && self.up() < self.config.lease;
        if own || of_a_former_life {
            return true;
        }
        if self.double_told.is_none_or(|at| self.now >= at + REPEAT_DOUBLE) {
            self.double_told = Some(self.now);
            self.fact(DuplicateName { incarnation: presence.incarnation });
        }
        true
    }
}
