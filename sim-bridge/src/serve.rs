//! `serve`: the world alone, until Ctrl-C.

use std::time::Instant;

use anyhow::Context as _;
use serde_json::json;
use skein_bp::behaviour::Behaviours;

use crate::cli;
use crate::fly::account;
use crate::fly::call_off::interruptions;
use crate::summary::Summary;
use crate::world_host::{WorldConfig, WorldHost};

/// Hosts the world until Ctrl-C, and says what came of it.
///
/// # Errors
/// A fault in the scenario or the configuration; a port that is taken.
pub fn run(args: &cli::Serve, known: &Behaviours, as_json: bool) -> anyhow::Result<Summary> {
    let scenario = args.world.open(known)?;
    let config = args.config.as_deref().map_or_else(|| Ok(WorldConfig::default()), WorldConfig::read)?;
    let mut world = WorldHost::open(&scenario, config, args.speed, args.port_offset)?;
    let began = Instant::now();
    announce(&world, scenario.vehicles.len(), as_json);
    while interruptions() == 0 {
        world.step();
    }
    let summary = account::summary(&scenario, &world.account(), began.elapsed(), None);
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).with_context(|| format!("{}: cannot be made", out.display()))?;
        let path = out.join("summary.json");
        summary.write(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    Ok(summary)
}

/// On standard error with `--json`: standard output is the summary's.
fn announce(world: &WorldHost, vehicles: usize, as_json: bool) {
    let ports: Vec<u16> = (0..vehicles).filter_map(|index| world.ports().companion_port(index)).collect();
    if as_json {
        eprintln!("{}", json!({ "zenoh": world.locators(), "mavlink_udp": ports }));
        return;
    }
    println!("The world is up. Zenoh on {}; Ctrl-C ends it.", world.locators().join(", "));
    for (number, port) in (1..).zip(&ports) {
        println!(
            "uav/{number}: MAVLink on udp 127.0.0.1:{port}, to 127.0.0.1:{} until somebody speaks",
            port - 40
        );
    }
    if let Some(audience) = world.ports().audience() {
        println!("From all vehicles to udp {audience}, for QGroundControl.");
    }
}
