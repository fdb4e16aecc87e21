//! The catalogue of events that vehicles and ground stations agree on, a file for each subject.
//!
//! An event's home is its first two name chunks: `uav/3/takeoff` is decided on `uav/3`, whoever asks for it. Each
//! event is declared once, with its fields; from there come its constructor, its reader, its sets and its line in
//! `docs/events.md`. Lengths are in metres, positions ENU.
//!
//! ```
//! use skein_wire::event::{Arrived, Declared as _, Events as _, Goto};
//!
//! let goto = Goto { leg: 0, lands: false, x: 4.0, y: 0.0, z: 2.0 }.at("uav/3");
//! assert_eq!(goto.to_string(), "uav/3/goto{lands: false, leg: 0, x: 4.0, y: 0.0, z: 2.0}");
//! assert_eq!(Goto::read(&goto).map(|goto| goto.z), Some(2.0));
//! assert!(<(Goto, Arrived)>::any_at("uav/3").and(Goto::leg(0)).contains(&goto));
//! ```

mod airspace;
mod catalogue;
mod limit;
mod mission;
mod motion;
mod order;
mod script;
mod sense;
mod station;
mod swarm;

use std::sync::Arc;

pub use skein_bp::catalogue::{Declaration, Declared, Events, Field, Kind, Whose};
use skein_bp::{Event, EventSet};

pub use self::catalogue::{Catalogue, Subject, any_of};
pub use self::{
    airspace::*, limit::*, mission::*, motion::*, order::*, script::*, sense::*, station::*, swarm::*,
};

/// A text in an event's data. Cloning is cheap.
pub type Text = Arc<str>;

/// The events of one or several declared types at `node`, whatever their data: `of::<(Failed, Landed)>(vehicle)`.
pub fn of<E: Events>(node: impl std::fmt::Display) -> EventSet {
    E::any_at(node)
}

/// The events of one or several declared types at all vehicles, whatever their data.
pub fn of_every_vehicle<E: Events>() -> EventSet {
    E::any_of("uav/*")
}

/// The reason that an event gives, whichever it is: the field `why` means the same in all.
pub fn why(event: &Event) -> Option<&str> {
    event.text("why")
}
