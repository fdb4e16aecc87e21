//! A link that lets an observer see which bids come in.

use skein_dbp::{BidRecord, Message};
use skein_wire::{Key, Link, MemoryLink, Payload, Topic};

/// A node's link, and the records of bids that have come over it.
#[derive(Debug)]
pub(crate) struct TappedLink {
    pub(crate) link: MemoryLink,
    received: Vec<BidRecord>,
}

impl TappedLink {
    pub(crate) fn new(link: MemoryLink) -> Self {
        Self { link, received: Vec::new() }
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
        if matches!(key.topic(), Topic::Bid { .. })
            && let Ok(Payload::Message(Message::Bid(record))) = Payload::decode(&payload)
        {
            self.received.push(record);
        }
        Some((key, payload))
    }
}
