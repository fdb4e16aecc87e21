//! The search through a model's states.

use std::sync::Arc;

use super::cycle::HotGraph;
use super::model::{Model, Moves};
use super::report::{Fault, Inspection, Omission, Progress, Report, Violation};
use super::store::{Arrival, MOST_STATES, START, Store};

/// In which order states are looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Search {
    /// Those nearest to the start first, so that a violation is shown by a shortest run.
    #[default]
    BreadthFirst,
    /// One run to its end, then the next.
    DepthFirst,
}

/// How a model is searched, and how far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// In which order.
    pub order: Search,
    /// How many states may be stored; each takes some tens of bytes.
    pub most_states: usize,
    /// How long the runs may be that are looked at.
    pub deepest: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self { order: Search::BreadthFirst, most_states: MOST_STATES, deepest: u32::MAX }
    }
}

/// How many states are looked at from one report of progress to the next.
const PROGRESS_EVERY: usize = 1 << 15;

/// Looks at every state that `model` can reach, and at its cycles, until one is at fault or a bound is reached.
pub fn check<M: Model>(
    model: &mut M,
    limits: &Limits,
    inspections: &[Inspection],
    progress: &mut dyn FnMut(&Progress),
) -> Report {
    let mut seen = Exploration::new(model, limits);
    let fault = seen.run(model, inspections, progress);
    let verdict = match fault {
        Some((number, Fault { kind, violators })) => {
            let trace = seen.store.path(number).into_iter().map(|label| model.event(label)).collect();
            Some(Violation { kind, violators, trace, cycle_length: None })
        }
        None => hot_cycle(model, &seen, inspections),
    };
    Report {
        verdict,
        states: seen.store.len(),
        edges: seen.edges,
        depth: seen.depth,
        not_covered: seen.not_covered,
    }
}

fn hot_cycle<M: Model>(model: &mut M, seen: &Exploration, inspections: &[Inspection]) -> Option<Violation> {
    let is_cycles = |inspection: &&Inspection| {
        matches!(inspection, Inspection::HotBThread | Inspection::HotRun(_) | Inspection::HotSystem)
    };
    let mut asked = inspections.iter().filter(is_cycles).peekable();
    asked.peek()?;
    let graph = HotGraph::of(model, &seen.store);
    asked.find_map(|inspection| graph.violation(model, &seen.store, inspection))
}

/// What has been seen so far.
#[derive(Debug)]
pub(super) struct Exploration {
    pub(super) store: Store,
    limits: Limits,
    frontier: Frontier,
    edges: u64,
    depth: u32,
    /// Moves that lead to unseen states beyond the greatest depth.
    too_deep: u64,
    pub(super) not_covered: Vec<Omission>,
}

impl Exploration {
    pub(super) fn new<M: Model>(model: &mut M, limits: &Limits) -> Self {
        let mut store = Store::new();
        store.insert(&model.start(), Arrival { from: START, label: 0 });
        Self {
            store,
            limits: Limits { most_states: limits.most_states.clamp(1, MOST_STATES), ..*limits },
            frontier: Frontier::new(limits.order),
            edges: 0,
            depth: 0,
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
        let (mut moves, mut state, mut fault) = (Moves::default(), Vec::new(), None);
        let mut explored = 0_usize;
        while let Some((number, depth)) = self.frontier.next(self.store.len()) {
            self.depth = self.depth.max(depth);
            state.clear();
            state.extend_from_slice(self.store.state(number));
            moves.clear();
            model.expand(&state, &mut moves);
            explored += 1;
            let fits = self.follow(number, depth, &moves);
            fault = model.fault(&state, moves.is_empty(), inspections).map(|fault| (number, fault));
            let unexplored = self.store.len() - explored;
            if fault.is_some() {
                if unexplored > 0 {
                    self.not_covered.push(Omission::StoppedAtViolation { unexplored });
                }
                break;
            }
            if !fits {
                let most_states = self.limits.most_states;
                self.not_covered.push(Omission::StateBound { most_states, unexplored: unexplored + 1 });
                break;
            }
            if explored.is_multiple_of(PROGRESS_EVERY) {
                progress(&Progress { states: self.store.len(), edges: self.edges, unexplored, depth });
            }
        }
        if self.too_deep > 0 {
            let Limits { deepest, .. } = self.limits;
            self.not_covered.push(Omission::DepthBound { deepest, moves: self.too_deep });
        }
        fault
    }

    /// Takes in the moves out of a state; false if there is no room for all.
    fn follow(&mut self, from: u32, depth: u32, moves: &Moves) -> bool {
        for (label, target) in moves.iter() {
            let full = self.store.len() >= self.limits.most_states;
            if (full || depth >= self.limits.deepest) && self.store.find(target).is_none() {
                if full {
                    return false;
                }
                self.too_deep += 1;
                continue;
            }
            self.edges += 1;
            if let Some(number) = self.store.insert(target, Arrival { from, label }) {
                self.frontier.add(number, depth + 1);
            }
        }
        self.frontier.added_all();
        true
    }
}

/// The states to look at next.
#[derive(Debug)]
enum Frontier {
    /// All in the order of their numbers.
    Queue { next: u32, depth: u32, level_end: u32 },
    /// The latest first, with their depths; those of one state in the order of its moves.
    Stack { waiting: Vec<(u32, u32)>, fresh: usize },
}

impl Frontier {
    fn new(order: Search) -> Self {
        match order {
            Search::BreadthFirst => Self::Queue { next: START, depth: 0, level_end: START + 1 },
            Search::DepthFirst => Self::Stack { waiting: vec![(START, 0)], fresh: 1 },
        }
    }

    /// The number and depth of the next state, of so many known.
    fn next(&mut self, known: usize) -> Option<(u32, u32)> {
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

    fn add(&mut self, number: u32, depth: u32) {
        if let Self::Stack { waiting, .. } = self {
            waiting.push((number, depth));
        }
    }

    /// The states added since the last one was given out are all there are from it.
    fn added_all(&mut self) {
        if let Self::Stack { waiting, fresh } = self
            && let Some(fresh) = waiting.get_mut(*fresh..)
        {
            fresh.reverse();
        }
    }
}

/// The names of b-threads, given by number.
pub(super) fn names<M: Model>(model: &M, numbers: &[u32]) -> Vec<Arc<str>> {
    numbers.iter().map(|number| model.bthread(*number)).collect()
}
