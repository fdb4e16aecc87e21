//! Campaigns: many runs with faults, each judged by what is promised.

mod hostile;
mod narrow_graphs;
mod narrow_places;
mod network;
pub mod processes;
mod separation;

use crate::task::Entry;

pub const TASKS: &[Entry] = &[
    Entry::of::<network::Network>(),
    Entry::of::<separation::Separation>(),
    Entry::of::<hostile::Hostile>(),
    Entry::of::<narrow_graphs::NarrowGraphs>(),
    Entry::of::<narrow_places::NarrowPlaces>(),
    Entry::of::<processes::Campaign>(),
];
