//! The states of a model that a search has seen so far, and the way on from them.

use crate::verify::frontier::{Frontier, Search};
use crate::verify::goals::Unexplored;
use crate::verify::model::{Model, Moves};
use crate::verify::report::{Fault, Inspection, Omission, Progress};
use crate::verify::rows::hash;
use crate::verify::store::{Arrival, MOST_STATES, START, Store};

/// States that are looked at from one report of progress to the next.
const PROGRESS_EVERY: usize = 1 << 15;

/// The order and the bounds of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    pub order: Search,
    /// The most states that may be stored; each takes some tens of bytes.
    pub most_states: usize,
    /// The longest runs that are looked at.
    pub deepest: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self { order: Search::BreadthFirst, most_states: MOST_STATES, deepest: u32::MAX }
    }
}

#[derive(Debug)]
pub(super) struct Exploration {
    pub(super) store: Store,
    pub(super) limits: Limits,
    pub(super) frontier: Frontier,
    pub(super) edges: u64,
    pub(super) depth: u32,
    /// The number of states that were gone on from.
    explored: usize,
    /// Moves that lead to unseen states beyond the greatest depth.
    too_deep: u64,
    not_covered: Vec<Omission>,
}

impl Exploration {
    pub(super) fn new<M: Model>(model: &mut M, limits: &Limits) -> Self {
        let mut store = Store::new();
        let start = model.start();
        store.insert(&start, hash(&start), Arrival { from: START, label: 0 });
        Self {
            store,
            limits: Limits { most_states: limits.most_states.clamp(1, MOST_STATES), ..*limits },
            frontier: Frontier::new(limits.order),
            edges: 0,
            depth: 0,
            explored: 0,
            too_deep: 0,
            not_covered: Vec::new(),
        }
    }

    /// Explores until a state is at fault, and gives it.
    pub(super) fn run<M: Model>(
        &mut self,
        model: &mut M,
        inspections: &[Inspection],
        progress: &mut dyn FnMut(&Progress),
    ) -> Option<(u32, Fault)> {
        match self.run_alone(model, inspections, progress, usize::MAX) {
            Outcome::Goes => None,
            Outcome::Ends(fault) => fault,
        }
    }

    /// Explores until a state is at fault, or so many were looked at.
    pub(super) fn run_alone<M: Model>(
        &mut self,
        model: &mut M,
        inspections: &[Inspection],
        progress: &mut dyn FnMut(&Progress),
        most: usize,
    ) -> Outcome {
        let (mut moves, mut state) = (Moves::default(), Vec::new());
        while let Some((number, depth)) = self.frontier.next(self.store.len()) {
            state.clear();
            state.extend_from_slice(self.store.state(number));
            moves.clear();
            model.expand(&state, &mut moves);
            let fault = model.fault(&state, moves.is_empty(), inspections);
            if let ended @ Outcome::Ends(_) = self.take_in(number, depth, moves.hashed(), fault, progress) {
                return ended;
            }
            if self.explored >= most {
                return Outcome::Goes;
            }
        }
        Outcome::Ends(None)
    }

    /// The states that were not gone on from, or not with all their moves.
    pub(super) fn unexplored(&self) -> Unexplored {
        let cut = !self.not_covered.is_empty();
        match &self.frontier {
            // The last that was looked at may lack moves.
            _ if self.too_deep > 0 => Unexplored::Any,
            Frontier::Queue { next, .. } if cut => Unexplored::From(next.saturating_sub(1)),
            Frontier::Stack { .. } if cut => Unexplored::Any,
            _ => Unexplored::None,
        }
    }

    /// The omissions so far.
    pub(super) fn take_not_covered(&mut self) -> Vec<Omission> {
        let mut not_covered = std::mem::take(&mut self.not_covered);
        if self.too_deep > 0 {
            not_covered.push(Omission::DepthBound { deepest: self.limits.deepest, moves: self.too_deep });
        }
        not_covered
    }

    /// The number of states that were gone on from.
    pub(super) fn explored(&self) -> usize {
        self.explored
    }

    /// Takes in what there is to a state: its moves, and its fault.
    pub(super) fn take_in<'a>(
        &mut self,
        number: u32,
        depth: u32,
        moves: impl Iterator<Item = (u32, &'a [u32], u32)>,
        fault: Option<Fault>,
        progress: &mut dyn FnMut(&Progress),
    ) -> Outcome {
        self.explored += 1;
        self.depth = self.depth.max(depth);
        let fits = self.follow(number, depth, moves);
        let unexplored = self.store.len() - self.explored;
        if let Some(fault) = fault {
            if unexplored > 0 {
                self.not_covered.push(Omission::StoppedAtViolation { unexplored });
            }
            return Outcome::Ends(Some((number, fault)));
        }
        if !fits {
            let most_states = self.limits.most_states;
            self.not_covered.push(Omission::StateBound { most_states, unexplored: unexplored + 1 });
            return Outcome::Ends(None);
        }
        if self.explored.is_multiple_of(PROGRESS_EVERY) {
            progress(&Progress { states: self.store.len(), edges: self.edges, unexplored, depth });
        }
        Outcome::Goes
    }

    /// Takes in the moves out of a state; false if there is no room for all.
    fn follow<'a>(
        &mut self,
        from: u32,
        depth: u32,
        moves: impl Iterator<Item = (u32, &'a [u32], u32)>,
    ) -> bool {
        for (label, target, hash) in moves {
            let full = self.store.len() >= self.limits.most_states;
            if (full || depth >= self.limits.deepest) && self.store.find(target).is_none() {
                if full {
                    return false;
                }
                self.too_deep += 1;
                continue;
            }
            self.edges += 1;
            if let Some(number) = self.store.insert(target, hash, Arrival { from, label }) {
                self.frontier.add(number, depth + 1);
            }
        }
        self.frontier.added_all();
        true
    }
}

/// Whether a search goes on.
#[derive(Debug)]
pub(super) enum Outcome {
    /// There may be more to look at.
    Goes,
    /// It is over, with a state at fault or without.
    Ends(Option<(u32, Fault)>),
}
