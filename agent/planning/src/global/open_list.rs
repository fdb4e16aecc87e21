//! The open list of a best-first search.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::grid::Packed;

/// More ranges than this are not told apart.
const MOST_RANGES: usize = 4096;

/// A cell that waits to be expanded: least `key` first, then least `tie`, then lowest cell, so that ties have one answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Open {
    pub key: f64,
    pub tie: f64,
    pub cell: Packed,
}

impl Ord for Open {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        let by_key = other.key.total_cmp(&self.key);
        by_key.then_with(|| other.tie.total_cmp(&self.tie)).then_with(|| other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Open {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

/// The cells that wait, in exact order. Only those whose keys are in the lowest range are kept in a heap; the others wait in
/// heaps' raw material, a list for each range, because most of what a search opens it never expands.
#[derive(Clone, Debug, Default)]
pub(super) struct OpenList {
    lowest: BinaryHeap<Open>,
    /// By range.
    later: Vec<Vec<Open>>,
    /// The range that `lowest` holds, with all below it.
    range: usize,
    /// Where the ranges begin, and how wide they are.
    origin: f64,
    width: f64,
    len: usize,
}

impl OpenList {
    /// Empties it, for keys that begin at about `origin` and grow by about `width` from cell to cell. Memory is kept.
    pub fn reset(&mut self, origin: f64, width: f64) {
        self.lowest.clear();
        self.later.iter_mut().for_each(Vec::clear);
        (self.range, self.origin, self.width, self.len) = (0, origin, width, 0);
    }

    pub fn len(&self) -> usize {
        self.len
    }

    #[inline]
    pub fn push(&mut self, open: Open) {
        self.len += 1;
        // A cast keeps to the ends: what is less than the origin is in the first range.
        let range = (((open.key - self.origin) / self.width) as usize).min(MOST_RANGES);
        if range <= self.range {
            self.lowest.push(open);
            return;
        }
        if range >= self.later.len() {
            self.later.resize_with(range + 1, Vec::new);
        }
        self.later[range].push(open);
    }

    /// The first, without taking it.
    #[inline]
    pub fn peek(&mut self) -> Option<Open> {
        while self.lowest.is_empty() && self.range + 1 < self.later.len() {
            self.range += 1;
            let emptied = std::mem::take(&mut self.lowest).into_vec();
            self.lowest = std::mem::replace(&mut self.later[self.range], emptied).into();
        }
        self.lowest.peek().copied()
    }

    /// Takes the first.
    #[inline]
    pub fn pop(&mut self) -> Option<Open> {
        self.peek()?;
        self.len -= 1;
        self.lowest.pop()
    }

    /// All of them, in no order that means anything.
    pub fn iter(&self) -> impl Iterator<Item = &Open> {
        self.lowest.iter().chain(self.later.iter().flatten())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::map::VoxelIndex;

    proptest! {
        #[test]
        fn the_least_comes_first_whatever_was_pushed_meanwhile(
            keys in prop::collection::vec((-3.0..40.0_f64, 0..3_u8, prop::bool::weighted(0.3)), 1..200),
            width in 0.01..5.0_f64,
        ) {
            let mut list = OpenList::default();
            let mut heap = BinaryHeap::new();
            for _ in 0..2 {
                list.reset(keys[0].0, width);
                heap.clear();
                for (number, (key, tie, pops)) in keys.iter().enumerate() {
                    let cell = Packed::of(VoxelIndex { x: number, y: 0, z: 0 });
                    let open = Open { key: key.round(), tie: f64::from(*tie), cell };
                    list.push(open);
                    heap.push(open);
                    if *pops {
                        prop_assert_eq!(list.pop(), heap.pop());
                    }
                    prop_assert_eq!((list.len(), list.iter().count()), (heap.len(), heap.len()));
                }
                while let Some(open) = heap.pop() {
                    prop_assert_eq!(list.peek(), Some(open));
                    prop_assert_eq!(list.pop(), Some(open));
                }
                prop_assert_eq!(list.pop(), None);
            }
        }
    }
}
