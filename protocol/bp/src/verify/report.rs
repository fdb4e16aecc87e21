//! The findings of a verification, and its omissions.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use crate::event::Event;

/// A question of a verification. The names and meanings are those of BPjs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Inspection {
    /// Something is requested, and the b-threads among themselves allow nothing; see
    /// [`Program::is_deadlocked`](crate::Program::is_deadlocked).
    Deadlock,
    /// A b-thread's assertion has failed.
    FailedAssertion,
    /// The program rests where a b-thread is hot.
    HotTermination,
    /// A cycle in which one b-thread is hot at every synchronisation point.
    HotBThread,
    /// A cycle in which, at every synchronisation point, at least one b-thread of this group is hot.
    HotRun(BTreeSet<Arc<str>>),
    /// A cycle in which at every synchronisation point some b-thread is hot.
    HotSystem,
    /// The program can go round on its own requests and never come to rest, so that it would hear nothing any more.
    /// Meant for programs in which external events and deadlines wait for rest.
    Unsettled,
}

impl Inspection {
    /// The inspections unless told otherwise, as in BPjs.
    pub const USUAL: [Self; 4] =
        [Self::Deadlock, Self::FailedAssertion, Self::HotTermination, Self::HotBThread];
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ViolationKind {
    Deadlock,
    FailedAssertion {
        /// The words of the b-thread.
        message: String,
    },
    HotTermination,
    HotBThread,
    HotRun,
    HotSystem,
    Unsettled,
    /// From a state on, whatever happens, a goal is out of reach.
    OutOfReach {
        goal: String,
    },
    /// A state breaks an invariant.
    Invariant {
        invariant: String,
        /// The reason that the invariant gives.
        message: String,
    },
}

/// A fault of one state, and the b-threads to blame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    pub kind: ViolationKind,
    /// The b-threads that are stuck, failed or hot, in the order of the program.
    pub violators: Vec<Arc<str>>,
}

/// A violation and a run that shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    pub kind: ViolationKind,
    /// The b-threads that are stuck, failed or hot.
    pub violators: Vec<Arc<str>>,
    /// The run, from the start. It is as short as any that a breadth-first search could find.
    pub trace: Vec<Event>,
    /// The number of events at the end of the trace that make up the cycle, if it is one that is wrong. They could go
    /// on for ever.
    pub cycle_length: Option<usize>,
}

/// Part of the behaviour that a verification has not looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Omission {
    /// The search ended at a violation.
    StoppedAtViolation {
        /// States that were reached and not gone on from.
        unexplored: usize,
    },
    /// The search ended because it was given no more states.
    StateBound {
        most_states: usize,
        /// States that were reached and not gone on from.
        unexplored: usize,
    },
    /// Longer runs were not looked at.
    DepthBound { deepest: u32, moves: u64 },
    /// A model leaves out some behaviour of what it stands for.
    NotModelled { what: String },
}

/// The outcome of a verification. Shown as text it says what was found, how much was looked at, and what was not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The first violation found, if any.
    pub verdict: Option<Violation>,
    /// Distinct states reached.
    pub states: usize,
    /// Distinct moves between them: one for each state and event.
    pub edges: u64,
    /// Length of the longest way from the start that the search has gone.
    pub depth: u32,
    /// The most events that the program can select between two rests, if [`Inspection::Unsettled`] was asked for and it
    /// always comes to rest.
    pub longest_burst: Option<u32>,
    /// The parts that were not looked at.
    pub not_covered: Vec<Omission>,
}

/// The progress of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Distinct states reached.
    pub states: usize,
    pub edges: u64,
    /// States that are reached and not yet gone on from.
    pub unexplored: usize,
    /// Length of the way to the state that is looked at.
    pub depth: u32,
}

impl Report {
    /// Whether every run was looked at.
    pub fn is_complete(&self) -> bool {
        self.not_covered.is_empty()
    }
}

impl Violation {
    /// The events before the cycle; all of them when there is none.
    pub fn stem(&self) -> &[Event] {
        let end = self.trace.len().saturating_sub(self.cycle_length.unwrap_or(0));
        self.trace.get(..end).unwrap_or_default()
    }

    pub fn cycle(&self) -> Option<&[Event]> {
        self.trace.get(self.trace.len().checked_sub(self.cycle_length?)?..)
    }
}

impl fmt::Display for ViolationKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Deadlock => f.write_str("deadlock"),
            Self::FailedAssertion { message } => write!(f, "failed assertion: {message}"),
            Self::HotTermination => f.write_str("hot termination"),
            Self::HotBThread => f.write_str("cycle with a b-thread that is always hot"),
            Self::HotRun => f.write_str("cycle with a group in which someone is always hot"),
            Self::HotSystem => f.write_str("cycle in which someone is always hot"),
            Self::Unsettled => f.write_str("it goes round without coming to rest"),
            Self::OutOfReach { goal } => write!(f, "from here on `{goal}` is out of reach"),
            Self::Invariant { invariant, message } => write!(f, "`{invariant}` does not hold: {message}"),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.kind)?;
        if !self.violators.is_empty() {
            write!(f, " ({})", self.violators.join(", "))?;
        }
        for (at, event) in self.stem().iter().enumerate() {
            write!(f, "\n  {:>3} {event}", at + 1)?;
        }
        let Some(cycle) = self.cycle() else { return Ok(()) };
        f.write_str("\n  then again and again")?;
        for event in cycle {
            write!(f, "\n      {event}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StoppedAtViolation { unexplored } => {
                write!(f, "the search ended at the violation, with {unexplored} states not gone on from")
            }
            Self::StateBound { most_states, unexplored } => write!(
                f,
                "the search ended at the bound of {most_states} states, with {unexplored} of them not gone on from"
            ),
            Self::DepthBound { deepest, moves } => {
                write!(f, "runs of more than {deepest} events: {moves} moves lead there")
            }
            Self::NotModelled { what } => f.write_str(what),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.verdict {
            Some(violation) => writeln!(f, "{violation}")?,
            None => writeln!(f, "no violation")?,
        }
        write!(f, "{} states, {} edges, depth {}", self.states, self.edges, self.depth)?;
        if self.is_complete() {
            return f.write_str("; every run was covered");
        }
        self.not_covered.iter().try_for_each(|omission| write!(f, "\nnot covered: {omission}"))
    }
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { states, edges, unexplored, depth } = self;
        write!(f, "{states} states, {edges} edges, {unexplored} states to go on from, depth {depth}")
    }
}
