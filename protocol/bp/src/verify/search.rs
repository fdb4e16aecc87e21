//! The search through a model's states.

use std::sync::Arc;

use super::cycle::HotGraph;
use super::goals::{Unexplored, out_of_reach};
use super::model::{Model, Moves};
use super::report::{Fault, Inspection, Omission, Progress, Report, Violation};
use super::rows::hash;
use super::store::{Arrival, MOST_STATES, START, Store};
use super::two_threads;

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

/// How many states are looked at before a second thread is worth its while.
const ALONE: usize = 1 << 12;
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
    seen.report(model, fault, inspections)
}

/// The same by two threads, where they help. The outcome is the same.
pub(super) fn check_by_two<M: Model + Send>(
    model: &mut M,
    limits: &Limits,
    inspections: &[Inspection],
    progress: &mut dyn FnMut(&Progress),
) -> Report {
    let mut seen = Exploration::new(model, limits);
    let fault = match seen.run_alone(model, inspections, progress, ALONE) {
        Outcome::Goes if limits.order == Search::BreadthFirst => {
            two_threads::run(&mut seen, model, inspections, progress)
        }
        Outcome::Goes => seen.run(model, inspections, progress),
        Outcome::Ends(fault) => fault,
    };
    seen.report(model, fault, inspections)
}

fn hot_cycle<M: Model>(model: &mut M, store: &Store, inspections: &[Inspection]) -> Option<Violation> {
    let is_cycles = |inspection: &&Inspection| {
        matches!(inspection, Inspection::HotBThread | Inspection::HotRun(_) | Inspection::HotSystem)
    };
    let mut asked = inspections.iter().filter(is_cycles).peekable();
    asked.peek()?;
    let graph = HotGraph::of_hot(model, store);
    asked.find_map(|inspection| graph.violation(model, store, inspection))
}

/// What has been seen so far.
#[derive(Debug)]
pub(super) struct Exploration {
    pub(super) store: Store,
    limits: Limits,
    pub(super) frontier: Frontier,
    edges: u64,
    depth: u32,
    /// How many states were gone on from.
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
    fn run_alone<M: Model>(
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

    fn report<M: Model>(
        mut self,
        model: &mut M,
        fault: Option<(u32, Fault)>,
        inspections: &[Inspection],
    ) -> Report {
        let verdict = match fault {
            Some((number, Fault { kind, violators })) => {
                let trace = self.store.path(number).into_iter().map(|label| model.event(label)).collect();
                Some(Violation { kind, violators, trace, cycle_length: None })
            }
            None => hot_cycle(model, &self.store, inspections),
        };
        let mut longest_burst = None;
        let verdict = verdict.or_else(|| {
            if !inspections.contains(&Inspection::Unsettled) {
                return None;
            }
            let busy = HotGraph::of_busy(model, &self.store);
            let endless = busy.violation(model, &self.store, &Inspection::Unsettled);
            if endless.is_none() {
                longest_burst = Some(busy.longest_burst());
            }
            endless
        });
        let verdict = verdict.or_else(|| out_of_reach(model, &self.store, self.unexplored()));
        let not_covered = self.take_not_covered();
        Report {
            verdict,
            states: self.store.len(),
            edges: self.edges,
            depth: self.depth,
            longest_burst,
            not_covered,
        }
    }

    /// The states that were not gone on from, or not with all their moves.
    fn unexplored(&self) -> Unexplored {
        let cut = !self.not_covered.is_empty();
        match &self.frontier {
            // The last that was looked at may lack moves.
            _ if self.too_deep > 0 => Unexplored::Any,
            Frontier::Queue { next, .. } if cut => Unexplored::From(next.saturating_sub(1)),
            Frontier::Stack { .. } if cut => Unexplored::Any,
            _ => Unexplored::None,
        }
    }

    /// What was not looked at.
    pub(super) fn take_not_covered(&mut self) -> Vec<Omission> {
        let mut not_covered = std::mem::take(&mut self.not_covered);
        if self.too_deep > 0 {
            not_covered.push(Omission::DepthBound { deepest: self.limits.deepest, moves: self.too_deep });
        }
        not_covered
    }

    /// How many states were gone on from.
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

/// How a search stands.
#[derive(Debug)]
pub(super) enum Outcome {
    /// There may be more to look at.
    Goes,
    /// It is over, with a state at fault or without.
    Ends(Option<(u32, Fault)>),
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
    fn new(order: Search) -> Self {
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
