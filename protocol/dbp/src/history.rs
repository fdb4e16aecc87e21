//! A home's own occurrences: numbered, and kept for a while for those who missed them.

use std::collections::VecDeque;

use skein_bp::Bound;

use crate::channel::stream::REPAIR_CHUNK;
use crate::message::Occurrence;

/// The latest occurrences of a home, in order.
#[derive(Clone, Debug)]
pub(crate) struct History {
    kept: VecDeque<Occurrence>,
    /// Their weight.
    bytes: usize,
    capacity: usize,
    latest_seq: u64,
    /// Whether all are kept, and whoever adds one sees to it that they are not too many.
    whole: bool,
}

impl History {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { kept: VecDeque::new(), bytes: 0, capacity: capacity.max(1), latest_seq: 0, whole: false }
    }

    /// One that keeps all; see [`is_full`](Self::is_full).
    pub(crate) fn whole(capacity: usize) -> Self {
        Self { whole: true, ..Self::new(capacity) }
    }

    /// Whether there is no room for another one.
    pub(crate) fn is_full(&self) -> bool {
        self.kept.len() >= self.capacity || self.bytes > Bound::HistoryBytes.most()
    }

    /// The weight of all that are kept, bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    /// The number of the latest occurrence, 0 before the first.
    pub(crate) fn latest_seq(&self) -> u64 {
        self.latest_seq
    }

    /// The number of the oldest one kept; of the next one if none is.
    pub(crate) fn oldest_seq(&self) -> u64 {
        self.kept.front().map_or(self.latest_seq + 1, |occurrence| occurrence.seq)
    }

    /// The number that the next occurrence gets.
    pub(crate) fn next_seq(&self) -> u64 {
        self.latest_seq + 1
    }

    pub(crate) fn push(&mut self, occurrence: Occurrence) {
        self.latest_seq = occurrence.seq;
        self.bytes += occurrence.weight();
        while !self.whole
            && (self.kept.len() >= self.capacity || self.bytes > Bound::HistoryBytes.most())
            && let Some(oldest) = self.kept.pop_front()
        {
            self.bytes -= oldest.weight();
        }
        self.kept.push_back(occurrence);
    }

    /// All occurrences after number `seq`; none if some of them are no longer kept.
    pub(crate) fn after(&self, seq: u64) -> Option<impl Iterator<Item = &Occurrence>> {
        let skipped = seq.saturating_add(1).checked_sub(self.oldest_seq())?;
        Some(self.kept.iter().skip(usize::try_from(skipped).unwrap_or(usize::MAX)))
    }

    /// The occurrences kept of the numbers `from..=to`, as many as are repeated at once.
    pub(crate) fn repeat(&self, from: u64, to: u64) -> impl Iterator<Item = &Occurrence> {
        let to = to.min(from.saturating_add(REPAIR_CHUNK - 1));
        self.kept.iter().filter(move |occurrence| (from..=to).contains(&occurrence.seq))
    }
}
