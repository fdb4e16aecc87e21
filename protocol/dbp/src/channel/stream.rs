//! The occurrences of another home, put back in order (G1).

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use skein_bp::Bound;

use crate::message::Occurrence;

/// Most holes that are asked for at once.
const MOST_HOLES: usize = 8;
/// Most occurrences of one hole that are asked for, and repeated, at once.
pub(crate) const REPAIR_CHUNK: u64 = 64;

/// A piece of a stream, given out in order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Heard {
    /// The next occurrence.
    Occurrence(Occurrence),
    /// The occurrences of these numbers are lost for good.
    Gap { from: u64, to: u64 },
}

/// The first and the last number of occurrences that are missed.
pub(crate) type Hole = (u64, u64);

/// The occurrences of one home, as far as they are known.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stream {
    incarnation: Option<u64>,
    /// Number up to which all has been given out, once it is known where to begin.
    applied: Option<u64>,
    /// Highest number known to exist.
    latest: u64,
    /// Occurrences ahead of a hole.
    pending: BTreeMap<u64, Occurrence>,
    /// Their weight.
    pending_bytes: usize,
    repair_due: Duration,
}

impl Stream {
    /// The number up to which this home's occurrences have been given out.
    pub(crate) fn applied(&self) -> u64 {
        self.applied.unwrap_or(0)
    }

    /// The occurrences that wait behind a hole, and their bytes.
    pub(crate) fn waiting(&self) -> (usize, usize) {
        (self.pending.len(), self.pending_bytes)
    }

    /// The life of the home that is heard.
    pub(crate) fn incarnation(&self) -> Option<u64> {
        self.incarnation
    }

    /// Whether it is known from where on this home is heard.
    pub(crate) fn has_begun(&self) -> bool {
        self.applied.is_some()
    }

    /// The home lives in a new incarnation. The rest of the old one is given out, its holes as gaps.
    ///
    /// A home that was known before is heard from its first occurrence on; for one met now, its presence tells.
    pub(crate) fn restart(&mut self, incarnation: u64, heard: &mut VecDeque<Heard>) {
        let known_before = self.incarnation.is_some();
        if let Some(applied) = self.applied {
            let latest = self.latest;
            let mut at = applied;
            for (seq, occurrence) in std::mem::take(&mut self.pending) {
                if seq > at + 1 {
                    heard.push_back(Heard::Gap { from: at + 1, to: seq - 1 });
                }
                heard.push_back(Heard::Occurrence(occurrence));
                at = seq;
            }
            if latest > at {
                heard.push_back(Heard::Gap { from: at + 1, to: latest });
            }
        }
        *self =
            Self { incarnation: Some(incarnation), applied: known_before.then_some(0), ..Self::default() };
    }

    /// Begins with the first occurrence of `incarnation`, whenever that was.
    pub(crate) fn begin(&mut self, incarnation: u64) {
        *self = Self { incarnation: Some(incarnation), applied: Some(0), ..Self::default() };
    }

    /// The home lives: its latest occurrence is `latest`, and it can repeat those from `oldest` on. `from_start`: it
    /// started no earlier than this node, so nothing of it may be missed.
    pub(crate) fn presence(
        &mut self,
        latest: u64,
        oldest: u64,
        from_start: bool,
        heard: &mut VecDeque<Heard>,
    ) {
        let begin = if from_start { 0 } else { latest };
        let applied = *self.applied.get_or_insert(begin);
        self.latest = self.latest.max(latest);
        let oldest = oldest.min(latest + 1);
        if oldest > applied + 1 {
            self.give_up_before(oldest, heard);
        }
        self.give_out(heard);
    }

    /// The home has said that its occurrences have come to `latest`.
    pub(crate) fn latest_is(&mut self, latest: u64) {
        self.latest = self.latest.max(latest);
    }

    /// An occurrence has arrived, in order or not.
    pub(crate) fn occurrence(&mut self, occurrence: Occurrence, heard: &mut VecDeque<Heard>) {
        let seq = occurrence.seq;
        self.latest = self.latest.max(seq);
        if self.pending.is_empty() && self.applied.is_some_and(|applied| seq == applied + 1) {
            self.applied = Some(seq);
            heard.push_back(Heard::Occurrence(occurrence));
            return;
        }
        let wanted = self.applied.is_none_or(|applied| seq > applied);
        let is_next = Some(seq) == self.applied.map(|applied| applied + 1);
        let has_room = self.pending.len() < Bound::PendingOccurrences.most()
            && self.pending_bytes < Bound::PendingBytes.most();
        if wanted
            && (is_next || has_room)
            && let Entry::Vacant(vacant) = self.pending.entry(seq)
        {
            self.pending_bytes += occurrence.weight();
            vacant.insert(occurrence);
        }
        self.give_out(heard);
    }

    /// The home's incarnation and the holes to ask for now, both ends included; asks again `patience` later.
    pub(crate) fn repair(&mut self, now: Duration, patience: Duration) -> Option<(u64, Vec<Hole>)> {
        let incarnation = self.incarnation?;
        let holes = self.holes();
        if holes.is_empty() || now < self.repair_due {
            return None;
        }
        self.repair_due = now + patience;
        Some((incarnation, holes))
    }

    /// When a hole wants to be asked for next.
    pub(crate) fn next_deadline(&self) -> Option<Duration> {
        (self.latest > self.applied?).then_some(self.repair_due)
    }

    /// The first few holes.
    fn holes(&self) -> Vec<Hole> {
        let Some(applied) = self.applied else { return Vec::new() };
        let (mut holes, mut from) = (Vec::new(), applied + 1);
        for next in self.pending.keys().copied().chain([self.latest + 1]) {
            if next > from {
                holes.push((from, (next - 1).min(from + REPAIR_CHUNK - 1)));
            }
            if holes.len() == MOST_HOLES {
                break;
            }
            from = next + 1;
        }
        holes
    }

    /// Numbers below `oldest` will not be had any more.
    fn give_up_before(&mut self, oldest: u64, heard: &mut VecDeque<Heard>) {
        let mut applied = self.applied();
        while let Some(first) = self.pending.first_entry().filter(|first| *first.key() < oldest) {
            let (seq, occurrence) = first.remove_entry();
            self.pending_bytes -= occurrence.weight();
            if seq > applied + 1 {
                heard.push_back(Heard::Gap { from: applied + 1, to: seq - 1 });
            }
            heard.push_back(Heard::Occurrence(occurrence));
            applied = seq;
        }
        if oldest > applied + 1 {
            heard.push_back(Heard::Gap { from: applied + 1, to: oldest - 1 });
            applied = oldest - 1;
        }
        self.applied = Some(applied);
    }

    /// Gives out what has become next in order.
    fn give_out(&mut self, heard: &mut VecDeque<Heard>) {
        let Some(mut applied) = self.applied else { return };
        while let Some(first) = self.pending.first_entry().filter(|first| *first.key() <= applied + 1) {
            let (seq, occurrence) = first.remove_entry();
            self.pending_bytes -= occurrence.weight();
            if seq == applied + 1 {
                heard.push_back(Heard::Occurrence(occurrence));
                applied = seq;
            }
        }
        self.applied = Some(applied);
        if self.pending.is_empty() {
            // An emptied map keeps a node of its tree, for every home.
            self.pending = BTreeMap::new();
        }
    }
}

#[cfg(test)]
mod tests {
    use skein_bp::Event;

    use super::*;
    use crate::name::NodeName;

    fn occurrence(seq: u64) -> Occurrence {
        Occurrence {
            home: NodeName::new("uav/1").unwrap(),
            incarnation: 1,
            seq,
            term: 0,
            event: Event::new("uav/1/x"),
            requests_served: vec![],
            requested_by: vec![],
            choice: None,
            at: Duration::ZERO,
        }
    }

    /// Numbers given out, negative for the last of a gap.
    fn numbers(heard: &VecDeque<Heard>) -> Vec<i64> {
        let number = |heard: &Heard| match heard {
            Heard::Occurrence(occurrence) => occurrence.seq as i64,
            Heard::Gap { to, .. } => -(*to as i64),
        };
        heard.iter().map(number).collect()
    }

    fn started() -> (Stream, VecDeque<Heard>) {
        let (mut stream, mut heard) = (Stream::default(), VecDeque::new());
        stream.restart(1, &mut heard);
        (stream, heard)
    }

    #[test]
    fn order_is_restored_and_repeats_are_dropped() {
        let (mut stream, mut heard) = started();
        stream.presence(0, 1, true, &mut heard);
        for seq in [2, 1, 1, 2, 4, 4, 3] {
            stream.occurrence(occurrence(seq), &mut heard);
        }
        assert_eq!(numbers(&heard), [1, 2, 3, 4]);
    }

    #[test]
    fn what_comes_before_the_first_presence_waits_for_it() {
        let (mut stream, mut heard) = started();
        stream.occurrence(occurrence(3), &mut heard);
        assert!(heard.is_empty());
        stream.presence(3, 1, true, &mut heard);
        assert!(heard.is_empty(), "1 and 2 are still missing");
        assert_eq!(stream.repair(Duration::ZERO, Duration::from_millis(100)), Some((1, vec![(1, 2)])));
        assert_eq!(stream.repair(Duration::ZERO, Duration::from_millis(100)), None, "asked again too soon");
        for seq in [1, 2] {
            stream.occurrence(occurrence(seq), &mut heard);
        }
        assert_eq!(numbers(&heard), [1, 2, 3]);
        assert_eq!(stream.next_deadline(), None);
    }

    #[test]
    fn several_holes_are_asked_for_at_once() {
        let (mut stream, mut heard) = started();
        stream.presence(9, 1, true, &mut heard);
        for seq in [3, 4, 7] {
            stream.occurrence(occurrence(seq), &mut heard);
        }
        assert_eq!(stream.repair(Duration::ZERO, Duration::ZERO), Some((1, vec![(1, 2), (5, 6), (8, 9)])));
    }

    #[test]
    fn a_late_joiner_begins_at_the_present() {
        let (mut stream, mut heard) = started();
        stream.presence(40, 1, false, &mut heard);
        stream.occurrence(occurrence(40), &mut heard);
        stream.occurrence(occurrence(41), &mut heard);
        assert_eq!(numbers(&heard), [41]);
    }

    #[test]
    fn the_lost_tail_is_asked_for() {
        let (mut stream, mut heard) = started();
        stream.presence(0, 1, true, &mut heard);
        stream.presence(2, 1, true, &mut heard);
        assert_eq!(stream.repair(Duration::ZERO, Duration::ZERO), Some((1, vec![(1, 2)])));
    }

    #[test]
    fn what_the_home_has_forgotten_becomes_a_gap() {
        let (mut stream, mut heard) = started();
        stream.presence(0, 1, true, &mut heard);
        stream.occurrence(occurrence(2), &mut heard);
        stream.occurrence(occurrence(7), &mut heard);
        stream.presence(7, 6, true, &mut heard);
        assert_eq!(numbers(&heard), [-1, 2, -5]);
        stream.occurrence(occurrence(6), &mut heard);
        assert_eq!(numbers(&heard), [-1, 2, -5, 6, 7]);
    }

    #[test]
    fn a_restart_closes_the_old_stream() {
        let (mut stream, mut heard) = started();
        stream.presence(0, 1, true, &mut heard);
        stream.occurrence(occurrence(2), &mut heard);
        stream.latest_is(4);
        stream.restart(2, &mut heard);
        assert_eq!(numbers(&heard), [-1, 2, -4]);
        stream.occurrence(occurrence(1), &mut heard);
        assert_eq!(numbers(&heard), [-1, 2, -4, 1], "the new life of a known home is heard from its start");
    }
}
