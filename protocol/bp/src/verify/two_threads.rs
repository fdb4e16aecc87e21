//! A breadth-first search by two threads: one works out moves, the other looks up where they lead.
//!
//! Both work through the states in the order of their numbers, so the outcome is that of one thread.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::exploration::{Exploration, Outcome};
use super::model::{Model, Moves};
use super::report::{Fault, Inspection, Progress};
use super::rows::Rows;

/// States that are handed over at once.
const BATCH: usize = 256;
/// Batches that are under way.
const UNDER_WAY: usize = 8;

/// The moves out of the states of one batch.
#[derive(Default)]
struct Expanded {
    moves: Moves,
    /// The number of moves of each state; states after one at fault are left out.
    counts: Vec<usize>,
    /// The fault of the last state.
    fault: Option<Fault>,
}

/// Goes on with a search until a state is at fault, and gives it.
pub(super) fn run<M: Model + Send>(
    search: &mut Exploration,
    model: &mut M,
    inspections: &[Inspection],
    progress: &mut dyn FnMut(&Progress),
) -> Option<(u32, Fault)> {
    std::thread::scope(|scope| {
        let (to_expand, batches) = sync_channel(UNDER_WAY);
        let (to_look_up, expanded) = sync_channel(UNDER_WAY);
        scope.spawn(move || expand(model, inspections, &batches, &to_look_up));
        look_up(search, &to_expand, &expanded, progress)
    })
}

fn expand<M: Model>(
    model: &mut M,
    inspections: &[Inspection],
    batches: &Receiver<Rows>,
    results: &SyncSender<Expanded>,
) {
    while let Ok(states) = batches.recv() {
        let mut expanded = Expanded::default();
        for state in (0..states.len()).map(|at| states.get(at)) {
            let before = expanded.moves.len();
            model.expand(state, &mut expanded.moves);
            let count = expanded.moves.len() - before;
            expanded.counts.push(count);
            expanded.fault = model.fault(state, count == 0, inspections);
            if expanded.fault.is_some() {
                break;
            }
        }
        if results.send(expanded).is_err() {
            return;
        }
    }
}

fn look_up(
    search: &mut Exploration,
    batches: &SyncSender<Rows>,
    results: &Receiver<Expanded>,
    progress: &mut dyn FnMut(&Progress),
) -> Option<(u32, Fault)> {
    let mut handed_over = search.explored();
    let mut under_way = 0;
    loop {
        // What is handed over when depends on what was looked up, never on how fast the other thread is.
        while under_way < UNDER_WAY && handed_over < search.store.len() {
            let mut states = Rows::default();
            for number in (handed_over..search.store.len()).take(BATCH) {
                states.words.extend_from_slice(search.store.state(number as u32));
                states.close();
            }
            handed_over += states.len();
            under_way += 1;
            if batches.send(states).is_err() {
                return None;
            }
        }
        if under_way == 0 {
            return None;
        }
        let Ok(Expanded { moves, counts, mut fault }) = results.recv() else { return None };
        under_way -= 1;
        let (mut moves, states) = (moves.hashed(), counts.len());
        for (at, count) in counts.into_iter().enumerate() {
            let (number, depth) = search.frontier.next(search.store.len())?;
            let fault = if at + 1 == states { fault.take() } else { None };
            if let Outcome::Ends(fault) =
                search.take_in(number, depth, moves.by_ref().take(count), fault, progress)
            {
                return fault;
            }
        }
    }
}
