//! Campaigns: many runs with faults, each judged by what is promised.

mod hostile;
mod network;
pub mod processes;
mod separation;

use crate::task::Entry;

pub const TASKS: &[Entry] = &[
    Entry::of::<network::Network>(),
    Entry::of::<separation::Separation>(),
    Entry::of::<hostile::Hostile>(),
    Entry::of::<processes::Campaign>(),
];
