//! The published experiments, run again, each beside what it must reach.

mod ablation;
mod autopilots;
mod circle;
mod dstar_grid;
mod feasibility;
mod indoor;
mod lsc;
pub mod naive_right_of_way;
mod narrow;
mod performance;
mod potential;
mod right_of_way;
mod sphere;
pub mod swarm_planning;
mod vfh;
mod walkers;

use crate::reported::Reported;
use crate::task::Entry;

pub const TASKS: &[Entry] = &[
    Entry::of::<Reported<feasibility::Feasibility>>(),
    Entry::of::<Reported<performance::Performance>>(),
    Entry::of::<Reported<vfh::Vfh>>(),
    Entry::of::<Reported<circle::Circle>>(),
    Entry::of::<Reported<ablation::Ablation>>(),
    Entry::of::<Reported<walkers::Walkers>>(),
    Entry::of::<Reported<potential::PotentialFields>>(),
    Entry::of::<Reported<autopilots::Autopilots>>(),
    Entry::of::<Reported<right_of_way::RightOfWay>>(),
    Entry::of::<Reported<narrow::Narrow>>(),
    Entry::of::<Reported<sphere::Sphere>>(),
    Entry::of::<Reported<dstar_grid::DstarGrid>>(),
    Entry::of::<Reported<indoor::Indoor>>(),
    Entry::of::<Reported<lsc::Lsc>>(),
    Entry::of::<Reported<swarm_planning::SwarmPlanning>>(),
];
