//! `--processes`: the world here, every other node in a process of its own.

use std::path::Path;
use std::time::{Duration, Instant};

use super::call_off::{self, CalledOff, MissionClock};
use super::{account, live};
use crate::cli::{self, Setup};
use crate::node_names::vehicle_name;
use crate::processes::{Processes, Programs};
use crate::scenario::Scenario;
use crate::summary::Summary;
use crate::table::{LiveTable, Row};
use crate::world_host::WorldHost;

/// Time between two looks at the nodes.
const LOOK: Duration = Duration::from_millis(100);

/// Flies a scenario with a process for each node. Their configurations, logs and the recording go to `out`.
pub fn fly(
    scenario: &Scenario,
    args: &cli::Fly,
    out: &Path,
    mut table: LiveTable<std::io::Stderr>,
) -> anyhow::Result<Summary> {
    let setup = Setup {
        network: args.network,
        port_offset: args.port_offset,
        launch_on_order: args.launch_on_order,
        secure: args.secure,
    };
    let programs = Programs { agent: args.agent.clone(), ground: args.ground.clone() };
    let mut swarm = Processes::prepare(scenario, out, setup, &args.autopilots)?.running(programs);
    swarm.start_all()?;
    table.note(&format!("console: http://{}", swarm.console()))?;
    let mut table = (!args.headless).then_some(table);
    let began = Instant::now();
    let mut called_off: Option<CalledOff> = None;
    let mut look_due = Duration::ZERO;
    let mut clock = MissionClock::new(scenario.launch_on_order);
    loop {
        swarm.step();
        let now = swarm.world().simulation().now();
        if now < look_due {
            continue;
        }
        look_due = now + LOOK;
        let wall = began.elapsed();
        if let Some(table) = &mut table
            && table.is_due(wall)
        {
            let world = swarm.world();
            table.draw(wall, &live::progress(&world.account(), wall), &rows(world, scenario))?;
        }
        let is_over = match &called_off {
            None => swarm.world().is_over(),
            Some(called_off) => swarm.world().is_grounded() || called_off.is_out_of_time(now),
        };
        if is_over {
            break;
        }
        let flown = clock.time(now, swarm.world().is_grounded());
        if called_off.is_none() {
            let limit = call_off::reason(flown, scenario.time_limit_s).map(str::to_owned);
            if let Some(why) = limit.or_else(|| swarm.ended()) {
                swarm.call_off();
                called_off = Some(CalledOff { why, at: now });
            }
        }
    }
    let why = called_off.map(|called_off| called_off.why);
    let summary = account::summary(scenario, &swarm.world().account(), began.elapsed(), why);
    swarm.end();
    Ok(summary)
}

fn rows(world: &WorldHost, scenario: &Scenario) -> Vec<Row> {
    let row = |index| {
        let vehicle = vehicle_name(index).to_string();
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
