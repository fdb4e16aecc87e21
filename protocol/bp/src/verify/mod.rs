//! The verifier: looks at every run of a program, and shows the shortest one that goes wrong.
//!
//! All runs of a program together are the paths through a graph. A state is where each b-thread is, and what waits in
//! the queues; an edge is an event that may be selected. The verifier builds the graph of all that the program can
//! reach, by the rules of [`Program`](crate::Program) and with every tie taken both ways, and looks for
//! [`Inspection`]s. An ordinary way to state a requirement is a b-thread that watches and calls
//! [`Context::fail`](crate::Context::fail).
//!
//! ```
//! use skein_bp::script::{Op, Script};
//! use skein_bp::verify::{Inspection, Verifier};
//! use skein_bp::{Bid, Program, ProgramConfig};
//!
//! let mut program = Program::new(ProgramConfig::default());
//! for (diner, first, second) in [("left", "a", "b"), ("right", "b", "a")] {
//!     let act = |what: &str, fork: &str| Op::Sync(Bid::new().request(format!("{what}/{fork}/{diner}")));
//!     let acts = [act("take", first), act("take", second), act("put", first), act("put", second)];
//!     program.add(diner, Script::new(&[Op::forever(acts)])?);
//! }
//! for fork in ["a", "b"] {
//!     let (take, put) = (format!("take/{fork}/*"), format!("put/{fork}/*"));
//!     let lies = Op::Sync(Bid::new().wait_for(take.clone()));
//!     let held = Op::Sync(Bid::new().wait_for(put).block(take));
//!     program.add(fork, Script::new(&[Op::forever([lies, held])])?);
//! }
//!
//! let report = Verifier::new(program).inspect([Inspection::Deadlock]).run();
//! let violation = report.verdict.ok_or("no deadlock found")?;
//! let names: Vec<_> = violation.trace.iter().map(|event| event.name()).collect();
//! assert_eq!(names, ["take/a/left", "take/b/right"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Time stands still at the start of the run: [`Context::now`](crate::Context::now) is zero. Whether deadlines fire is
//! a setting, [`Timers`]. What belongs to scheduling and not to the program plays no part: the seed, fairness in ties,
//! the limit on selections. Where [`ProgramConfig::externals_after`](crate::ProgramConfig::externals_after) is set, an
//! external event may come at any time.

mod bits;
mod coverage;
mod cycle;
mod exploration;
mod frontier;
mod goals;
mod graph;
mod interner;
mod locals;
mod model;
mod product;
mod report;
mod rows;
mod search;
mod store;
mod two_threads;
mod view;

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use crate::bid::Bid;
use crate::event::Event;
use crate::program::Program;
pub use coverage::{BThreadCoverage, Coverage};
pub use exploration::Limits;
pub use frontier::Search;
pub use graph::{Graph, GraphEdge, GraphState};
pub use interner::Interner;
pub use model::{Model, Moves};
use product::Product;
pub use report::{Fault, Inspection, Omission, Progress, Report, Violation, ViolationKind};
pub use search::check;
use search::check_by_two;
pub use view::View;

/// The treatment of deadlines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Timers {
    /// They never fire. A program that only waits for one has not come to rest for good, and is not deadlocked.
    #[default]
    Never,
    /// Any open one may fire at any time, also before an earlier one. In a trace this is `timeout{bthread: ".."}`.
    AnyTime,
    /// Any open one may fire whenever nothing internal can be selected: a program that runs to rest much faster than
    /// its deadlines are far.
    AtRest,
}

/// A requirement with a name, of which only that is shown.
struct Rule<F: ?Sized> {
    name: String,
    holds: Arc<F>,
}

/// Holds in every state.
type Invariant = Rule<dyn Fn(&View<'_>) -> Result<(), String> + Send + Sync>;
/// Holds of every bid, whatever the others state.
type BidRule = Rule<dyn Fn(&str, &Bid) -> Result<(), String> + Send + Sync>;
/// Must stay within reach.
type Goal = Rule<dyn Fn(&View<'_>) -> bool + Send + Sync>;
type OnProgress = Box<dyn FnMut(&Progress)>;

/// The requirements of a verification besides its [`Inspection`]s, and the b-threads that are not part of the program.
#[derive(Clone, Debug, Default)]
struct Requirements {
    world: BTreeSet<Arc<str>>,
    of_bids: Vec<BidRule>,
    invariants: Vec<Invariant>,
    goals: Vec<Goal>,
}

/// A verification of one program, to be set up and run.
pub struct Verifier {
    program: Program,
    inspections: Vec<Inspection>,
    limits: Limits,
    threads: usize,
    timers: Timers,
    feed: Vec<Event>,
    requirements: Requirements,
    on_progress: OnProgress,
}

impl Verifier {
    /// Of `program` as it stands, breadth first and without bounds, for the [usual](Inspection::USUAL) inspections.
    pub fn new(program: Program) -> Self {
        Self {
            program,
            inspections: Inspection::USUAL.to_vec(),
            limits: Limits::default(),
            threads: 2,
            timers: Timers::default(),
            feed: Vec::new(),
            requirements: Requirements::default(),
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
        self.requirements.invariants.push(Invariant { name: name.into(), holds: Arc::new(holds) });
        self
    }

    /// Looks besides for a b-thread, given by name, that states a bid for which `holds` gives an error.
    #[must_use]
    pub fn every_bid(
        mut self,
        name: impl Into<String>,
        holds: impl Fn(&str, &Bid) -> Result<(), String> + Send + Sync + 'static,
    ) -> Self {
        self.requirements.of_bids.push(BidRule { name: name.into(), holds: Arc::new(holds) });
        self
    }

    /// Looks besides for a state from which no run leads to one in which `is_met`, if no other violation is found.
    #[must_use]
    pub fn always_within_reach(
        mut self,
        goal: impl Into<String>,
        is_met: impl Fn(&View<'_>) -> bool + Send + Sync + 'static,
    ) -> Self {
        self.requirements.goals.push(Goal { name: goal.into(), holds: Arc::new(is_met) });
        self
    }

    /// The b-threads that stand for the world around the program: what they request may happen whenever an external
    /// event may, whatever its priority.
    #[must_use]
    pub fn world<N: Into<Arc<str>>>(mut self, bthreads: impl IntoIterator<Item = N>) -> Self {
        self.requirements.world.extend(bthreads.into_iter().map(Into::into));
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

    /// Sets the number of threads; 2 unless set, and more do not help. The outcome is the same.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Sets the treatment of deadlines.
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
    pub fn run(self) -> Report {
        self.run_and_cover().0
    }

    /// The same, and tells what of the program was met on the way.
    pub fn run_and_cover(mut self) -> (Report, Coverage) {
        let (mut report, mut product) = self.check(false);
        if product.order_is_lost() {
            (report, product) = self.check(true);
        }
        let waiting = product.unfired_deadlines();
        if !waiting.is_empty() {
            let what = format!("the deadlines of {}, which never fire here", waiting.join(", "));
            report.not_covered.push(Omission::NotModelled { what });
        }
        (report, product.coverage())
    }

    fn check(&mut self, in_order: bool) -> (Report, Product) {
        let mut product = self.product(in_order);
        let Self { limits, inspections, on_progress, threads, .. } = self;
        let report = match threads {
            0 | 1 => check(&mut product, limits, inspections, on_progress),
            _ => check_by_two(&mut product, limits, inspections, on_progress),
        };
        (report, product)
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
        let (feed, requirements) = (self.feed.clone(), self.requirements.clone());
        Product::new(self.program.clone(), self.timers, feed, requirements, in_order)
    }
}

impl fmt::Debug for Verifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { program, inspections, limits, threads, timers, feed, requirements, .. } = self;
        f.debug_struct("Verifier")
            .field("program", program)
            .field("inspections", inspections)
            .field("limits", limits)
            .field("threads", threads)
            .field("timers", timers)
            .field("feed", feed)
            .field("requirements", requirements)
            .finish_non_exhaustive()
    }
}

impl BidRule {
    /// The rule's name, and what is wrong with a bid.
    fn broken_by(&self, bthread: &str, bid: &Bid) -> Option<(String, String)> {
        (self.holds)(bthread, bid).err().map(|message| (self.name.clone(), message))
    }
}

impl<F: ?Sized> Clone for Rule<F> {
    fn clone(&self) -> Self {
        Self { name: self.name.clone(), holds: self.holds.clone() }
    }
}

impl<F: ?Sized> fmt::Debug for Rule<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Rule").field(&self.name).finish()
    }
}
