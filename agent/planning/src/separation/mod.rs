//! Keeping the distance: a repulsion that resolves encounters, and a filter that makes them safe.

mod filter;
mod halfspace;
mod neighbour;
mod repulsion;

pub use filter::{Cause, FilterConfig, Filtered, Motion, Outcome, distance_kept_m, filter};
pub use neighbour::Neighbour;
pub use repulsion::{RepulsionConfig, repulsion};
