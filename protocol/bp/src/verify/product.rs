//! A program as a model: the product of its b-threads' local states.
//!
//! A product state is a row: the number of what is not in b-threads (queues, failure), then the numbers of the local
//! states. B-threads are functions of state and event, so each local move is run once and remembered, and a move of the
//! product is put together from remembered ones. A move that spawns, enqueues or fails is handed to [`Program`] itself.

mod faults;
mod open;

use std::sync::Arc;
use std::time::Duration;

use crate::event::Event;
use crate::program::{Program, Rest};
use crate::verify::bits::{has, ones};
use crate::verify::coverage::Coverage;
use crate::verify::interner::Interner;
use crate::verify::locals::{Cause, ENDED, Kind, Local, Locals, Rules};
use crate::verify::model::{Model, Moves};
use crate::verify::report::{Fault, Inspection};
use crate::verify::view::View;
use crate::verify::{Goal, Invariant, Requirements, Timers};

/// Set in the labels of moves by deadline; the rest of the label is a slot.
const DEADLINE: u32 = 1 << 31;

/// A program under verification.
#[derive(Debug)]
pub(super) struct Product {
    /// The program before its first selection.
    program: Program,
    pub(super) locals: Locals,
    rests: Interner<Beside>,
    timers: Timers,
    feed: Vec<Event>,
    invariants: Vec<Invariant>,
    goals: Vec<Goal>,
    /// Whether external events may come although internal ones can be selected.
    externals_any_time: bool,
    /// Whether rows keep b-threads in the order in which they were added, not in that of their slots.
    in_order: bool,
    order: OrderWatch,
    scratch: Scratch,
}

/// Whether the order in which b-threads were added can make a difference between runs.
#[derive(Clone, Copy, Debug, Default)]
struct OrderWatch {
    /// Two b-threads moved at once, each with an effect on the rest of the program.
    matters: bool,
    /// B-threads were added in an order that is not that of their slots.
    varies: bool,
}

/// The part of a product state beside local states.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Beside {
    /// The external queue, as event numbers.
    externals: Vec<u32>,
    occurrences: Vec<Event>,
    failure: Option<(Arc<str>, String)>,
    /// Whether the program takes what is left of the feed.
    daemon: bool,
    /// The number of events of the feed that were taken.
    fed: usize,
}

/// Kept between expansions to save allocations.
#[derive(Debug, Default)]
struct Scratch {
    blocked: Vec<u64>,
    open: Vec<u64>,
    /// Local states that do not stand for the world.
    own: Vec<u32>,
    /// Places in the row that an event moves.
    movers: Vec<usize>,
    movers_by_event: Vec<Vec<usize>>,
    changes: Vec<(usize, u32)>,
}

impl Product {
    /// `program` need not have run yet.
    pub(super) fn new(
        mut program: Program,
        timers: Timers,
        feed: Vec<Event>,
        requirements: Requirements,
        in_order: bool,
    ) -> Self {
        // A failure is part of the state.
        let _ = program.synchronise(Duration::ZERO);
        let config = program.config();
        let rules = Rules {
            strategy: config.strategy,
            protected: config.protected.clone(),
            home: program.home().clone(),
            world: requirements.world,
            of_bids: requirements.of_bids,
        };
        Self {
            externals_any_time: config.externals_after.is_some(),
            program,
            locals: Locals::new(rules),
            rests: Interner::default(),
            timers,
            feed,
            invariants: requirements.invariants,
            goals: requirements.goals,
            in_order,
            order: OrderWatch::default(),
            scratch: Scratch::default(),
        }
    }

    /// Whether equal rows may stand for states that differ in the order of b-threads, and that may make a difference.
    pub(super) fn order_is_lost(&self) -> bool {
        !self.in_order && self.order.matters && self.order.varies
    }

    /// The b-threads of which a deadline was met that never fires.
    pub(super) fn unfired_deadlines(&self) -> Vec<Arc<str>> {
        match self.timers {
            Timers::AnyTime | Timers::AtRest => Vec::new(),
            Timers::Never => self.locals.names_of(|local| local.bid.given_deadline().is_some()),
        }
    }

    /// The parts of the program that were met so far.
    pub(super) fn coverage(&self) -> Coverage {
        let mut coverage = Coverage::default();
        for (local, causes) in self.locals.all() {
            let seen = coverage.bthreads.entry(local.name.clone()).or_default();
            seen.states += 1;
            if !seen.bids.contains(&local.bid) {
                seen.bids.push(local.bid.clone());
            }
            for cause in causes {
                match cause {
                    Cause::Event(number) => coverage.happened.extend(self.locals.events.get(number).cloned()),
                    Cause::Deadline => seen.timed_out = true,
                }
            }
        }
        coverage
    }

    fn beside(&self, state: &[u32]) -> Option<&Beside> {
        self.rests.get(*state.first()?)
    }

    pub(super) fn view<'a>(&'a self, state: &'a [u32]) -> View<'a> {
        View::new(&self.locals, state, self.beside(state).map_or(&[], |beside| &beside.externals))
    }

    /// The row of a program's state, of whose feed so much was taken.
    fn row_of(&mut self, program: &Program, fed: usize) -> Vec<u32> {
        let Rest { externals, occurrences, failure, daemon } = program.rest();
        let externals = externals.iter().map(|event| self.locals.event(event)).collect();
        let daemon = daemon && fed < self.feed.len();
        let beside = Beside { externals, occurrences: occurrences.into(), failure, daemon, fed };
        let mut row = vec![self.rests.number(beside)];
        for entry in program.entries() {
            row.push(self.locals.intern(&entry.name, entry.owner.clone(), &entry.bid));
        }
        if !self.in_order {
            let locals = &self.locals;
            let by_slot = |id: &u32| locals.slot(*id);
            if let Some(ids) = row.get_mut(1..)
                && !ids.is_sorted_by_key(by_slot)
            {
                ids.sort_unstable_by_key(by_slot);
                self.order.varies = true;
            }
        }
        row
    }

    /// The program in a product state.
    fn program_of(&self, state: &[u32]) -> Program {
        let beside = self.beside(state);
        let rest = Rest {
            externals: self.view(state).external_queue().cloned().collect(),
            occurrences: beside.map(|b| b.occurrences.iter().cloned().collect()).unwrap_or_default(),
            failure: beside.and_then(|beside| beside.failure.clone()),
            daemon: beside.is_some_and(|beside| beside.daemon),
        };
        let seats =
            self.locals.of(state).map(|local| (local.name.clone(), local.owner.clone(), local.bid.clone()));
        self.program.assemble(seats, rest)
    }

    fn fed(&self, state: &[u32]) -> usize {
        self.beside(state).map_or(0, |beside| beside.fed)
    }

    /// Lets the program itself make a move, and gives the state it comes to.
    fn run_program(&mut self, state: &[u32], act: impl FnOnce(&mut Program)) -> Vec<u32> {
        let mut program = self.program_of(state);
        act(&mut program);
        // A failure is part of the state.
        let _ = program.synchronise(Duration::ZERO);
        self.row_of(&program, self.fed(state))
    }

    /// Adds the move of an internal event, or of the external one at a position in the queue.
    fn select(&mut self, state: &[u32], event: u32, external: Option<usize>, moves: &mut Moves) {
        let mut movers = std::mem::take(&mut self.scratch.movers);
        movers.clear();
        for (at, id) in state.iter().enumerate().skip(1) {
            if has(self.locals.bits(*id, Kind::Wakes), event) {
                movers.push(at);
            }
        }
        self.happen(state, event, external, &movers, moves);
        self.scratch.movers = movers;
    }

    /// Adds the move of each event in `scratch.open`.
    fn select_open(&mut self, state: &[u32], moves: &mut Moves) {
        let mut by_event = std::mem::take(&mut self.scratch.movers_by_event);
        by_event.resize_with(by_event.len().max(self.locals.events.len()), Vec::new);
        let open = std::mem::take(&mut self.scratch.open);
        for (at, id) in state.iter().enumerate().skip(1) {
            for (word, (wakes, open)) in self.locals.bits(*id, Kind::Wakes).iter().zip(&open).enumerate() {
                for event in ones(wakes & open) {
                    if let Some(movers) = by_event.get_mut(word * 64 + event) {
                        movers.push(at);
                    }
                }
            }
        }
        for (word, open) in open.iter().enumerate() {
            for event in ones(*open) {
                let event = word * 64 + event;
                if let Some(movers) = by_event.get_mut(event) {
                    self.happen(state, event as u32, None, movers, moves);
                    movers.clear();
                }
            }
        }
        self.scratch.movers_by_event = by_event;
        self.scratch.open = open;
    }

    /// Adds the move of an event that moves those at these places of the row.
    fn happen(
        &mut self,
        state: &[u32],
        event: u32,
        external: Option<usize>,
        movers: &[usize],
        moves: &mut Moves,
    ) {
        let mut changes = std::mem::take(&mut self.scratch.changes);
        changes.clear();
        let (mut effects, mut ended) = (0, false);
        for at in movers {
            let id = state.get(*at).copied().unwrap_or(ENDED);
            let outcome = self.locals.outcome(id, Cause::Event(event));
            effects += usize::from(!outcome.plain);
            ended |= outcome.next == ENDED;
            changes.push((*at, outcome.next));
        }
        self.order.matters |= effects > 1;
        if effects == 0 {
            if external.is_some() {
                changes.push((0, self.without_external(state, external)));
            }
            push(moves, event, state, &changes, ended);
        } else if let Some(happens) = self.locals.events.get(event).cloned() {
            let row = self.run_program(state, |program| program.select(happens, external));
            moves.push(event, row);
        }
        self.scratch.changes = changes;
    }

    /// The number of what is beside the local states once an external event was taken from the queue.
    fn without_external(&mut self, state: &[u32], external: Option<usize>) -> u32 {
        let present = state.first().copied().unwrap_or(0);
        match (external, self.beside(state)) {
            (Some(at), Some(beside)) => {
                let mut beside = beside.clone();
                beside.externals.remove(at);
                self.rests.number(beside)
            }
            _ => present,
        }
    }

    /// Adds a move for each b-thread whose deadline may fire.
    fn fire_deadlines(&mut self, state: &[u32], moves: &mut Moves) {
        for (at, id) in state.iter().enumerate().skip(1) {
            let Some(local) = self.locals.get(*id).filter(|local| local.bid.given_deadline().is_some())
            else {
                continue;
            };
            let (label, name) = (DEADLINE | local.slot, local.name.clone());
            let outcome = self.locals.outcome(*id, Cause::Deadline);
            if outcome.plain {
                let row =
                    state.iter().enumerate().map(|(place, id)| if place == at { outcome.next } else { *id });
                moves.push(
                    label,
                    row.enumerate().filter(|(place, id)| *place == 0 || *id != ENDED).map(|(_, id)| id),
                );
            } else {
                let row = self.run_program(state, |program| program.fire_deadline(&name, Duration::ZERO));
                moves.push(label, row);
            }
        }
    }

    /// Gives a daemon that has come to rest events of its feed until one can be selected, and adds that move.
    fn feed(&mut self, state: &[u32], moves: &mut Moves) {
        let Some(beside) = self.beside(state) else { return };
        if !beside.daemon || !self.locals.of(state).any(|local| !local.is_proxy()) {
            return;
        }
        let mut beside = beside.clone();
        while let Some(event) = self.feed.get(beside.fed) {
            beside.externals.push(self.locals.event(&event.clone()));
            beside.fed += 1;
            beside.daemon = beside.fed < self.feed.len();
            let mut fed = state.to_vec();
            if let Some(rest) = fed.first_mut() {
                *rest = self.rests.number(beside.clone());
            }
            self.find_open(&fed);
            if let Some(at) = self.next_external(&fed)
                && let Some(event) = self.beside(&fed).and_then(|beside| beside.externals.get(at)).copied()
            {
                return self.select(&fed, event, Some(at), moves);
            }
        }
    }
}

impl Model for Product {
    fn start(&mut self) -> Vec<u32> {
        let program = self.program.clone();
        self.row_of(&program, 0)
    }

    fn expand(&mut self, state: &[u32], moves: &mut Moves) {
        let Some(beside) = self.beside(state) else { return };
        if beside.failure.is_some() {
            return;
        }
        if let Some(event) = beside.occurrences.first().cloned() {
            let label = self.locals.event(&event);
            let row = self.run_program(state, |program| {
                // It was not failed before.
                let _ = program.step(Duration::ZERO);
            });
            return moves.push(label, row);
        }
        self.find_open(state);
        let external = self.next_external(state);
        let before = moves.len();
        self.select_open(state, moves);
        let at_rest = moves.len() == before;
        if let Some(at) = external.filter(|_| at_rest || self.externals_any_time)
            && let Some(event) = self.beside(state).and_then(|beside| beside.externals.get(at)).copied()
        {
            self.select(state, event, Some(at), moves);
        }
        if !self.locals.rules.world.is_empty() && (at_rest || self.externals_any_time) {
            self.find_open_to_world(state);
            self.select_open(state, moves);
        }
        if moves.len() == before {
            self.feed(state, moves);
        }
        if self.timers == Timers::AnyTime || self.timers == Timers::AtRest && at_rest {
            self.fire_deadlines(state, moves);
        }
    }

    fn fault(&self, state: &[u32], stuck: bool, inspections: &[Inspection]) -> Option<Fault> {
        inspections
            .iter()
            .find_map(|inspection| self.fault_by(inspection, state, stuck))
            .or_else(|| self.broken_by_bid(state))
            .or_else(|| self.broken_invariant(state))
    }

    fn busy(&mut self, state: &[u32], bthreads: &mut Vec<u32>) {
        self.find_open(state);
        let open = &self.scratch.open;
        let is_open = |local: &&Local| local.requests.iter().any(|event| has(open, *event));
        bthreads.extend(self.locals.of(state).filter(|l| !l.is_world).filter(is_open).map(|l| l.slot));
    }

    fn goals(&self) -> Vec<String> {
        self.goals.iter().map(|goal| goal.name.clone()).collect()
    }

    fn meets(&self, goal: usize, state: &[u32]) -> bool {
        self.goals.get(goal).is_none_or(|goal| (goal.holds)(&self.view(state)))
    }

    fn hot(&self, state: &[u32], bthreads: &mut Vec<u32>) {
        bthreads.extend(self.locals.of(state).filter(|local| local.bid.is_hot()).map(|local| local.slot));
    }

    fn bthread(&self, number: u32) -> Arc<str> {
        self.locals.slot_name(number).cloned().unwrap_or_else(|| "".into())
    }

    fn event(&self, label: u32) -> Event {
        if label & DEADLINE != 0 {
            return Event::timeout().with("bthread", self.bthread(label & !DEADLINE));
        }
        self.locals.events.get(label).cloned().unwrap_or_else(|| Event::new(""))
    }
}

/// Adds a move that changes a state in these places, where a b-thread may have ended.
fn push(moves: &mut Moves, label: u32, state: &[u32], changes: &[(usize, u32)], ended: bool) {
    if !ended {
        return moves.push_changed(label, state, changes.iter().copied());
    }
    let changed = |at: usize| changes.iter().find(|(place, _)| *place == at).map(|(_, word)| *word);
    let row = state.iter().enumerate().map(|(at, word)| (at, changed(at).unwrap_or(*word)));
    moves.push(label, row.filter(|(at, word)| *at == 0 || *word != ENDED).map(|(_, word)| word));
}
