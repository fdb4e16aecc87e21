//! Hot cycles: runs that go on for ever while someone must not stay where it is. And bursts, which must not go on for
//! ever: what a program selects between two rests.

use std::collections::VecDeque;

use rustc_hash::FxHashMap;

use super::model::{Model, Moves, names};
use super::report::{Inspection, Violation, ViolationKind};
use super::rows::Rows;
use super::store::Store;

/// The states in which someone is hot, and the moves among them. States are counted anew, in the order of the search.
#[derive(Debug)]
pub(super) struct HotGraph {
    /// Numbers in the search.
    states: Vec<u32>,
    /// The hot b-threads of each, by number, sorted.
    hot: Rows<u32>,
    /// Labels and targets.
    moves: Rows<(u32, u32)>,
    /// The things that are due in each, and may not be so for ever along a cycle.
    due: Rows<u32>,
    /// Those of them that moves of a label bring about, for labels of moves that bring about any.
    brought_about: FxHashMap<u32, Vec<u32>>,
}

/// Most moves that are looked at to find a shorter cycle than the first.
const EFFORT: usize = 20_000_000;
const UNSEEN: u32 = u32::MAX;

impl HotGraph {
    /// Of the states in which somebody must not stay for ever.
    pub(super) fn of_hot<M: Model>(model: &mut M, store: &Store) -> Self {
        Self::of(model, store, |model, state, hot| model.hot(state, hot))
    }

    /// Of the states in which the program does not rest; whoever keeps it from resting counts as hot.
    pub(super) fn of_busy<M: Model>(model: &mut M, store: &Store) -> Self {
        Self::of(model, store, M::busy)
    }

    fn of<M: Model>(model: &mut M, store: &Store, is_hot: impl Fn(&mut M, &[u32], &mut Vec<u32>)) -> Self {
        let mut graph = Self {
            states: Vec::new(),
            hot: Rows::default(),
            moves: Rows::default(),
            due: Rows::default(),
            brought_about: FxHashMap::default(),
        };
        let mut place = vec![UNSEEN; store.len()];
        let mut hot = Vec::new();
        for (number, place) in (0_u32..).zip(&mut place) {
            hot.clear();
            is_hot(model, store.state(number), &mut hot);
            if !hot.is_empty() {
                hot.sort_unstable();
                *place = graph.states.len() as u32;
                graph.states.push(number);
                graph.hot.words.append(&mut hot);
                graph.hot.close();
                model.due(store.state(number), &mut graph.due.words);
                graph.due.close();
            }
        }
        let mut moves = Moves::default();
        for number in &graph.states {
            moves.clear();
            model.expand(store.state(*number), &mut moves);
            for (label, target) in moves.iter() {
                // States beyond a bound are not in the store.
                let target = store.find(target).and_then(|number| place.get(number as usize)).copied();
                let Some(place) = target.filter(|place| *place != UNSEEN) else { continue };
                graph.moves.words.push((label, place));
                let brings_about = model.brings_about(label);
                if !brings_about.is_empty() {
                    graph.brought_about.entry(label).or_insert_with(|| brings_about.to_vec());
                }
            }
            graph.moves.close();
        }
        graph
    }

    /// The shortest run into a cycle that an inspection is about.
    pub(super) fn violation<M: Model>(
        &self,
        model: &M,
        store: &Store,
        inspection: &Inspection,
    ) -> Option<Violation> {
        match inspection {
            Inspection::HotSystem | Inspection::Unsettled => {
                let lasso = self.lasso(store, |_| true)?;
                let mut hot: Vec<u32> =
                    lasso.states.iter().flat_map(|state| self.hot.get(*state as usize)).copied().collect();
                hot.sort_unstable();
                hot.dedup();
                let kind = match inspection {
                    Inspection::Unsettled => ViolationKind::Unsettled,
                    _ => ViolationKind::HotSystem,
                };
                Some(lasso.violation(model, store, self, kind, &hot))
            }
            Inspection::HotRun(group) => {
                let mut members: Vec<u32> = self.hot.words.clone();
                members.sort_unstable();
                members.dedup();
                members.retain(|number| group.contains(&model.bthread(*number)));
                let is_hot = |hot: &[u32]| hot.iter().any(|number| members.binary_search(number).is_ok());
                let lasso = self.lasso(store, is_hot)?;
                let mut violation = lasso.violation(model, store, self, ViolationKind::HotRun, &[]);
                violation.violators = group.iter().cloned().collect();
                Some(violation)
            }
            Inspection::HotBThread => {
                let mut bthreads = self.hot.words.clone();
                bthreads.sort_unstable();
                bthreads.dedup();
                let lassos = bthreads.iter().filter_map(|one| self.lasso(store, |hot| hot.contains(one)));
                let lasso = lassos.min_by_key(|lasso| lasso.stem + lasso.labels.len())?;
                let always = |number: &&u32| {
                    lasso.states.iter().all(|state| self.hot.get(*state as usize).contains(number))
                };
                let hot: Vec<u32> = bthreads.iter().filter(always).copied().collect();
                Some(lasso.violation(model, store, self, ViolationKind::HotBThread, &hot))
            }
            Inspection::Deadlock | Inspection::FailedAssertion | Inspection::HotTermination => None,
        }
    }

    /// The most moves in a row that begin in these states. There must be no cycle.
    pub(super) fn longest_burst(&self) -> u32 {
        let mut longest = vec![UNSEEN; self.states.len()];
        let mut path = Vec::new();
        for root in 0..self.states.len() as u32 {
            path.push(root);
            while let Some(state) = path.last().copied() {
                let targets = || self.moves.get(state as usize).iter().map(|(_, target)| *target);
                let before = path.len();
                path.extend(targets().filter(|target| get(&longest, *target as usize) == UNSEEN));
                if path.len() == before {
                    path.pop();
                    let beyond = targets().map(|target| get(&longest, target as usize)).max();
                    set(&mut longest, state as usize, 1 + beyond.unwrap_or(0));
                }
            }
        }
        longest.into_iter().max().unwrap_or(0)
    }

    /// The shortest way into and round a cycle all of whose states are hot in the sense of `is_hot`.
    fn lasso(&self, store: &Store, is_hot: impl Fn(&[u32]) -> bool) -> Option<Lasso> {
        let count = self.states.len() as u32;
        let within: Vec<bool> = (0..count).map(|state| is_hot(self.hot.get(state as usize))).collect();
        let mut component = self.components(&within);
        self.leave_out_unjust(&mut component);
        let mut best: Option<Lasso> = None;
        let mut effort = 0;
        for entry in 0..count {
            if component.get(entry as usize).is_none_or(|component| *component == UNSEEN) {
                continue;
            }
            let stem = self.states.get(entry as usize).map_or(0, |number| store.path(*number).len());
            let room =
                best.as_ref().map_or(usize::MAX, |best| (best.stem + best.labels.len()).saturating_sub(stem));
            if room < 2 || (best.is_some() && effort > EFFORT) {
                continue;
            }
            best = self.round(entry, stem, room, &component, &mut effort).or(best);
        }
        best
    }

    /// For each state the number of its strongly connected component among those `within`, if that has a cycle (Tarjan
    /// 1972, without recursion).
    fn components(&self, within: &[bool]) -> Vec<u32> {
        let count = within.len();
        let is_within = |state: u32| within.get(state as usize) == Some(&true);
        let mut component = vec![UNSEEN; count];
        let (mut index, mut low) = (vec![UNSEEN; count], vec![UNSEEN; count]);
        let mut on_stack = vec![false; count];
        let (mut stack, mut path) = (Vec::new(), Vec::new());
        let mut next = 0;
        for root in (0..count as u32).filter(|state| is_within(*state)) {
            if index.get(root as usize) != Some(&UNSEEN) {
                continue;
            }
            path.push((root, 0));
            while let Some((state, move_at)) = path.pop() {
                let at = state as usize;
                if move_at == 0 {
                    set(&mut index, at, next);
                    set(&mut low, at, next);
                    set(&mut on_stack, at, true);
                    next += 1;
                    stack.push(state);
                }
                let target = self.moves.get(state as usize).iter().skip(move_at).map(|(_, target)| *target);
                let mut descended = false;
                for (skipped, target) in target.enumerate() {
                    let to = target as usize;
                    if !is_within(target) {
                        continue;
                    }
                    if get(&index, to) == UNSEEN {
                        // Come back to this move, to take over what is found beyond it.
                        path.push((state, move_at + skipped + 1));
                        path.push((target, 0));
                        descended = true;
                        break;
                    }
                    if on_stack.get(to) == Some(&true) {
                        let lowest = get(&low, at).min(get(&index, to));
                        set(&mut low, at, lowest);
                    }
                }
                if descended {
                    continue;
                }
                if get(&low, at) == get(&index, at) {
                    let root_at = stack.iter().rposition(|other| *other == state).unwrap_or(0);
                    let members = stack.split_off(root_at);
                    let cyclic = members.len() > 1
                        || self.moves.get(state as usize).iter().any(|(_, target)| *target == state);
                    for member in members {
                        set(&mut on_stack, member as usize, false);
                        if cyclic {
                            set(&mut component, member as usize, state);
                        }
                    }
                }
                if let Some((parent, _)) = path.last() {
                    let lowest = get(&low, *parent as usize).min(get(&low, at));
                    set(&mut low, *parent as usize, lowest);
                }
            }
        }
        component
    }

    /// Leaves out the components in which something is due everywhere and never comes about: so it is along each of
    /// their cycles too. Of any other component all states and moves together make a cycle in which nothing is due for
    /// ever.
    fn leave_out_unjust(&self, component: &mut [u32]) {
        if self.due.words.is_empty() {
            return;
        }
        let mut sizes: FxHashMap<u32, usize> = FxHashMap::default();
        let mut due: FxHashMap<(u32, u32), usize> = FxHashMap::default();
        let states = || (0_u32..).zip(component.iter().copied()).filter(|(_, own)| *own != UNSEEN);
        for (state, own) in states() {
            *sizes.entry(own).or_default() += 1;
            self.due.get(state as usize).iter().for_each(|one| *due.entry((own, *one)).or_default() += 1);
        }
        due.retain(|(own, _), count| sizes.get(own) == Some(count));
        for (state, own) in states() {
            let inside =
                self.moves.get(state as usize).iter().filter(|(_, to)| get(component, *to as usize) == own);
            let brought_about = inside.filter_map(|(label, _)| self.brought_about.get(label)).flatten();
            for one in brought_about {
                due.remove(&(own, *one));
            }
        }
        let unjust: rustc_hash::FxHashSet<u32> = due.into_keys().map(|(own, _)| own).collect();
        component.iter_mut().filter(|own| unjust.contains(own)).for_each(|own| *own = UNSEEN);
    }

    /// The part of `pending` that is still due after a move of this label to `target`.
    fn still_due(&self, pending: &[u32], label: u32, target: u32) -> Vec<u32> {
        let brought_about = self.brought_about.get(&label).map_or(&[][..], Vec::as_slice);
        let there = self.due.get(target as usize);
        pending.iter().copied().filter(|one| there.contains(one) && !brought_about.contains(one)).collect()
    }

    /// The shortest way of less than `room` moves from `entry` back to it, within its component, along which all that
    /// is due at `entry` comes about, is forestalled or is at some state not due.
    fn round(
        &self,
        entry: u32,
        stem: usize,
        room: usize,
        component: &[u32],
        effort: &mut usize,
    ) -> Option<Lasso> {
        let own = get(component, entry as usize);
        let mut came_by: FxHashMap<Place, (Place, u32)> = FxHashMap::default();
        let start = (entry, self.due.get(entry as usize).to_vec());
        let mut queue = VecDeque::from([(start.clone(), 0_usize)]);
        while let Some((place, length)) = queue.pop_front() {
            if length + 1 >= room {
                return None;
            }
            let (state, pending) = &place;
            for (label, target) in self.moves.get(*state as usize) {
                *effort += 1;
                if get(component, *target as usize) != own {
                    continue;
                }
                let next = (*target, self.still_due(pending, *label, *target));
                if *target == entry && next.1.is_empty() {
                    return Some(Lasso::back(stem, &came_by, place, *label));
                }
                if next != start && !came_by.contains_key(&next) {
                    came_by.insert(next.clone(), (place.clone(), *label));
                    queue.push_back((next, length + 1));
                }
            }
        }
        None
    }
}

/// A state on the way round a cycle, and what is still due there of what was at its start.
type Place = (u32, Vec<u32>);

/// A way into a cycle and round it.
#[derive(Debug)]
struct Lasso {
    /// Moves before the cycle.
    stem: usize,
    /// The moves of the cycle, and the states that they leave.
    labels: Vec<u32>,
    states: Vec<u32>,
}

impl Lasso {
    /// The cycle that a move of this label closes from `last`, which was come to as `came_by` tells.
    fn back(stem: usize, came_by: &FxHashMap<Place, (Place, u32)>, last: Place, label: u32) -> Self {
        let mut lasso = Self { stem, labels: vec![label], states: vec![last.0] };
        let mut at = &last;
        while let Some((from, label)) = came_by.get(at) {
            lasso.labels.push(*label);
            lasso.states.push(from.0);
            at = from;
        }
        lasso.labels.reverse();
        lasso.states.reverse();
        lasso
    }

    fn violation<M: Model>(
        &self,
        model: &M,
        store: &Store,
        graph: &HotGraph,
        kind: ViolationKind,
        hot: &[u32],
    ) -> Violation {
        let entry = self.states.first().and_then(|entry| graph.states.get(*entry as usize));
        let stem = entry.map_or_else(Vec::new, |entry| store.path(*entry));
        let trace = stem.into_iter().chain(self.labels.iter().copied()).map(|label| model.event(label));
        Violation {
            kind,
            violators: names(model, hot),
            trace: trace.collect(),
            cycle_length: Some(self.labels.len()),
        }
    }
}

fn get(list: &[u32], at: usize) -> u32 {
    list.get(at).copied().unwrap_or(UNSEEN)
}

fn set<T>(list: &mut [T], at: usize, value: T) {
    if let Some(place) = list.get_mut(at) {
        *place = value;
    }
}
