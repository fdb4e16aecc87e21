//! The files in which a node keeps what must survive a restart, each `<folder>/<node>.<what>`.
//!
//! - [`next_incarnation`]: the number by which others tell a node's lives apart;
//! - [`PromiseStore`]: what a node has promised to others ([`skein_dbp::Kept`]);
//! - [`ListStore`]: the scripts that a vehicle was sent ([`skein_wire::KeptScript`]), the zones that a station has
//!   drawn ([`skein_wire::KeptZone`]);
//! - [`SigningTimeStore`]: the time up to which a vehicle may have signed MAVLink frames.
//!
//! [`Memory`] opens all that a life begins with. Libraries read no file: they know the seam
//! [`skein_wire::Store`]. Programs open these files and hand them over, each behind a thread of its own
//! ([`Background`]): who keeps something never waits for the disk.
//!
//! A file that is damaged is [set aside](Lost), and its node starts without it.

mod background;
mod incarnation;
mod lists;
mod lost;
mod memory;
mod node_file;
mod promises;
mod room;
mod signing_time;

pub use background::Background;
pub use incarnation::{Incarnation, IncarnationError, IncarnationStore, next_incarnation};
pub use lists::ListStore;
pub use lost::Lost;
pub use memory::{Memory, MemoryError, Number};
pub use promises::PromiseStore;
pub use room::{RESERVE, Room};
pub use signing_time::SigningTimeStore;
