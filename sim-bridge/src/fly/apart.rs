//! `--processes`: the world here, every other node in a process of its own.

use std::path::Path;
use std::time::{Duration, Instant};

use super::{TIME_TO_LAND, interruptions, report};
use crate::cli;
use crate::processes::{Processes, Programs, Setup};
use crate::scenario::Scenario;
use crate::summary::Summary;
use crate::table::{LiveTable, Progress, Row};
use crate::world_host::WorldHost;

/// What the nodes say and how they are is looked at this often.
const LOOK: Duration = Duration::from_millis(100);

/// Flies a scenario with a process for each node. Their configurations, logs and the recording go to `out`.
pub fn fly(
    scenario: &Scenario,
    args: &cli::Fly,
    out: &Path,
    mut table: LiveTable<std::io::Stderr>,
) -> anyhow::Result<Summary> {
    let setup = Setup { network: args.network, port_offset: args.port_offset, launch_on_order: false };
    let programs = Programs { agent: args.agent.clone(), ground: args.ground.clone() };
    let mut swarm = Processes::prepare(scenario, out, setup)?.running(programs);
    swarm.start_all()?;
    table.note(&format!("console: http://{}", swarm.console()))?;
    let mut table = (!args.headless).then_some(table);
    let began = Instant::now();
    let mut called_off: Option<(String, Duration)> = None;
    let mut look_due = Duration::ZERO;
    loop {
        swarm.step();
        let now = swarm.world().simulation().now();
        if now < look_due {
            continue;
        }
        look_due = now + LOOK;
        if let Some(table) = &mut table
            && table.is_due(began.elapsed())
        {
            table.draw(
                began.elapsed(),
                &progress(swarm.world(), began.elapsed()),
                &rows(swarm.world(), scenario),
            )?;
        }
        let is_over = match &called_off {
            None => swarm.world().is_over(),
            Some((_, at)) => swarm.world().is_grounded() || now > *at + TIME_TO_LAND,
        };
        if is_over {
            break;
        }
        if called_off.is_none() {
            let why = if interruptions() > 0 {
                Some("interrupted".to_owned())
            } else if now.as_secs_f64() > scenario.time_limit_s {
                Some("the time limit was reached".to_owned())
            } else {
                swarm.ended()
            };
            if let Some(why) = why {
                swarm.call_off();
                called_off = Some((why, now));
            }
        }
    }
    let why = called_off.map(|(why, _)| why);
    let summary = report::summary(scenario, &swarm.world().account(), began.elapsed(), why);
    swarm.end();
    Ok(summary)
}

fn progress(world: &WorldHost, wall: Duration) -> Progress {
    let account = world.account();
    let sim_time_s = world.simulation().now().as_secs_f64();
    Progress {
        sim_time_s,
        realtime_factor: sim_time_s / wall.as_secs_f64().max(1e-9),
        events: account.events.occurred,
        messages: account.network.messages,
        arrived: account
            .outcomes
            .iter()
            .filter(|outcome| **outcome == Some(skein_agent::Outcome::Complete))
            .count(),
        vehicles: account.outcomes.len(),
    }
}

fn rows(world: &WorldHost, scenario: &Scenario) -> Vec<Row> {
    let row = |index| {
        let vehicle = super::vehicle_name(index).to_string();
        match world.heard(index) {
            None => Row { vehicle, task: "not heard yet".to_owned(), ..Row::default() },
            Some(state) => Row {
                vehicle,
                mode: state.mode.clone(),
                task: state.task.clone(),
                waiting_for: state.waiting_for.clone(),
                battery: Some(state.battery),
                nearest: None,
            },
        }
    };
    (0..scenario.vehicles.len()).map(row).collect()
}
