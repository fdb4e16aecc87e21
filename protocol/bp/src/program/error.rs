//! Reasons why a program cannot go on.

use std::sync::Arc;

use crate::event::Event;
use crate::selection::Selection;

/// The reason why a program cannot go on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProgramError {
    /// A superstep did not come to rest.
    #[error("the superstep did not settle within {limit} selections; look at the b-threads that kept requesting: {}", .bthreads.join(", "))]
    Unsettled {
        /// The limit, from [`ProgramConfig::settle_limit`](crate::ProgramConfig::settle_limit).
        limit: u32,
        /// The b-threads that requested the events of the superstep's second half.
        bthreads: Vec<Arc<str>>,
        selections: Vec<Selection>,
    },
    /// A b-thread's assertion failed; the program selects nothing more.
    #[error("b-thread `{bthread}` failed: {message}")]
    Failed { bthread: Arc<str>, message: String },
    /// [`Program::choose`](crate::Program::choose) was asked for an event that may not be selected.
    #[error("`{event}` is not selectable now; selectable are {selectable:?}")]
    NotSelectable { event: Event, selectable: Vec<Event> },
}
