//! Traffic: vehicles among one another where there is room for one only, as in the corridors of a maze.
//!
//! Each vehicle moves on a [`Lattice`] of places and speeds that per-axis limits of speed and acceleration allow
//! exactly. It plans for itself, in space and time ([`search`]), around what those before it in [`Standing`] have
//! announced, and tells its own [`Itinerary`] to whoever is in radio range (prioritised planning, decentralised: Cap
//! 2015, "Prioritized planning algorithms for trajectory coordination of multiple mobile robots").
//!
//! Plans may change and be wrong; *commitments* may not. A vehicle is committed to the beginning of its itinerary and
//! then to coming to rest. In its turn a [`Traveller`] extends its commitment by one step, if that is compatible with
//! the commitments of all that it hears. So no two commitments ever meet, whatever the plans are, as long as nobody
//! commits to more way than radio reaches: see [`Lattice::reach_m`].

mod encounter;
mod itinerary;
mod lattice;
mod roads;
pub mod search;
mod standing;
mod traveller;

pub use encounter::{Apart, closest};
pub use itinerary::Itinerary;
pub use lattice::{Lattice, Move, State};
pub use roads::{Distances, Roads};
pub use standing::{Rank, Standing};
pub use traveller::{Lane, Traveller, TravellerConfig, TravellerError, Turn, Word};
