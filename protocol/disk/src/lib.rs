//! The files in which a node keeps what must survive a restart, each `<folder>/<node>.<what>`.
//!
//! - [`next_incarnation`]: the number by which others tell a node's lives apart;
//! - [`PromiseStore`]: what a node has promised to others ([`skein_dbp::Kept`]);
//! - [`ScriptStore`]: the scripts that a vehicle was sent ([`skein_wire::KeptScript`]).
//!
//! Libraries read no file: they know the seam [`skein_wire::Store`]. Programs open these files and hand them over.

mod incarnation;
mod node_file;
mod promises;
mod scripts;

pub use incarnation::{IncarnationError, next_incarnation};
pub use promises::{PromiseStore, PromisesError};
pub use scripts::{ScriptStore, ScriptsLost};
