//! The messages that wait at one link.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use skein_wire::{Key, Mailbox, NodeName, Owner};

use crate::bell::Bell;

/// A mailbox that Zenoh's threads fill and one loop empties.
#[derive(Debug)]
pub(crate) struct Inbox {
    waiting: Mutex<Mailbox>,
    /// Whether a message makes the one before under its key void.
    of_newest: bool,
    /// Rung when a message has come.
    pub(crate) bell: Bell,
    pub(crate) received: AtomicU64,
    pub(crate) misnamed: AtomicU64,
    pub(crate) oversized: AtomicU64,
}

impl Inbox {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            waiting: Mutex::new(Mailbox::new(capacity)),
            of_newest: false,
            bell: Bell::default(),
            received: AtomicU64::new(0),
            misnamed: AtomicU64::new(0),
            oversized: AtomicU64::new(0),
        }
    }

    /// An inbox in which of the messages under one key only the newest waits.
    pub(crate) fn of_newest(capacity: usize) -> Self {
        Self { of_newest: true, ..Self::new(capacity) }
    }

    /// Takes in a message of `bytes` under a key of Skein's; others, and those that are too long, are counted and not
    /// even copied.
    pub(crate) fn push(&self, key: &str, bytes: usize, payload: impl FnOnce() -> Vec<u8>) {
        let count = |counter: &AtomicU64| counter.fetch_add(1, Ordering::Relaxed);
        count(&self.received);
        let Ok(key) = key.parse::<Key>() else {
            count(&self.misnamed);
            return;
        };
        if bytes > key.most_bytes() {
            count(&self.oversized);
            return;
        }
        let payload = payload();
        let mut waiting = self.waiting();
        if self.of_newest {
            waiting.push_newest(key, payload);
        } else {
            waiting.push(key, payload);
        }
        drop(waiting);
        self.bell.ring();
    }

    pub(crate) fn pop(&self) -> Option<(Key, Vec<u8>)> {
        self.waiting().pop()
    }

    pub(crate) fn meet(&self, members: &[NodeName]) {
        self.waiting().meet(members.iter().cloned());
    }

    pub(crate) fn len(&self) -> usize {
        self.waiting().len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting().is_empty()
    }

    /// The messages that had to go because more had come than may wait, by sender.
    pub(crate) fn dropped(&self) -> BTreeMap<Owner, u64> {
        self.waiting().dropped().clone()
    }

    fn waiting(&self) -> MutexGuard<'_, Mailbox> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use skein_wire::Fleet;

    use super::*;

    const KEY: &str = "skein/demo/state/uav/1";

    fn read(counter: &AtomicU64) -> u64 {
        counter.load(Ordering::Relaxed)
    }

    #[test]
    fn the_oldest_makes_room_and_strange_keys_are_counted() {
        let inbox = Inbox::new(2);
        for byte in 0..3 {
            inbox.push(KEY, 1, || vec![byte]);
        }
        inbox.push("elsewhere", 1, || panic!("the payload of a strange key was read"));
        let dropped: u64 = inbox.dropped().values().sum();
        assert_eq!((read(&inbox.received), dropped, read(&inbox.misnamed)), (4, 1, 1));
        let payloads: Vec<_> = std::iter::from_fn(|| inbox.pop()).map(|(_, payload)| payload).collect();
        assert_eq!(payloads, [vec![1], vec![2]]);
    }

    #[test]
    fn where_only_the_newest_counts_one_key_takes_one_place() {
        let inbox = Inbox::of_newest(2);
        inbox.push("skein/demo/state/uav/2", 1, || vec![7]);
        for byte in 0..100 {
            inbox.push(KEY, 2, || vec![byte, byte]);
        }
        let payloads: Vec<_> = std::iter::from_fn(|| inbox.pop()).map(|(_, payload)| payload).collect();
        assert_eq!(payloads, [vec![7], vec![99, 99]]);
        assert!(inbox.dropped().is_empty() && inbox.is_empty());
    }

    #[test]
    fn neither_one_long_message_nor_many_fill_the_memory() {
        let inbox = Inbox::new(1 << 20);
        let longest = skein_wire::Key::to_all::<skein_wire::State>(
            &Fleet::new("demo").unwrap(),
            NodeName::new("uav/1").unwrap(),
        )
        .most_bytes();
        inbox.push(KEY, longest + 1, || panic!("a payload that is too long was read"));
        assert_eq!(read(&inbox.oversized), 1);
        for _ in 0..2000 {
            inbox.push(KEY, longest, || vec![0; longest]);
        }
        let kept: usize = std::iter::from_fn(|| inbox.pop()).map(|(_, payload)| payload.len()).sum();
        assert!((longest..=512 << 10).contains(&kept), "{kept}");
        assert!(inbox.is_empty() && inbox.bell.wait(std::time::Duration::ZERO));
    }

    #[test]
    fn a_member_is_heard_whatever_others_send() {
        let inbox = Inbox::new(4096);
        inbox.meet(&[NodeName::new("uav/1").unwrap()]);
        inbox.push(KEY, 1, || vec![7]);
        for number in 0..30_000 {
            inbox.push(&format!("skein/demo/state/uav/x{number}"), 1, || vec![0]);
        }
        let of_member = std::iter::from_fn(|| inbox.pop()).find(|(key, _)| key.sender().as_str() == "uav/1");
        assert_eq!(of_member.map(|(_, payload)| payload), Some(vec![7]));
    }
}
