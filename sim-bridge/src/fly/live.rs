//! The live table of a swarm in flight.

use std::time::Duration;

use skein_agent::Outcome;

use super::account::Account;
use super::swarm::Swarm;
use crate::table::{Progress, Row};

/// The live table's rows.
pub fn rows(swarm: &Swarm) -> Vec<Row> {
    let now = swarm.now();
    let row = |agent: &skein_agent::AgentCore| {
        let status = agent.status(now);
        Row {
            vehicle: agent.name().to_string(),
            mode: status.mode,
            task: status.task,
            waiting_for: status.waiting_for,
            battery: Some(status.battery),
            nearest: status.nearest.map(|(node, distance_m)| (node.to_string(), distance_m)),
        }
    };
    swarm.agents().map(row).collect()
}

/// The live table's header.
pub fn progress(account: &Account<'_>, wall: Duration) -> Progress {
    let sim_time_s = account.simulation.now().as_secs_f64();
    let is_complete = |outcome: &&Option<Outcome>| **outcome == Some(Outcome::Complete);
    Progress {
        sim_time_s,
        realtime_factor: sim_time_s / wall.as_secs_f64().max(1e-9),
        events: account.events.occurred,
        messages: account.network.messages,
        complete: account.outcomes.iter().filter(is_complete).count(),
        vehicles: account.outcomes.len(),
    }
}
