//! A system to be searched: its states, its moves, and what is wrong with a state.

use std::sync::Arc;

use crate::event::Event;
use crate::verify::report::{Fault, Inspection};
use crate::verify::rows::{Rows, hash};

/// A system of states and moves.
///
/// A state is a short row of numbers, each of which stands for a part that the model knows in full; equal rows must
/// mean equal states, and unequal rows unequal ones. So equality of states is exact and cheap, however large the parts
/// are.
pub trait Model {
    /// The state in which every run begins.
    fn start(&mut self) -> Vec<u32>;

    /// Adds every move that is possible in `state`, in a fixed order.
    fn expand(&mut self, state: &[u32], moves: &mut Moves);

    /// The fault of `state` by one of the `inspections`; `stuck`: it has no moves. Those of cycles are not asked
    /// here.
    fn fault(&self, state: &[u32], stuck: bool, inspections: &[Inspection]) -> Option<Fault>;

    /// Adds the numbers of the b-threads that are hot in `state`, each once.
    fn hot(&self, state: &[u32], bthreads: &mut Vec<u32>);

    /// Adds the numbers of the b-threads that keep the system from resting in `state`, each once.
    fn busy(&mut self, state: &[u32], bthreads: &mut Vec<u32>) {
        let _ = (state, bthreads);
    }

    /// Adds the numbers of what is due in `state`, each once: it comes about sooner or later unless a move forestalls
    /// it. A run in which something is due from some state on and never comes about is none (justice in the sense of
    /// Manna and Pnueli 1992).
    fn due(&mut self, state: &[u32], due: &mut Vec<u32>) {
        let _ = (state, due);
    }

    /// The things that come about, or are forestalled, with a move of this label, by the numbers that [`Model::due`]
    /// gives.
    fn brings_about(&self, label: u32) -> &[u32] {
        let _ = label;
        &[]
    }

    /// The names of the goals that must stay within reach.
    fn goals(&self) -> Vec<String> {
        Vec::new()
    }

    fn meets(&self, goal: usize, state: &[u32]) -> bool {
        let _ = (goal, state);
        true
    }

    /// The name of a b-thread that [`Model::hot`] or [`Model::busy`] gave by number.
    fn bthread(&self, number: u32) -> Arc<str>;

    /// The event that a move of this label shows in a trace.
    fn event(&self, label: u32) -> Event;
}

/// The names of b-threads, given by number.
pub(super) fn names<M: Model>(model: &M, numbers: &[u32]) -> Vec<Arc<str>> {
    numbers.iter().map(|number| model.bthread(*number)).collect()
}

/// Moves: labels, and the states they lead to.
#[derive(Clone, Debug, Default)]
pub struct Moves {
    labels: Vec<u32>,
    targets: Rows,
    hashes: Vec<u32>,
}

impl Moves {
    /// Adds a move to the state `target`.
    pub fn push(&mut self, label: u32, target: impl IntoIterator<Item = u32>) {
        self.labels.push(label);
        self.targets.words.extend(target);
        self.close();
    }

    /// Adds a move to a state that differs from `state` only in these places.
    pub fn push_changed(
        &mut self,
        label: u32,
        state: &[u32],
        changes: impl IntoIterator<Item = (usize, u32)>,
    ) {
        self.labels.push(label);
        let start = self.targets.words.len();
        self.targets.words.extend_from_slice(state);
        let target = self.targets.words.get_mut(start..).unwrap_or_default();
        for (at, word) in changes {
            if let Some(place) = target.get_mut(at) {
                *place = word;
            }
        }
        self.close();
    }

    /// The number of moves.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Label and target of each move, in the order in which they were added.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &[u32])> {
        self.hashed().map(|(label, target, _)| (label, target))
    }

    /// Label and target of each move with the target's hash.
    pub(super) fn hashed(&self) -> impl Iterator<Item = (u32, &[u32], u32)> {
        let targets = (0..self.labels.len()).map(|at| self.targets.get(at));
        self.labels
            .iter()
            .zip(targets)
            .zip(&self.hashes)
            .map(|((label, target), hash)| (*label, target, *hash))
    }

    pub(super) fn clear(&mut self) {
        self.labels.clear();
        self.targets.clear();
        self.hashes.clear();
    }

    fn close(&mut self) {
        self.targets.close();
        let target = self.targets.get(self.targets.len() - 1);
        self.hashes.push(hash(target));
    }
}
