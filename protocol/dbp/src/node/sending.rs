//! Sending what is due: bids, wishes for repair, and signs of life.

use crate::joint::Joint;
use crate::node::{Node, PRESENCES_KNOWN};
use crate::outbox::Sender;
use crate::stream::Stream;
use crate::{Message, Presence, Recipient, Repair};

impl Node {
    pub(super) fn send_what_is_due(&mut self) {
        let sender = Sender {
            node: &self.config.name,
            incarnation: self.config.incarnation,
            lease: self.config.lease,
            term: self.term(),
            decided: self.joint.as_ref().map_or(0, Joint::decided),
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
                let repair = Repair { home: home.clone(), incarnation, from_seq, to_seq, term: 0, requester };
                self.outgoing.push((Recipient::Node(home.clone()), Message::Repair(repair)));
            }
        }
        self.ask_for_decisions();
        let asks = self.wants_to_decide();
        if self.now >= self.presence_due || (asks && !self.asking) {
            let beat = if asks { 10 } else { 3 };
            self.presence_due = self.now + self.config.lease / beat;
            self.send_presence(asks);
        }
        self.asking = asks;
    }

    fn send_presence(&mut self, asks: bool) {
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
            joint: self.joint.as_ref().map(|joint| joint.word(asks)),
        };
        self.outgoing.push((Recipient::All, Message::Presence(presence)));
    }
}
