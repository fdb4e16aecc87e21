//! The live table of a swarm in flight.

use std::time::Duration;

use skein_agent::Outcome;

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
pub fn progress(swarm: &Swarm, wall: Duration, messages: u64) -> Progress {
    Progress {
        sim_time_s: swarm.now().as_secs_f64(),
        realtime_factor: swarm.now().as_secs_f64() / wall.as_secs_f64().max(1e-9),
        events: swarm.events().occurred,
        messages,
        arrived: swarm.outcomes().filter(|outcome| *outcome == Some(&Outcome::Complete)).count(),
        vehicles: swarm.agents().len(),
    }
}
