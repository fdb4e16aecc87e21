//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::unwrap_used, clippy::panic)] // A test fails by panicking.

mod boards;
mod catalogue;
mod determinism;
mod failing_disk;
mod g1_order;
mod g2_cause;
mod g3_confirmed_block;
mod g4_once;
mod g5_hold;
mod g5_loss;
mod g6_safe_alone;
mod g7_authority;
mod g8_joint;
mod guide;
mod network_faults;
mod payloads;
mod shares;
mod stalls_told;
mod swarm;
