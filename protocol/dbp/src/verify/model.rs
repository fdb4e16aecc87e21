//! A network as a model: its states as rows of numbers, and the moves between them.

use std::rc::Rc;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use skein_bp::verify::{Fault, Inspection, Interner, Model, Moves, ViolationKind};
use skein_bp::{Event, ProgramError};

use crate::error::NodeError;
use crate::name::NodeName;
use crate::verify::choices::Choices;
use crate::verify::network::Network;
use crate::verify::row::{Family, Part, Row};
use crate::verify::step::Step;
use crate::verify::{Faults, Invariant, Member, MoveCounts, NetworkView};

/// Ways in which the b-threads of one node may go on after one message.
const MOST_WAYS: usize = 4096;

/// A state that was reached.
#[derive(Debug)]
enum Seen {
    /// It was not gone on from.
    Waiting(Box<Network>),
    /// It was. One in which somebody is hot is kept, for cycles are made of such.
    Left(Option<Box<HotState>>),
}

/// A state in which somebody is hot.
#[derive(Debug)]
struct HotState {
    /// The hot b-threads, by number.
    hot: Vec<u32>,
    /// The moves that are due, by number.
    due: Vec<u32>,
    /// Labels and targets.
    moves: Vec<(u32, Rc<[u32]>)>,
}

#[derive(Debug)]
pub(super) struct NetworkModel {
    members: Rc<[Member]>,
    faults: Faults,
    invariants: Vec<Invariant>,
    parts: Interner<Part>,
    families: Interner<Family>,
    /// The name of a move, and the due moves that it brings about.
    labels: Interner<(Event, Vec<u32>)>,
    dues: Interner<Step>,
    /// The names of b-threads that were hot, with their nodes.
    bthreads: Interner<Arc<str>>,
    seen: FxHashMap<Rc<[u32]>, Seen>,
    /// The state that is gone on from, and whether nothing is due there.
    present: Option<Network>,
    rests: bool,
    /// Whether a bound of the model, not of the search, was reached.
    pub(super) ways_cut: bool,
    pub(super) queue_cut: bool,
    /// The number of moves of each kind that were made.
    pub(super) moves: MoveCounts,
}

impl NetworkModel {
    pub(super) fn new(members: Vec<Member>, faults: Faults, invariants: Vec<Invariant>) -> Self {
        Self {
            members: members.into(),
            faults,
            invariants,
            parts: Interner::default(),
            families: Interner::default(),
            labels: Interner::default(),
            dues: Interner::default(),
            bthreads: Interner::default(),
            seen: FxHashMap::default(),
            present: None,
            rests: false,
            ways_cut: false,
            queue_cut: false,
            moves: MoveCounts::new(),
        }
    }

    pub(super) fn formed(&self) -> Network {
        Network::formed(self.members.clone(), self.faults)
    }

    pub(super) fn row(&mut self, network: &Network) -> Vec<u32> {
        let mut row = Row::new(&mut self.parts, &mut self.families);
        network.write_standing(&mut row);
        row.finish()
    }

    /// The states to which a step may lead, each with the selections on the way.
    pub(super) fn outcomes(&mut self, network: &Network, step: &Step) -> Vec<(Vec<String>, Network)> {
        let mut outcomes = Vec::new();
        let mut way = Some(Choices::default());
        while let Some(mut choices) = way {
            let mut next = network.clone();
            let selected = next.take(step, &mut choices);
            self.queue_cut |= next.overflows;
            if !next.overflows {
                outcomes.push((selected, next));
            }
            way = choices.next_way();
            if way.is_some() && outcomes.len() >= MOST_WAYS {
                self.ways_cut = true;
                return outcomes;
            }
        }
        outcomes
    }

    fn label(&mut self, step: &Step, selected: &[String], from: &Network, to: &Network) -> u32 {
        let shown = step.shown();
        let shown = if selected.is_empty() { shown } else { shown.with("then", selected.join(", ")) };
        let forestalled = from.nodes.iter().flat_map(|(name, node)| {
            let gone_on = |bthread: &&str| {
                let sync = |network: &Network| network.nodes.get(name).and_then(|node| node.sync_of(bthread));
                sync(from) != sync(to)
            };
            // Whether the deadline of a b-thread that has gone on is still the same nobody can tell.
            node.deadlines().filter(gone_on).map(|bthread| Step::Deadline(name.clone(), bthread.into()))
        });
        let dues = &mut self.dues;
        let brings_about = step.due().into_iter().chain(forestalled).map(|due| dues.number(due));
        let brings_about = sorted(brings_about.collect());
        self.labels.number((shown, brings_about))
    }

    /// The b-threads that are hot, by number.
    fn hot_bthreads(&mut self, network: &Network) -> Vec<u32> {
        sorted(network.hot_bthreads().map(|bthread| self.bthreads.number(bthread)).collect())
    }

    fn hot_state(&self, state: &[u32]) -> Option<&HotState> {
        match self.seen.get(state)? {
            Seen::Left(hot) => hot.as_deref(),
            Seen::Waiting(_) => None,
        }
    }

    fn assertion_failed(node: &NodeName, error: &NodeError) -> Fault {
        let (violator, message) = match error {
            NodeError::Program(ProgramError::Failed { bthread, message }) => {
                (format!("{node}#{bthread}"), message.clone())
            }
            error => (node.to_string(), error.to_string()),
        };
        Fault { kind: ViolationKind::FailedAssertion { message }, violators: vec![violator.into()] }
    }

    /// The b-threads that are hot where nothing is due any more.
    fn hot_at_rest(&self, network: &Network) -> Option<Fault> {
        let violators: Vec<Arc<str>> = if self.rests { network.hot_bthreads().collect() } else { Vec::new() };
        (!violators.is_empty()).then_some(Fault { kind: ViolationKind::HotTermination, violators })
    }
}

impl Model for NetworkModel {
    fn start(&mut self) -> Vec<u32> {
        let network = self.formed();
        let row = self.row(&network);
        self.seen.insert(row.as_slice().into(), Seen::Waiting(Box::new(network)));
        row
    }

    fn expand(&mut self, state: &[u32], moves: &mut Moves) {
        self.present = None;
        let Some(seen) = self.seen.get_mut(state) else { return };
        let network = match std::mem::replace(seen, Seen::Left(None)) {
            Seen::Waiting(network) => *network,
            known @ Seen::Left(_) => {
                *seen = known;
                let kept = self.hot_state(state).into_iter().flat_map(|hot| &hot.moves);
                return kept.for_each(|(label, target)| moves.push(*label, target.iter().copied()));
            }
        };
        if network.broken.is_some() {
            self.present = Some(network);
            return;
        }
        let steps = network.steps();
        let due: Vec<u32> = steps.iter().filter_map(Step::due).map(|due| self.dues.number(due)).collect();
        self.rests = due.is_empty() && network.has_begun();
        let hot = self.hot_bthreads(&network);
        let mut hot_state =
            (!hot.is_empty()).then(|| Box::new(HotState { hot, due: sorted(due), moves: Vec::new() }));
        for step in steps {
            for (selected, next) in self.outcomes(&network, &step) {
                *self.moves.entry(step.kind()).or_default() += 1;
                let row: Rc<[u32]> = self.row(&next).into();
                let label = self.label(&step, &selected, &network, &next);
                moves.push(label, row.iter().copied());
                if let Some(hot) = &mut hot_state {
                    hot.moves.push((label, row.clone()));
                }
                self.seen.entry(row).or_insert_with(|| Seen::Waiting(Box::new(next)));
            }
        }
        self.seen.insert(state.into(), Seen::Left(hot_state));
        self.present = Some(network);
    }

    fn fault(&self, _: &[u32], _: bool, inspections: &[Inspection]) -> Option<Fault> {
        let network = self.present.as_ref()?;
        if let Some((node, error)) = &network.broken {
            let wanted = inspections.contains(&Inspection::FailedAssertion);
            return wanted.then(|| Self::assertion_failed(node, error));
        }
        let programs = network.nodes.iter().map(|(name, node)| (name.as_str(), node.program())).collect();
        let view = NetworkView::new(programs);
        let broken = self.invariants.iter().find_map(|invariant| {
            let message = (invariant.holds)(&view).err()?;
            let kind = ViolationKind::Invariant { invariant: invariant.name.clone(), message };
            Some(Fault { kind, violators: Vec::new() })
        });
        let at_rest = || {
            let wanted = inspections.contains(&Inspection::HotTermination);
            wanted.then(|| self.hot_at_rest(network)).flatten()
        };
        broken.or_else(at_rest)
    }

    fn hot(&self, state: &[u32], bthreads: &mut Vec<u32>) {
        bthreads.extend(self.hot_state(state).into_iter().flat_map(|hot| &hot.hot));
    }

    fn due(&mut self, state: &[u32], due: &mut Vec<u32>) {
        due.extend(self.hot_state(state).into_iter().flat_map(|hot| &hot.due));
    }

    fn brings_about(&self, label: u32) -> &[u32] {
        self.labels.get(label).map_or(&[], |(_, brings_about)| brings_about)
    }

    fn bthread(&self, number: u32) -> Arc<str> {
        self.bthreads.get(number).cloned().unwrap_or_else(|| "".into())
    }

    fn event(&self, label: u32) -> Event {
        self.labels.get(label).map_or_else(|| Event::new(""), |(event, _)| event.clone())
    }
}

/// Numbers in order, each once.
fn sorted(mut numbers: Vec<u32>) -> Vec<u32> {
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::programs;

    /// The states that a network may come to from here. Labels show counters, so they may differ.
    fn ways(model: &mut NetworkModel, network: &Network) -> Vec<Vec<u32>> {
        let mut ways = Vec::new();
        for step in network.steps() {
            for (_, next) in model.outcomes(network, &step) {
                ways.push(model.row(&next));
            }
        }
        ways.sort();
        ways
    }

    /// What a row leaves out, such as times and how far the counters have come, must make no difference.
    #[test]
    fn networks_of_one_row_go_on_alike() {
        let faults = Faults { lapses: 1, restarts: 1, repeats: 1, partitions: 1, ..Faults::default() };
        for network in programs::sound().unwrap() {
            let network_name = network.name;
            let mut model = NetworkModel::new(network.members, faults, Vec::new());
            let start = model.formed();
            let mut seen = FxHashMap::default();
            let mut queue = std::collections::VecDeque::from([start]);
            let mut compared = 0;
            while let Some(network) = queue.pop_front() {
                let row = model.row(&network);
                let ways = ways(&mut model, &network);
                if let Some(known) = seen.get(&row) {
                    compared += 1;
                    assert_eq!(&ways, known, "{network_name}");
                    continue;
                }
                seen.insert(row, ways);
                if seen.len() + queue.len() < 600 {
                    for step in network.steps() {
                        queue.extend(model.outcomes(&network, &step).into_iter().map(|(_, next)| next));
                    }
                }
            }
            assert!(compared > 100, "only {compared} pairs in {network_name}");
        }
    }
}
