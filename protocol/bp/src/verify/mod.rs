//! The verifier: looks at every run of a program, and shows the shortest one that goes wrong.
//!
//! All runs of a program together are the paths through a graph. A state is where each b-thread is, and what waits in the
//! queues; an edge is an event that may be selected. The verifier builds the graph of all that the program can reach, by
//! the rules of [`Program`](crate::Program) and with every tie taken both ways, and looks for [`Inspection`]s. An ordinary
//! way to state a requirement is a b-thread that watches and calls [`Context::fail`](crate::Context::fail).
//!
//! ```
//! use skein_bp::script::{Op, Script};
//! use skein_bp::verify::{Inspection, Verifier};
//! use skein_bp::{Bid, Program, ProgramConfig};
//!
//! let mut program = Program::new(ProgramConfig::default());
//! let asks_for = |first: &str, then: &str| {
//!     let take = |fork: &str| Op::Sync(Bid::new().request(format!("take {fork}")));
//!     let put = |fork: &str| Op::Sync(Bid::new().request(format!("put {fork}")));
//!     Script::new(&[Op::forever([take(first), take(then), put(first), put(then)])])
//! };
//! let lies = |fork: &str| {
//!     let (take, put) = (format!("take {fork}"), format!("put {fork}"));
//!     let free = Bid::new().wait_for(take.as_str());
//!     let taken = Bid::new().wait_for(put).block(take);
//!     Script::new(&[Op::forever([Op::Sync(free), Op::Sync(taken)])])
//! };
//! program.add("left diner", asks_for("a", "b")?);
//! program.add("right diner", asks_for("b", "a")?);
//! program.add("fork a", lies("a")?);
//! program.add("fork b", lies("b")?);
//!
//! let report = Verifier::new(program).inspect([Inspection::Deadlock]).run();
//! let violation = report.verdict.ok_or("no deadlock found")?;
//! let names: Vec<_> = violation.trace.iter().map(|event| event.name()).collect();
//! assert_eq!(names, ["take a", "take b"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Time stands still at the start of the run: [`Context::now`](crate::Context::now) is zero. Whether deadlines fire is a
//! setting, [`Timers`]. What belongs to scheduling and not to the program plays no part: the seed, fairness in ties, the
//! limit on selections. Where [`ProgramConfig::externals_after`](crate::ProgramConfig::externals_after) is set, an external
//! event may come at any time.

mod cycle;
mod graph;
mod interner;
mod locals;
mod model;
mod product;
mod report;
mod search;
mod store;
mod view;

use std::fmt;
use std::sync::Arc;

use crate::event::Event;
use crate::program::Program;
pub use graph::{Graph, GraphEdge, GraphState};
pub use interner::Interner;
pub use model::{Model, Moves};
use product::Product;
pub use report::{Fault, Inspection, Omission, Progress, Report, Violation, ViolationKind};
pub use search::{Limits, Search, check};
pub use view::View;

/// What becomes of deadlines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Timers {
    /// They never fire. A program that only waits for one has not come to rest for good, and is not deadlocked.
    #[default]
    Never,
    /// Any open one may fire at any time, also before an earlier one. In a trace this is `timeout{bthread: ".."}`.
    AnyTime,
}

/// Something that must hold in every state.
#[derive(Clone)]
struct Invariant {
    name: String,
    holds: Arc<InvariantFn>,
}

type InvariantFn = dyn Fn(&View<'_>) -> Result<(), String> + Send + Sync;
type OnProgress = Box<dyn FnMut(&Progress)>;

/// A verification of one program, to be set up and run.
pub struct Verifier {
    program: Program,
    inspections: Vec<Inspection>,
    limits: Limits,
    timers: Timers,
    feed: Vec<Event>,
    invariants: Vec<Invariant>,
    on_progress: OnProgress,
}

impl Verifier {
    /// Of `program` as it stands, breadth first and without bounds, for the [usual](Inspection::USUAL) inspections.
    pub fn new(program: Program) -> Self {
        Self {
            program,
            inspections: Inspection::USUAL.to_vec(),
            limits: Limits::default(),
            timers: Timers::default(),
            feed: Vec::new(),
            invariants: Vec::new(),
            on_progress: Box::new(|_| {}),
        }
    }

    /// Looks for these instead. With none, the whole graph is counted.
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
        holds: impl Fn(&View<'_>) -> Result<(), String> + Send + Sync + 'static,
    ) -> Self {
        self.invariants.push(Invariant { name: name.into(), holds: Arc::new(holds) });
        self
    }

    /// In which order states are looked at.
    #[must_use]
    pub fn order(mut self, order: Search) -> Self {
        self.limits.order = order;
        self
    }

    /// Gives up after so many states; at least 1.
    #[must_use]
    pub fn most_states(mut self, states: usize) -> Self {
        self.limits.most_states = states;
        self
    }

    /// Looks at runs of no more than so many events.
    #[must_use]
    pub fn deepest(mut self, events: u32) -> Self {
        self.limits.deepest = events;
        self
    }

    /// What becomes of deadlines.
    #[must_use]
    pub fn timers(mut self, timers: Timers) -> Self {
        self.timers = timers;
        self
    }

    /// Gives the program these external events, one each time it rests, as long as it is a
    /// [daemon](Program::is_daemon).
    #[must_use]
    pub fn feed(mut self, events: impl IntoIterator<Item = Event>) -> Self {
        self.feed = events.into_iter().collect();
        self
    }

    /// Calls `on_progress` every few ten thousand states.
    #[must_use]
    pub fn on_progress(mut self, on_progress: impl FnMut(&Progress) + 'static) -> Self {
        self.on_progress = Box::new(on_progress);
        self
    }

    /// Looks at every state until a violation is found or a bound is reached.
    pub fn run(mut self) -> Report {
        let mut product = self.product(false);
        let mut report = check(&mut product, &self.limits, &self.inspections, &mut self.on_progress);
        if product.order_is_lost() {
            product = self.product(true);
            report = check(&mut product, &self.limits, &self.inspections, &mut self.on_progress);
        }
        let waiting = product.unfired_deadlines();
        if !waiting.is_empty() {
            let what = format!("the deadlines of {}, which never fire here", waiting.join(", "));
            report.not_covered.push(Omission::NotModelled { what });
        }
        report
    }

    /// The graph of all states within the bounds, violations or not.
    pub fn graph(mut self) -> Graph {
        let mut product = self.product(false);
        let mut graph = Graph::of(&mut product, &self.limits, &mut self.on_progress);
        if product.order_is_lost() {
            product = self.product(true);
            graph = Graph::of(&mut product, &self.limits, &mut self.on_progress);
        }
        graph
    }

    fn product(&self, in_order: bool) -> Product {
        let (feed, invariants) = (self.feed.clone(), self.invariants.clone());
        Product::new(self.program.clone(), self.timers, feed, invariants, in_order)
    }
}

impl fmt::Debug for Verifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { program, inspections, limits, timers, feed, invariants, .. } = self;
        f.debug_struct("Verifier")
            .field("program", program)
            .field("inspections", inspections)
            .field("limits", limits)
            .field("timers", timers)
            .field("feed", feed)
            .field("invariants", invariants)
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for Invariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Invariant").field(&self.name).finish()
    }
}
