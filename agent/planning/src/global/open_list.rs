//! The open list of a best-first search.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::grid::Packed;

/// Keys are told apart to 2^-32 of the list's unit: sums of the same costs in different order are the same key, so
/// that ties are ties.
const FRACTION_BITS: u32 = 32;
/// A range is a quarter of the unit wide.
const RANGE_BITS: u32 = FRACTION_BITS - 2;
/// More ranges than this are not told apart.
const MOST_RANGES: usize = 1 << 16;

/// A cell that waits to be expanded: least `rank` first, then least `tie`, then lowest cell, so that ties have one
/// answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Open {
    /// The key as a whole number: see [`OpenList::rank`].
    pub rank: i64,
    /// Bits of a number that is not negative, which are in the numbers' order; all inverted if the greatest comes
    /// first.
    pub tie: u64,
    pub cell: Packed,
}

impl Ord for Open {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        (other.rank, other.tie, other.cell).cmp(&(self.rank, self.tie, self.cell))
    }
}

impl PartialOrd for Open {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The cells that wait, in exact order. Only those whose keys are in the lowest range are kept in a heap; the others
/// wait in heaps' raw material, a list for each range, because most of what a search opens it never expands.
#[derive(Clone, Debug, Default)]
pub(super) struct OpenList {
    lowest: BinaryHeap<Open>,
    /// By range; empty from `used` on.
    later: Vec<Vec<Open>>,
    used: usize,
    /// The range that `lowest` holds, with all below it.
    range: usize,
    /// The rank at which the ranges begin.
    origin: i64,
    ranks_per_key: f64,
    len: usize,
}

impl OpenList {
    /// Empties it, for keys that begin at about `origin` and grow by about `unit` from cell to cell. Memory is kept.
    pub fn reset(&mut self, origin: f64, unit: f64) {
        self.lowest.clear();
        self.later.iter_mut().take(self.used).for_each(Vec::clear);
        self.ranks_per_key = (1_u64 << FRACTION_BITS) as f64 / unit;
        (self.range, self.used, self.len) = (0, 0, 0);
        self.origin = self.rank(origin);
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// A key, which is not negative, as a whole number.
    #[inline]
    pub fn rank(&self, key: f64) -> i64 {
        (key * self.ranks_per_key + 0.5) as i64
    }

    #[inline]
    pub fn push(&mut self, key: f64, tie: u64, cell: Packed) {
        self.len += 1;
        let open = Open { rank: self.rank(key), tie, cell };
        // What is less than the origin is in the first range.
        let range = (open.rank.saturating_sub(self.origin).max(0) >> RANGE_BITS) as usize;
        let range = range.min(MOST_RANGES);
        if range <= self.range {
            self.lowest.push(open);
            return;
        }
        if range >= self.later.len() {
            self.later.resize_with(range + 1, Vec::new);
        }
        self.used = self.used.max(range + 1);
        self.later[range].push(open);
    }

    /// The first, without taking it.
    #[inline]
    pub fn peek(&mut self) -> Option<Open> {
        self.raise();
        self.lowest.peek().copied()
    }

    /// Takes the first.
    #[inline]
    pub fn pop(&mut self) -> Option<Open> {
        self.raise();
        let first = self.lowest.pop()?;
        self.len -= 1;
        Some(first)
    }

    /// Puts the first back that was taken last.
    pub fn put_back(&mut self, first: Open) {
        self.len += 1;
        self.lowest.push(first);
    }

    /// Goes on to the next range that is not empty, if there is nothing left in this one.
    #[inline]
    fn raise(&mut self) {
        if self.lowest.is_empty() && self.len > 0 {
            self.next_range();
        }
    }

    fn next_range(&mut self) {
        let later = self.later.get(self.range + 1..self.used).unwrap_or_default();
        let empty = later.iter().take_while(|range| range.is_empty()).count();
        self.range += 1 + empty;
        let emptied = std::mem::take(&mut self.lowest).into_vec();
        self.lowest = std::mem::replace(&mut self.later[self.range], emptied).into();
    }

    /// All of them, in no order that means anything.
    pub fn iter(&self) -> impl Iterator<Item = &Open> {
        self.lowest.iter().chain(self.later.iter().take(self.used).flatten())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::map::VoxelIndex;

    #[test]
    fn sums_that_differ_by_rounding_are_ties() {
        let mut list = OpenList::default();
        list.reset(0.0, 1.0);
        let sums = [0.1 + 0.2 + 0.3, 0.3 + 0.2 + 0.1];
        assert_ne!(sums[0], sums[1]);
        assert_eq!(list.rank(sums[0]), list.rank(sums[1]));
        assert!(list.rank(0.6) < list.rank(0.600_000_001));
        assert_eq!(list.rank(f64::INFINITY), i64::MAX);
    }

    proptest! {
        #[test]
        fn the_least_comes_first_whatever_was_pushed_meanwhile(
            keys in prop::collection::vec((0.0..40.0_f64, 0..3_u8, prop::bool::weighted(0.3)), 1..200),
            unit in 0.01..5.0_f64,
        ) {
            let mut list = OpenList::default();
            let mut heap = BinaryHeap::new();
            for _ in 0..2 {
                list.reset(keys[0].0, unit);
                heap.clear();
                for (number, (key, tie, pops)) in keys.iter().enumerate() {
                    let cell = Packed::of(VoxelIndex { x: number, y: 0, z: 0 });
                    let (key, tie) = (key.round(), (*tie).into());
                    list.push(key, tie, cell);
                    heap.push(Open { rank: list.rank(key), tie, cell });
                    if *pops {
                        prop_assert_eq!(list.pop(), heap.pop());
                    }
                    prop_assert_eq!((list.len(), list.iter().count()), (heap.len(), heap.len()));
                }
                while let Some(open) = heap.pop() {
                    prop_assert_eq!(list.pop(), Some(open));
                    list.put_back(open);
                    prop_assert_eq!(list.pop(), Some(open));
                }
                prop_assert_eq!(list.pop(), None);
            }
        }
    }
}
