//! Vehicles among one another: the safety filter alone, with the repulsion that resolves encounters, and the whole way
//! from rays to velocities in a forest.

mod antipodal;
mod encounters;
mod filter;
mod forest;
mod kinematics;
