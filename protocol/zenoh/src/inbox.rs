//! The messages that wait at one link.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use skein_wire::{Key, MAX_PAYLOAD};

use crate::bell::Bell;

/// So many bytes may wait at a link, however few messages they are.
const MOST_BYTES: usize = 64 << 20;

/// A bounded ring: when it is full, the oldest message makes room, because newer ones supersede it.
#[derive(Debug)]
pub(crate) struct Inbox {
    waiting: Mutex<Waiting>,
    capacity: usize,
    /// Whether a message makes the one before under its key void.
    of_newest: bool,
    /// Rung when a message has come.
    pub(crate) bell: Bell,
    pub(crate) received: AtomicU64,
    pub(crate) dropped: AtomicU64,
    pub(crate) misnamed: AtomicU64,
    pub(crate) oversized: AtomicU64,
}

#[derive(Debug, Default)]
struct Waiting {
    messages: VecDeque<(Key, Vec<u8>)>,
    bytes: usize,
}

impl Waiting {
    fn pop(&mut self) -> Option<(Key, Vec<u8>)> {
        let message = self.messages.pop_front()?;
        self.bytes -= message.1.len();
        Some(message)
    }
}

impl Inbox {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            waiting: Mutex::default(),
            capacity,
            of_newest: false,
            bell: Bell::default(),
            received: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
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
        let Ok(key) = key.parse() else {
            count(&self.misnamed);
            return;
        };
        if bytes > MAX_PAYLOAD {
            count(&self.oversized);
            return;
        }
        let payload = payload();
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        if self.of_newest
            && let Some((_, before)) = waiting.messages.iter_mut().find(|(waiting, _)| *waiting == key)
        {
            let length = payload.len();
            let before = std::mem::replace(before, payload);
            waiting.bytes = waiting.bytes + length - before.len();
            return;
        }
        while waiting.messages.len() >= self.capacity || waiting.bytes + payload.len() > MOST_BYTES {
            if waiting.pop().is_none() {
                break;
            }
            count(&self.dropped);
        }
        waiting.bytes += payload.len();
        waiting.messages.push_back((key, payload));
        drop(waiting);
        self.bell.ring();
    }

    pub(crate) fn pop(&self) -> Option<(Key, Vec<u8>)> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).messages.is_empty()
    }
}

#[cfg(test)]
mod tests {
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
        assert_eq!((read(&inbox.received), read(&inbox.dropped), read(&inbox.misnamed)), (4, 1, 1));
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
        assert_eq!((read(&inbox.dropped), inbox.waiting.lock().unwrap().bytes), (0, 0));
    }

    #[test]
    fn neither_one_long_message_nor_many_fill_the_memory() {
        let inbox = Inbox::new(1 << 20);
        inbox.push(KEY, MAX_PAYLOAD + 1, || panic!("a payload that is too long was read"));
        assert_eq!(read(&inbox.oversized), 1);
        for _ in 0..80 {
            inbox.push(KEY, MAX_PAYLOAD, || vec![0; MAX_PAYLOAD]);
        }
        let kept: usize = std::iter::from_fn(|| inbox.pop()).map(|(_, payload)| payload.len()).sum();
        assert_eq!(kept, MOST_BYTES);
        assert!(inbox.is_empty() && inbox.bell.wait(std::time::Duration::ZERO));
    }
}
