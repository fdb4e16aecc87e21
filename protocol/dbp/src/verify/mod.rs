//! The verifier for a small network: every run of up to three nodes, with what may go wrong between them.
//!
//! It explores [`Node`](crate::Node)s themselves. A move lets one message arrive, or one lease lapse, or the deadline
//! of a b-thread pass, or a node restart, and then the node goes on until it has settled, in every way in which its
//! ties may fall. Messages take any time; records of bids are lost and, if so set, overtaken; so many messages as are
//! set arrive again; occurrences come in order, since holes are repaired. While a partition lasts nothing arrives
//! across it, and leases lapse. Time has no length: a lease lapses at a move, at its holder before its home, as the
//! protocol sees to it (G3). An open deadline may pass at any move, before or after any other, however long it is: that
//! is more than can happen. Of the deadlines that one b-thread has open at once, the shortest is the one that passes.
//!
//! Cycles along which somebody is hot are looked for by the rules of one program's verifier, but only those that a
//! network and a clock that work can go round for ever: what is on its way all along arrives, a partition ends, a
//! deadline that is open all along passes, and the guard after a restart ends. Leases need not lapse, and ties may fall
//! the same way for ever.
//!
//! ```
//! use skein_dbp::verify::{Faults, programs};
//! let naive = programs::naive_resource(2)?.verifier(Faults { lapses: 0, ..Faults::default() }).run();
//! assert!(naive.verdict.is_some(), "both enter before they hear of each other");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod choices;
mod model;
mod network;
pub mod programs;
pub(crate) mod row;
mod step;
#[cfg(test)]
mod tests;
mod wire;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use skein_bp::Program;
use skein_bp::verify::{Inspection, Limits, Omission, Progress, Report, check};

use crate::config::NodeConfig;
use crate::verify::model::NetworkModel;
use crate::verify::step::Step;

/// One node of a network under verification.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its settings. The roster is that of the network.
    pub config: NodeConfig,
    /// Its program at the start of each of its lives.
    pub program: Program,
    /// Whether it may restart, as often as the [`Faults`] say.
    pub may_restart: bool,
}

/// The faults that there may be, and how many of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Faults {
    /// Whether an older record of bids, or an older acknowledgement, may still arrive once a newer one was sent.
    pub delay: bool,
    /// The number of leases that may lapse.
    pub lapses: u32,
    /// The number of restarts, of members that may.
    pub restarts: u32,
    /// The number of messages that arrive once more than they should; then also older ones may arrive after newer ones.
    pub repeats: u32,
    /// The number of times that two nodes are cut off from one another, until the cut is healed. What lapses meanwhile
    /// does not count as a lapse.
    pub partitions: u32,
    /// Whether what a node tells itself of the fleet, its facts, takes time to arrive at others, like all that occurs.
    /// It is of interest only where a b-thread waits for another node's facts.
    pub late_facts: bool,
    /// The most occurrences on their way from one node to another.
    pub most_under_way: usize,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            delay: true,
            lapses: 1,
            restarts: 0,
            repeats: 0,
            partitions: 0,
            late_facts: false,
            most_under_way: 16,
        }
    }
}

/// The moves of a verification, counted by kind.
pub type MoveCounts = BTreeMap<&'static str, u64>;

/// The programs of all nodes in one state, as an invariant sees them.
#[derive(Clone, Debug)]
pub struct NetworkView<'a> {
    programs: BTreeMap<&'a str, &'a Program>,
}

impl<'a> NetworkView<'a> {
    fn new(programs: BTreeMap<&'a str, &'a Program>) -> Self {
        Self { programs }
    }

    pub fn program(&self, node: &str) -> Option<&'a Program> {
        self.programs.get(node).copied()
    }

    /// Nodes and their programs, by name.
    pub fn programs(&self) -> impl Iterator<Item = (&'a str, &'a Program)> {
        self.programs.iter().map(|(name, program)| (*name, *program))
    }
}

/// Something that must hold in every state of the network.
#[derive(Clone)]
struct Invariant {
    name: String,
    holds: Arc<InvariantFn>,
}

type InvariantFn = dyn Fn(&NetworkView<'_>) -> Result<(), String> + Send + Sync;
/// The inspections unless told otherwise.
const USUAL: [Inspection; 3] =
    [Inspection::FailedAssertion, Inspection::HotTermination, Inspection::HotBThread];

type OnProgress = Box<dyn FnMut(&Progress)>;

/// A verification of one network, to be set up and run.
pub struct NetworkVerifier {
    members: Vec<Member>,
    faults: Faults,
    limits: Limits,
    inspections: Vec<Inspection>,
    invariants: Vec<Invariant>,
    on_progress: OnProgress,
}

impl NetworkVerifier {
    /// Of these nodes, which know each other at the start. Each state takes some kilobytes, so the search ends after
    /// 200 000 unless told otherwise.
    pub fn new(members: Vec<Member>, faults: Faults) -> Self {
        let limits = Limits { most_states: 200_000, ..Limits::default() };
        let inspections = USUAL.to_vec();
        Self { members, faults, limits, inspections, invariants: Vec::new(), on_progress: Box::new(|_| {}) }
    }

    /// Looks for these instead of failed assertions, networks at rest where somebody is hot, and b-threads that are hot
    /// for ever. Deadlocks are not looked for, and a node that does not settle counts as a failed assertion. B-threads
    /// are named `node#bthread`.
    #[must_use]
    pub fn inspect(mut self, inspections: impl IntoIterator<Item = Inspection>) -> Self {
        self.inspections = inspections.into_iter().collect();
        self
    }

    /// Looks besides for a state in which `holds` gives an error, which says what is wrong with it.
    #[must_use]
    pub fn invariant(
        mut self,
        name: impl Into<String>,
        holds: impl Fn(&NetworkView<'_>) -> Result<(), String> + Send + Sync + 'static,
    ) -> Self {
        self.invariants.push(Invariant { name: name.into(), holds: Arc::new(holds) });
        self
    }

    /// Gives up after so many states.
    #[must_use]
    pub fn most_states(mut self, states: usize) -> Self {
        self.limits.most_states = states;
        self
    }

    /// Calls `on_progress` every few ten thousand states.
    #[must_use]
    pub fn on_progress(mut self, on_progress: impl FnMut(&Progress) + 'static) -> Self {
        self.on_progress = Box::new(on_progress);
        self
    }

    /// Looks at every state, until a b-thread fails, an invariant is broken, a node cannot go on, or a bound is
    /// reached; then at the cycles.
    pub fn run(self) -> Report {
        self.run_and_count().0
    }

    /// The same, and tells how many moves of each kind were made.
    pub fn run_and_count(mut self) -> (Report, MoveCounts) {
        let mut model = NetworkModel::new(self.members, self.faults, self.invariants);
        let mut report = check(&mut model, &self.limits, &self.inspections, &mut self.on_progress);
        let Faults { delay, lapses, restarts, repeats, partitions, late_facts, most_under_way } = self.faults;
        let mut left_out = vec![format!(
            "more than {lapses} lapses, {restarts} restarts, {repeats} repetitions and {partitions} partitions"
        )];
        left_out.push("several messages that a node takes in before it goes on".to_owned());
        if !delay {
            left_out.push("bids and acknowledgements that arrive after a newer one was sent".to_owned());
        }
        if !late_facts {
            left_out.push("facts of one node that take time to arrive at another".to_owned());
        }
        if model.moves.contains_key(Step::DEADLINE) {
            left_out.push(
                "of the deadlines that a b-thread has open at once, others than the shortest".to_owned(),
            );
        }
        if model.queue_cut {
            left_out.push(format!("more than {most_under_way} occurrences on their way between two nodes"));
        }
        if model.ways_cut {
            left_out.push("some of the ways in which one node's ties may fall".to_owned());
        }
        report.not_covered.extend(left_out.into_iter().map(|what| Omission::NotModelled { what }));
        (report, model.moves)
    }
}

impl fmt::Debug for NetworkVerifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { members, faults, limits, inspections, invariants, .. } = self;
        f.debug_struct("NetworkVerifier")
            .field("members", members)
            .field("faults", faults)
            .field("limits", limits)
            .field("inspections", inspections)
            .field("invariants", invariants)
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for Invariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Invariant").field(&self.name).finish()
    }
}
