//! Plans for the live fleet (P3): who flies to which target, by what way, so that all arrive together.
//!
//! [`plan`] is a function of a [`FleetProblem`]: the air and what stands in it, where vehicles are and what is left in
//! their batteries, and the targets. It deals the targets out, lets two planners of the same cost compete for each
//! route, a particle swarm with tabu search and A*, and says which vehicles would come too near to one another. Its
//! effort is counted in evaluations, so it takes about as long for all worlds.

mod dealing;
mod fleet_plan;
mod planner;
mod problem;
mod stand_ins;
mod theatre;

pub use fleet_plan::{Alternative, Encounter, FleetPlan, Journey, Method};
pub use planner::plan;
pub use problem::{FleetProblem, Flyer, LeftOut, MOST_TARGETS, Other, PlanError};
pub(crate) use stand_ins::{CalledOff, Orphaned, StandIns};
pub use theatre::{Theatre, UnfitTheatre};
