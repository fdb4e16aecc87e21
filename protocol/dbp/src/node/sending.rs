//! Sending what is due: bids, wishes for repair, and signs of life.

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
