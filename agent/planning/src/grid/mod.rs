//! Grids to search: cells that are free or blocked, and what the steps between neighbours cost.
//!
//! The searches in [`crate::global`] know a grid by its [`Lattice`] alone. [`Grid`] is the plain one, of benchmarks and
//! experiments; the vehicle's own map is another.

mod bricks;
mod detours;
mod lattice;
mod moves;
mod occupancy;

pub use lattice::{Grid, Lattice, ReversibleLattice, StepCosts};
pub use moves::{MOVES, Move, moved, octile};
pub use occupancy::{OccupancyGrid, SizeError};

pub(crate) use bricks::Bricks;
pub(crate) use moves::{CENTRE, Packed, SQRT_3, moves_to, unswept};
