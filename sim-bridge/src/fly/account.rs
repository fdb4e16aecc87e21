//! The account of a run, from which its summary is made.

use skein_agent::{Outcome, SetPointRecord};
use skein_world::Simulation;

use crate::summary::{EventCounts, Traffic};

/// What is known of a run at its end.
pub struct Account<'a> {
    /// The truth of it.
    pub simulation: &'a Simulation,
    /// How each vehicle's mission ended, by its agent's word.
    pub outcomes: Vec<Option<Outcome>>,
    /// What each agent made its set-points from, where that is known.
    pub set_points: Vec<SetPointRecord>,
    /// How long plans took, where that is known.
    pub plan_times_ms: &'a [f64],
    /// Events of all nodes.
    pub events: EventCounts,
    /// Messages of all nodes.
    pub network: Traffic,
    /// Hash of the run; empty where it cannot be had.
    pub trace_hash: String,
}
