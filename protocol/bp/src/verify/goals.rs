//! Goals: what must stay within reach of every state (the nonblocking property of Ramadge and Wonham 1987).

use super::model::{Model, Moves};
use super::report::{Violation, ViolationKind};
use super::store::Store;

/// The states that may have ways out that the search has not seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unexplored {
    None,
    From(u32),
    Any,
}

/// The first state from which no way leads to one that meets a goal. What was not looked at might lead anywhere.
pub(super) fn out_of_reach<M: Model>(
    model: &mut M,
    store: &Store,
    unexplored: Unexplored,
) -> Option<Violation> {
    let goals = model.goals();
    let first_unexplored = match unexplored {
        _ if goals.is_empty() => return None,
        Unexplored::Any => return None,
        Unexplored::None => store.len() as u32,
        Unexplored::From(number) => number,
    };
    let ways = Ways::into(model, store);
    goals.into_iter().enumerate().find_map(|(at, goal)| {
        let met = |number: &u32| *number >= first_unexplored || model.meets(at, store.state(*number));
        let lost = ways.first_without(store.len(), (0..store.len() as u32).filter(met))?;
        let trace = store.path(lost).into_iter().map(|label| model.event(label)).collect();
        let kind = ViolationKind::OutOfReach { goal };
        Some(Violation { kind, violators: Vec::new(), trace, cycle_length: None })
    })
}

/// For each state those that a move leads from.
struct Ways {
    /// The place in `from` at which the list of each state begins.
    starts: Vec<u32>,
    from: Vec<u32>,
}

impl Ways {
    fn into<M: Model>(model: &mut M, store: &Store) -> Self {
        let mut edges: Vec<(u32, u32)> = Vec::new();
        let mut moves = Moves::default();
        for from in 0..store.len() as u32 {
            moves.clear();
            model.expand(store.state(from), &mut moves);
            edges.extend(moves.iter().filter_map(|(_, target)| Some((store.find(target)?, from))));
        }
        edges.sort_unstable();
        let mut starts = vec![0; store.len() + 1];
        for (to, _) in &edges {
            if let Some(count) = starts.get_mut(*to as usize + 1) {
                *count += 1;
            }
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        Self { starts, from: edges.into_iter().map(|(_, from)| from).collect() }
    }

    /// The first of `count` states from which no way leads to a good one.
    fn first_without(&self, count: usize, good: impl Iterator<Item = u32>) -> Option<u32> {
        let mut reaches = vec![false; count];
        let mut queue: Vec<u32> = good.collect();
        while let Some(state) = queue.pop() {
            let Some(known) = reaches.get_mut(state as usize) else { continue };
            if std::mem::replace(known, true) {
                continue;
            }
            let bounds = self.starts.get(state as usize).zip(self.starts.get(state as usize + 1));
            let before = bounds.and_then(|(start, end)| self.from.get(*start as usize..*end as usize));
            queue.extend(before.unwrap_or_default());
        }
        reaches.iter().position(|reaches| !reaches).map(|at| at as u32)
    }
}
