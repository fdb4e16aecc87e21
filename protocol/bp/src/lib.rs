//! Behavioural programming: many small b-threads that run as one program.
//!
//! A b-thread does not call other b-threads. At each synchronisation point it states a [`Bid`]: events it requests,
//! waits for, blocks, and is interrupted by. The [`Program`] selects an [`Event`] that is requested by someone and
//! blocked by no one; those who asked for it go on to their next synchronisation point, all others stay where they are.
//! So a rule can be added to a program, or taken from it, without touching the rest (Harel, Marron, Weiss 2012; Wang
//! 2023).
//!
//! The crate has no clock, no I/O and no global state: a program is a value that can be cloned, compared, hashed and
//! replayed from its seed. [`EventSet`]s are data. A b-thread is a Rust type ([`BThread`]) or itself data
//! ([`script::Script`]). [`Program::put_proxy`] and [`Program::occurred`] let a channel join programs on several nodes.
//!
//! ```
//! use skein_bp::script::{Op, Script};
//! use skein_bp::{Bid, Program, ProgramConfig};
//! use std::time::Duration;
//!
//! let mut program = Program::new(ProgramConfig::default());
//! let twice = |event| Script::new(&[Op::repeat(2, [Op::Sync(Bid::new().request(event))])]);
//! program.add("hot tap", twice("hot")?);
//! program.add("cold tap", twice("cold")?);
//! // Added later, and neither tap knows.
//! program.add("mixer", Script::new(&[Op::forever([
//!     Op::Sync(Bid::new().wait_for("cold").block("hot")),
//!     Op::Sync(Bid::new().wait_for("hot").block("cold")),
//! ])])?);
//!
//! let selections = program.superstep(Duration::ZERO)?;
//! let names: Vec<_> = selections.iter().map(|s| s.event.name()).collect();
//! assert_eq!(names, ["cold", "hot", "cold", "hot"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod behaviour;
mod bid;
mod board;
pub mod bound;
mod bthread;
pub mod catalogue;
pub mod configuration;
mod event;
mod event_set;
mod explain;
mod index;
pub mod notation;
mod pattern;
mod program;
mod scope;
pub mod script;
mod selection;
mod tie;
mod value;
pub mod verify;

pub use bid::Bid;
pub use bound::{Bound, Exceeded};
pub use bthread::{BThread, Context, DEFAULT_BTHREAD_PRIORITY};
pub use event::Event;
pub use event_set::{EventSet, Extent};
pub use explain::Explanation;
pub use pattern::Pattern;
pub use program::{PASSED_OVER_LIMIT, Program, ProgramConfig, ProgramError, Strategy};
pub use selection::{Names, Origin, Rival, Selection};
pub use value::{Real, Value};

// `words!` writes it out where it is called.
#[doc(hidden)]
pub use serde;
