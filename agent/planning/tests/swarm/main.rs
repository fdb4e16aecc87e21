//! Vehicles among one another: the safety filter alone, with the repulsion that resolves encounters, and the whole way
//! from rays to velocities in a forest.

#![expect(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

mod antipodal;
mod encounters;
mod filter;
mod forest;
mod kinematics;
