//! Vehicles in forests and mazes, each with its own plan and a radio of 3 m: all arrive, and no two come near one
//! another.

mod arrivals;
mod places;
mod radio;
