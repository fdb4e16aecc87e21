//! The search through a model's states, and through its cycles.

use crate::verify::cycle::HotGraph;
use crate::verify::exploration::{Exploration, Limits, Outcome};
use crate::verify::frontier::Search;
use crate::verify::goals::out_of_reach;
use crate::verify::model::Model;
use crate::verify::report::{Fault, Inspection, Progress, Report, Violation};
use crate::verify::store::Store;
use crate::verify::two_threads;

/// States that are looked at before a second thread is worth its while.
const ALONE: usize = 1 << 12;

/// Looks at every state that `model` can reach, and at its cycles, until one is at fault or a bound is reached.
pub fn check<M: Model>(
    model: &mut M,
    limits: &Limits,
    inspections: &[Inspection],
    progress: &mut dyn FnMut(&Progress),
) -> Report {
    let mut seen = Exploration::new(model, limits);
    let fault = seen.run(model, inspections, progress);
    report(seen, model, fault, inspections)
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
    report(seen, model, fault, inspections)
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

fn report<M: Model>(
    mut seen: Exploration,
    model: &mut M,
    fault: Option<(u32, Fault)>,
    inspections: &[Inspection],
) -> Report {
    let verdict = match fault {
        Some((number, Fault { kind, violators })) => {
            let trace = seen.store.path(number).into_iter().map(|label| model.event(label)).collect();
            Some(Violation { kind, violators, trace, cycle_length: None })
        }
        None => hot_cycle(model, &seen.store, inspections),
    };
    let mut longest_burst = None;
    let verdict = verdict.or_else(|| {
        if !inspections.contains(&Inspection::Unsettled) {
            return None;
        }
        let busy = HotGraph::of_busy(model, &seen.store);
        let endless = busy.violation(model, &seen.store, &Inspection::Unsettled);
        if endless.is_none() {
            longest_burst = Some(busy.longest_burst());
        }
        endless
    });
    let verdict = verdict.or_else(|| out_of_reach(model, &seen.store, seen.unexplored()));
    let not_covered = seen.take_not_covered();
    Report {
        verdict,
        states: seen.store.len(),
        edges: seen.edges,
        depth: seen.depth,
        longest_burst,
        not_covered,
    }
}
