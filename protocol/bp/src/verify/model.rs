//! What a search needs to know of a system: its states, its moves, and what is wrong with a state.

use std::sync::Arc;

use super::{Fault, Inspection};
use crate::event::Event;

/// A system of states and moves.
///
/// A state is a short row of numbers, each of which stands for a part that the model knows in full; equal rows must mean
/// equal states, and unequal rows unequal ones. So equality of states is exact and cheap, however large the parts are.
pub trait Model {
    /// The state in which every run begins.
    fn start(&mut self) -> Vec<u32>;

    /// Adds every move that is possible in `state`, in a fixed order.
    fn expand(&mut self, state: &[u32], moves: &mut Moves);

    /// What is wrong with `state` by one of the `inspections`; `stuck`: it has no moves. Those of cycles are not asked
    /// here.
    fn fault(&self, state: &[u32], stuck: bool, inspections: &[Inspection]) -> Option<Fault>;

    /// Adds the numbers of the b-threads that are hot in `state`, each once.
    fn hot(&self, state: &[u32], bthreads: &mut Vec<u32>);

    /// The name of a b-thread that [`Model::hot`] gave by number.
    fn bthread(&self, number: u32) -> Arc<str>;

    /// The event that a move of this label shows in a trace.
    fn event(&self, label: u32) -> Event;
}

/// The moves out of one state: labels, and the states they lead to.
#[derive(Clone, Debug, Default)]
pub struct Moves {
    labels: Vec<u32>,
    /// Where each target ends in `words`.
    ends: Vec<usize>,
    words: Vec<u32>,
}

impl Moves {
    /// Adds a move to the state `target`.
    pub fn push(&mut self, label: u32, target: impl IntoIterator<Item = u32>) {
        self.labels.push(label);
        self.words.extend(target);
        self.ends.push(self.words.len());
    }

    /// How many moves there are.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Label and target of each move, in the order in which they were added.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &[u32])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let targets =
            starts.zip(&self.ends).map(|(start, end)| self.words.get(start..*end).unwrap_or_default());
        self.labels.iter().copied().zip(targets)
    }

    pub(super) fn clear(&mut self) {
        self.labels.clear();
        self.ends.clear();
        self.words.clear();
    }
}
