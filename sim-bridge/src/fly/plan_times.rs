//! How long plans take: measured around the agents, which have no clock themselves.

use std::time::{Duration, Instant};

use skein_dbp::Happened;
use skein_wire::vocabulary::PLAN;

/// Wall times of the agent ticks in which a plan was made.
#[derive(Debug, Default)]
pub struct PlanTimes(Vec<f64>);

impl PlanTimes {
    /// Takes in one tick of an agent, from `began` to now, if it planned.
    pub fn take_in(&mut self, began: Instant, selections: &[Happened]) {
        let planned = selections.iter().any(|happened| happened.event.name().ends_with(PLAN));
        if planned {
            self.0.push(milliseconds(began.elapsed()));
        }
    }

    /// All of them, in milliseconds.
    #[must_use]
    pub fn milliseconds(&self) -> &[f64] {
        &self.0
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}
