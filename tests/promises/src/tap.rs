//! A link that lets an observer see which bids come in.

use std::collections::BTreeMap;

use skein_dbp::{BidRecord, Message, NodeName};
use skein_wire::{Key, Link, MemoryLink, Payload, State};

/// A node's link, and the records of bids that have come over it.
#[derive(Debug)]
pub(crate) struct TappedLink {
    pub(crate) link: MemoryLink,
    received: Vec<BidRecord>,
    /// The newest life that each other node has been heard of: what comes late from an earlier one does not count.
    lives: BTreeMap<NodeName, u64>,
}

impl TappedLink {
    pub(crate) fn new(link: MemoryLink) -> Self {
        Self { link, received: Vec::new(), lives: BTreeMap::new() }
    }

    /// The records that have come in since the last call, in order.
    pub(crate) fn take_received(&mut self) -> Vec<BidRecord> {
        std::mem::take(&mut self.received)
    }
}

impl Link for TappedLink {
    fn put(&mut self, key: &Key, payload: Vec<u8>) {
        self.link.put(key, payload);
    }

    fn poll(&mut self) -> Option<(Key, Vec<u8>)> {
        let (key, payload) = self.link.poll()?;
        if !key.is_of::<State>()
            && let Ok(Payload::Message(message)) = Payload::decode(&payload)
        {
            self.sees(message);
        }
        Some((key, payload))
    }
}

impl TappedLink {
    fn sees(&mut self, message: Message) {
        let incarnation = match &message {
            Message::Bid(record) => record.incarnation,
            Message::Ack(ack) => ack.home_incarnation,
            Message::Occurrence(occurrence) => occurrence.incarnation,
            Message::Presence(presence) => presence.incarnation,
            Message::Repair(_) => return,
        };
        let newest = self.lives.entry(message.sender().clone()).or_insert(incarnation);
        *newest = incarnation.max(*newest);
        match message {
            Message::Bid(record) if incarnation == *newest => self.received.push(record),
            _ => {}
        }
    }
}
