//! Whether Skein keeps its promises (G1 to G9) on a network that loses, repeats, reorders, delays and cuts, between
//! nodes that pause, crash, start again and come late.
//!
//! A [`Story`] is all that one seed stands for: programs, network and faults, as data. [`run`] plays it in lockstep
//! over the in-memory network, with the messages really encoded, while observers who see every node and the true time
//! check each promise at each step. A story that fails is [shrunk](shrink) to one that a person can read.
//!
//! ```
//! let outcome = skein_promises::run(&skein_promises::Story::invent(1), &Default::default());
//! assert_eq!(outcome.violation, None);
//! assert!(outcome.occurrences >= 500 && outcome.simulated.as_secs() >= 60);
//! ```

mod campaign;
mod clock;
mod invent;
mod knowledge;
mod oracle;
pub mod programs;
mod promise;
mod run;
mod seconds;
mod shrink;
mod story;
mod tap;

pub use campaign::{Campaign, Failure, Report, campaign};
pub use promise::{Promise, Violation};
pub use run::{Outcome, Settings, run};
pub use shrink::{Shrunk, shrink};
pub use story::{Cast, Fault, Faults, Grants, Order, Ordered, Story, Weather};

#[cfg(feature = "mutants")]
pub use skein_dbp::Mutant;
