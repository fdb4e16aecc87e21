//! Taking in messages.

use crate::channel::peers::Word;
use crate::facts::PeerJoined;
use crate::message::{BidAck, BidRecord, Message, Occurrence, Presence, Repair};
use crate::name::NodeName;
use crate::node::Node;

/// Each function that takes in a message says whether it counted.
impl Node {
    pub(super) fn take_in(&mut self, message: Message) -> bool {
        let (name, incarnation) = (&self.config.name, self.config.incarnation);
        match message {
            message if message.sender() == name => {
                self.channel.take_in_own_name(&message, &self.clock, &self.config, &mut self.run);
                true
            }
            Message::Bid(record) => record.home == *name && self.take_in_bids(&record),
            Message::Ack(ack) => ack.node == *name && ack.incarnation == incarnation && self.take_in_ack(ack),
            Message::Occurrence(occurrence) => self.take_in_occurrence(occurrence),
            Message::Repair(repair) if repair.home == *name && repair.incarnation != incarnation => {
                self.channel.note_other_life(&repair.requester, repair.incarnation, incarnation);
                false
            }
            Message::Repair(repair) => repair.home == *name && self.take_in_repair(&repair),
            Message::Presence(presence) => self.take_in_presence(&presence),
        }
    }

    /// Notes that `node` lives in `incarnation`; false if that life is over.
    fn hear(&mut self, node: &NodeName, incarnation: u64) -> bool {
        match self.channel.peers.hear(self.clock.now(), node, incarnation) {
            Word::Fenced => return false,
            Word::Alive => return true,
            Word::Back => {}
            Word::Born { was_alive } => {
                if was_alive {
                    self.home.tell_loss(node, &mut self.run);
                }
                self.joint.forget(node);
                self.run.change_proxies(self.home.table.drop_life(node, incarnation));
                self.channel.restart(node, incarnation, &mut self.run);
                self.address_home(node, incarnation);
            }
        }
        self.run.fact(PeerJoined { node: node.clone(), incarnation });
        // So that the other one need not wait for the next sign of life.
        self.channel.speak_up(self.clock.now());
        true
    }

    /// Addresses requests to the present life of `node`, once it is known from where on its occurrences are heard: what
    /// it serves then cannot be missed.
    fn address_home(&mut self, node: &NodeName, incarnation: u64) {
        if self.channel.hears_from(node) {
            self.guest.address(node, incarnation, &mut self.run);
        }
    }

    fn take_in_bids(&mut self, record: &BidRecord) -> bool {
        let term = self.joint.number();
        let of_a_former_term = (1..term).contains(&record.term);
        if !self.hear(&record.node, record.incarnation) || of_a_former_term {
            return false;
        }
        let past = (term, self.joint.decisions());
        let ack = self.home.take_in(self.clock.now(), record, past, &self.config, &mut self.run);
        let Some(ack) = ack else { return false };
        self.channel.send(&record.node, Message::Ack(ack));
        true
    }

    fn take_in_ack(&mut self, ack: BidAck) -> bool {
        if !self.hear(&ack.home, ack.home_incarnation) {
            return false;
        }
        self.channel.latest_is(&ack.home, ack.latest_seq);
        self.guest.take_in_ack(self.clock.now(), ack, &mut self.run);
        true
    }

    fn take_in_occurrence(&mut self, occurrence: Occurrence) -> bool {
        if !self.hear(&occurrence.home, occurrence.incarnation) {
            return false;
        }
        if occurrence.term == 0 {
            self.channel.take_in_occurrence(occurrence, &mut self.run);
            return true;
        }
        let counts = self.joint.take_in_decision(occurrence, &mut self.run);
        if counts {
            // The coordinator decides nothing more before it has heard of this.
            self.channel.speak_up(self.clock.now());
        }
        counts
    }

    fn take_in_presence(&mut self, presence: &Presence) -> bool {
        if !self.hear(&presence.node, presence.incarnation) {
            let (now, me) = (self.clock.now(), &self.config.name);
            self.channel.tell_former_life(now, me, &presence.node, presence.incarnation);
            return false;
        }
        self.channel.take_in_presence(presence, &self.clock, &self.config, &mut self.run);
        if let Some(word) = &presence.joint
            && self.joint.take_in_word(presence, word, &mut self.run)
        {
            self.channel.speak_up(self.clock.now());
        }
        self.address_home(&presence.node, presence.incarnation);
        true
    }

    fn take_in_repair(&mut self, repair: &Repair) -> bool {
        if self.channel.peers.name(repair.requester.as_str()).is_none() {
            return false;
        }
        let history = match repair.term {
            0 => Some(&self.home.history),
            term => self.joint.decisions_of(term),
        };
        let Some(history) = history else { return false };
        self.channel.repeat(self.clock.now(), repair, history);
        if repair.term == 0 && repair.from_seq < history.oldest_seq() {
            // The presence tells what cannot be had any more.
            self.channel.speak_up(self.clock.now());
        }
        true
    }
}
