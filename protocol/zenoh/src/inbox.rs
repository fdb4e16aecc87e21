//! What has arrived for one link.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use skein_wire::Key;

/// A bounded ring: when it is full, the oldest message makes room, because newer ones supersede it.
#[derive(Debug)]
pub(crate) struct Inbox {
    messages: Mutex<VecDeque<(Key, Vec<u8>)>>,
    capacity: usize,
    pub(crate) received: AtomicU64,
    pub(crate) dropped: AtomicU64,
    pub(crate) misnamed: AtomicU64,
}

impl Inbox {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            messages: Mutex::new(VecDeque::new()),
            capacity,
            received: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
            misnamed: AtomicU64::new(0),
        }
    }

    /// Takes in a message under a key of Skein's; others are counted.
    pub(crate) fn push(&self, key: &str, payload: impl FnOnce() -> Vec<u8>) {
        self.received.fetch_add(1, Ordering::Relaxed);
        let Ok(key) = key.parse() else {
            self.misnamed.fetch_add(1, Ordering::Relaxed);
            return;
        };
        let payload = payload();
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == self.capacity {
            messages.pop_front();
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        messages.push_back((key, payload));
    }

    pub(crate) fn pop(&self) -> Option<(Key, Vec<u8>)> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_makes_room_and_strange_keys_are_counted() {
        let inbox = Inbox::new(2);
        for byte in 0..3 {
            inbox.push("skein/demo/state/uav/1", || vec![byte]);
        }
        inbox.push("elsewhere", || panic!("the payload of a strange key was read"));
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        assert_eq!((read(&inbox.received), read(&inbox.dropped), read(&inbox.misnamed)), (4, 1, 1));
        let payloads: Vec<_> = std::iter::from_fn(|| inbox.pop()).map(|(_, payload)| payload).collect();
        assert_eq!(payloads, [vec![1], vec![2]]);
    }
}
