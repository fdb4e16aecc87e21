//! One node's link over Zenoh.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use skein_wire::{Key, Link, NodeName, Owner};

use crate::bell::Bell;
use crate::inbox::Inbox;
use crate::queue::Entry;

/// One node's link over a [`ZenohSession`](crate::ZenohSession). It never waits.
#[derive(Debug)]
pub struct ZenohLink {
    /// Keeps the session open.
    session: Arc<Entry>,
    port: u64,
    inbox: Arc<Inbox>,
}

/// Counts of the messages that have arrived at a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ZenohLinkStats {
    /// Messages that arrived.
    pub received: u64,
    /// Messages dropped because the node did not take them in time.
    pub dropped: u64,
    /// Messages under keys that are none of Skein's.
    pub misnamed: u64,
    /// Messages longer than any may be.
    pub oversized: u64,
}

impl ZenohLink {
    pub(crate) fn new(session: Arc<Entry>, port: u64, inbox: Arc<Inbox>) -> Self {
        Self { session, port, inbox }
    }

    /// Rings when a message has arrived.
    pub fn bell(&self) -> Bell {
        self.inbox.bell.clone()
    }

    /// The messages that wait.
    pub fn waiting(&self) -> usize {
        self.inbox.len()
    }

    pub fn is_empty(&self) -> bool {
        self.inbox.is_empty()
    }

    /// The messages dropped because the node did not take them in time, by sender; under no name those of all who are not
    /// of the roster.
    pub fn dropped(&self) -> BTreeMap<Owner, u64> {
        self.inbox.dropped()
    }

    pub fn stats(&self) -> ZenohLinkStats {
        ZenohLinkStats {
            received: self.inbox.received.load(Ordering::Relaxed),
            dropped: self.inbox.dropped().values().sum(),
            misnamed: self.inbox.misnamed.load(Ordering::Relaxed),
            oversized: self.inbox.oversized.load(Ordering::Relaxed),
        }
    }
}

impl Link for ZenohLink {
    fn meet(&mut self, members: &[NodeName]) {
        self.inbox.meet(members);
    }

    fn put(&mut self, key: &Key, payload: Vec<u8>) {
        self.session.put(self.port, key, payload);
    }

    fn poll(&mut self) -> Option<(Key, Vec<u8>)> {
        self.inbox.pop()
    }
}

impl Drop for ZenohLink {
    fn drop(&mut self) {
        self.session.leave(self.port);
    }
}
