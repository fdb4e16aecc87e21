//! Tries a script before it runs: alone, in a world where everything that it waits for may happen at any time.
//!
//! What the script shall not do there is keep something from ever happening again, or go round by itself without
//! waiting for anybody. Blocks inside one another that end in time are tried with the innermost ending first.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use super::samples::samples;
use super::{Op, Script};
use crate::bid::Bid;
use crate::bound::Bound;
use crate::event::Event;
use crate::event_set::EventSet;
use crate::program::{Program, ProgramConfig};
use crate::verify::{Graph, GraphEdge, Timers, Verifier};

/// The findings of a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// The number of states of the script and its world, as far as they were looked at.
    pub states: usize,
    /// Whether all were looked at.
    pub is_complete: bool,
}

/// A fault of a script, and the shortest way there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TrialFault {
    #[error("it blocks `{event}` for ever{}; give it a `within_s`, or something to wait for that can happen", after(.trace))]
    NeverLetsGo { event: Event, trace: Vec<Event> },
    #[error("it goes round without waiting for anything: {}{}", list(.cycle), after(.trace))]
    Spins { cycle: Vec<Event>, trace: Vec<Event> },
}

fn list(events: &[Event]) -> String {
    let events: Vec<String> = events.iter().map(Event::to_string).collect();
    events.join(", ")
}

fn after(trace: &[Event]) -> String {
    if trace.is_empty() { " from the start".to_owned() } else { format!(" after {}", list(trace)) }
}

impl Script {
    /// Events that the script blocks somewhere: for each of its sets some, as far as it distinguishes them.
    pub fn blocked(&self) -> BTreeSet<Event> {
        let blocks: Vec<&EventSet> = self.bids().map(Bid::blocks).collect();
        some_of(&blocks)
    }

    /// Events that the script waits for or is ended by somewhere: for each of its sets some, as far as it distinguishes
    /// them.
    pub fn listened_to(&self) -> BTreeSet<Event> {
        let hears: Vec<&EventSet> = self.bids().flat_map(|bid| [bid.waits(), bid.interrupts()]).collect();
        some_of(&hears)
    }

    /// Whether there are more events that it distinguishes than it is tried with.
    fn distinguishes_more(&self) -> bool {
        let blocks: Vec<&EventSet> = self.bids().map(Bid::blocks).collect();
        let hears: Vec<&EventSet> = self.bids().flat_map(|bid| [bid.waits(), bid.interrupts()]).collect();
        [blocks, hears].iter().any(|sets| samples(sets).nth(Bound::ScriptEvents.most()).is_some())
    }

    /// Tries the script in no more than `most_states` states.
    ///
    /// # Errors
    /// [`TrialFault`]: the script can get into a state that it should not.
    pub fn try_out(&self, most_states: usize) -> Result<Trial, TrialFault> {
        let own: BTreeSet<&str> = self.bids().flat_map(Bid::requests).map(Event::name).collect();
        let held = self.blocked();
        let world: BTreeSet<Event> = self.listened_to().union(&held).cloned().collect();

        let mut program = Program::new(ProgramConfig::default());
        program.add("script", self.clone());
        let any = world.iter().fold(Bid::new(), Bid::request);
        if let Ok(world) = Self::new(&[Op::forever([Op::Sync(any)])]) {
            program.add("world", world);
        }
        let graph = Verifier::new(program).timers(Timers::AnyTime).most_states(most_states).graph();
        let paths = Paths::of(&graph);
        let is_complete = graph.not_covered.is_empty() && !self.distinguishes_more();
        // What was not looked at might let go.
        for event in held.into_iter().filter(|_| is_complete) {
            if let Some(state) = paths.never_again(&event) {
                return Err(TrialFault::NeverLetsGo { event, trace: paths.to(state) });
            }
        }
        let by_itself = |event: &Event| own.contains(event.name()) && !world.contains(event);
        if let Some((state, cycle)) = paths.cycle(by_itself) {
            return Err(TrialFault::Spins { cycle, trace: paths.to(state) });
        }
        Ok(Trial { states: graph.states.len(), is_complete })
    }
}

/// Events of the sets, as far as these distinguish them.
fn some_of(sets: &[&EventSet]) -> BTreeSet<Event> {
    let some = samples(sets).take(Bound::ScriptEvents.most());
    some.filter(|event| sets.iter().any(|set| set.contains(event))).collect()
}

/// The ways through a graph.
struct Paths<'a> {
    states: u32,
    edges: &'a [GraphEdge],
    /// By state: the edges that leave it and that lead to it.
    out: BTreeMap<u32, Vec<&'a GraphEdge>>,
    into: BTreeMap<u32, Vec<&'a GraphEdge>>,
}

impl<'a> Paths<'a> {
    fn of(graph: &'a Graph) -> Self {
        let (mut out, mut into) = (BTreeMap::<_, Vec<_>>::new(), BTreeMap::<_, Vec<_>>::new());
        for edge in &graph.edges {
            out.entry(edge.from).or_default().push(edge);
            into.entry(edge.to).or_default().push(edge);
        }
        Self { states: graph.states.len() as u32, edges: &graph.edges, out, into }
    }

    fn leaving(&self, state: u32) -> impl Iterator<Item = &'a GraphEdge> + '_ {
        self.out.get(&state).into_iter().flatten().copied()
    }

    /// The first state from which no way leads to one where `event` may happen.
    fn never_again(&self, event: &Event) -> Option<u32> {
        let allowing = self.edges.iter().filter(|edge| edge.event == *event);
        let mut good: BTreeSet<u32> = allowing.map(|edge| edge.from).collect();
        let mut queue: Vec<u32> = good.iter().copied().collect();
        while let Some(state) = queue.pop() {
            for edge in self.into.get(&state).into_iter().flatten() {
                if good.insert(edge.from) {
                    queue.push(edge.from);
                }
            }
        }
        (0..self.states).find(|state| !good.contains(state))
    }

    /// The first cycle of nothing but such events: where it begins, and what happens in it.
    fn cycle(&self, such: impl Fn(&Event) -> bool) -> Option<(u32, Vec<Event>)> {
        let next = |state| self.leaving(state).filter(|edge| such(&edge.event));
        self.out.keys().copied().find_map(|start| {
            let mut came: BTreeMap<u32, &GraphEdge> = BTreeMap::new();
            let mut queue = vec![start];
            while let Some(state) = queue.pop() {
                for edge in next(state) {
                    if edge.to == start {
                        came.insert(start, edge);
                        return Some((start, walk_back(&came, start, start)));
                    }
                    if let Entry::Vacant(first) = came.entry(edge.to) {
                        first.insert(edge);
                        queue.push(edge.to);
                    }
                }
            }
            None
        })
    }

    /// The shortest way from the start to a state.
    fn to(&self, goal: u32) -> Vec<Event> {
        let mut came: BTreeMap<u32, &GraphEdge> = BTreeMap::new();
        let mut queue = std::collections::VecDeque::from([0]);
        while let Some(state) = queue.pop_front() {
            for edge in self.leaving(state) {
                if edge.to != 0 && !came.contains_key(&edge.to) {
                    came.insert(edge.to, edge);
                    queue.push_back(edge.to);
                }
            }
        }
        if goal == 0 { Vec::new() } else { walk_back(&came, 0, goal) }
    }
}

/// The events on the way from `start` to `goal`, of which each state knows the edge that led to it.
fn walk_back(came: &BTreeMap<u32, &GraphEdge>, start: u32, goal: u32) -> Vec<Event> {
    let mut events = Vec::new();
    let mut state = goal;
    while let Some(edge) = came.get(&state) {
        events.push(edge.event.clone());
        state = edge.from;
        if state == start {
            break;
        }
    }
    events.reverse();
    events
}
