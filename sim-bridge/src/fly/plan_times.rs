//! The time that plans take: measured around the agents, which have no clock themselves.

use std::time::{Duration, Instant};

use skein_dbp::Happened;
use skein_wire::event::{Declared as _, Plan};

/// The time of each plan: the wall times of the agent's ticks that worked on it, together.
#[derive(Debug, Default)]
pub struct PlanTimes {
    /// Of each vehicle, what its plan has taken up to now.
    under_way: Vec<f64>,
    done: Vec<f64>,
}

impl PlanTimes {
    /// Takes in one tick of a vehicle's agent, from `began` to now, if it planned; `is_planning` if the plan takes
    /// another.
    pub fn take_in(&mut self, vehicle: usize, began: Instant, selections: &[Happened], is_planning: bool) {
        if self.under_way.len() <= vehicle {
            self.under_way.resize(vehicle + 1, 0.0);
        }
        let Some(under_way) = self.under_way.get_mut(vehicle) else { return };
        let planned = selections.iter().any(|happened| happened.event.name().ends_with(Plan::NAME));
        if planned || is_planning || *under_way > 0.0 {
            *under_way += milliseconds(began.elapsed());
        }
        if !is_planning && *under_way > 0.0 {
            self.done.push(std::mem::take(under_way));
        }
    }

    /// All of them that are done, in milliseconds.
    #[must_use]
    pub fn milliseconds(&self) -> &[f64] {
        &self.done
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}
