//! The states that a search looks at next, and their order.

use crate::verify::store::START;

/// In which order states are looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Search {
    /// Those nearest to the start first, so that a violation is shown by a shortest run.
    #[default]
    BreadthFirst,
    /// One run to its end, then the next.
    DepthFirst,
}

/// The states to look at next.
#[derive(Debug)]
pub(super) enum Frontier {
    /// All in the order of their numbers.
    Queue { next: u32, depth: u32, level_end: u32 },
    /// The latest first, with their depths; those of one state in the order of its moves.
    Stack { waiting: Vec<(u32, u32)>, fresh: usize },
}

impl Frontier {
    pub(super) fn new(order: Search) -> Self {
        match order {
            Search::BreadthFirst => Self::Queue { next: START, depth: 0, level_end: START + 1 },
            Search::DepthFirst => Self::Stack { waiting: vec![(START, 0)], fresh: 1 },
        }
    }

    /// The number and depth of the next state, of so many known.
    pub(super) fn next(&mut self, known: usize) -> Option<(u32, u32)> {
        match self {
            Self::Queue { next, depth, level_end } => {
                if *next as usize >= known {
                    return None;
                }
                if next == level_end {
                    *level_end = known as u32;
                    *depth += 1;
                }
                *next += 1;
                Some((*next - 1, *depth))
            }
            Self::Stack { waiting, fresh } => {
                let state = waiting.pop();
                *fresh = waiting.len();
                state
            }
        }
    }

    pub(super) fn add(&mut self, number: u32, depth: u32) {
        if let Self::Stack { waiting, .. } = self {
            waiting.push((number, depth));
        }
    }

    /// The states added since the last one was given out are all there are from it.
    pub(super) fn added_all(&mut self) {
        if let Self::Stack { waiting, fresh } = self
            && let Some(fresh) = waiting.get_mut(*fresh..)
        {
            fresh.reverse();
        }
    }
}
