//! Fuzz targets: everything that reads what others wrote is given arbitrary bytes.
//!
//! A [`Target`] reads an input and asserts what must hold of any: no panic, memory (and with the program of the fuzzer,
//! time) in proportion to the input's length, and that what has been read is written and read again as the same. An
//! ordinary test replays the corpora; cargo-fuzz finds new inputs. docs/security-fuzzing.md says how.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // A target fails by panicking.

mod cameras;
mod certificates;
mod configuration;
mod event_sets;
mod kept;
mod keys;
mod mavlink;
mod measured;
mod missions;
mod node;
mod packets;
mod recordings;
mod requests;
mod scripts;
mod target;
mod worlds;

pub use target::{Allowed, Reached, Target};

/// All targets.
pub const TARGETS: &[Target] = &[
    cameras::TARGET,
    certificates::TARGET,
    configuration::TARGET,
    event_sets::TARGET,
    kept::TARGET,
    keys::TARGET,
    mavlink::TARGET,
    measured::TARGET,
    missions::TARGET,
    node::TARGET,
    packets::TARGET,
    recordings::TARGET,
    requests::TARGET,
    scripts::TARGET,
    worlds::TARGET,
];
