//! `serve`: the world alone, until Ctrl-C.

use std::time::Instant;

use anyhow::Context as _;
use serde_json::json;
use skein_bp::behaviour::Behaviours;

use crate::cli;
use crate::fly::call_off::interruptions;
use crate::fly::{account, default_folder};
use crate::summary::Summary;
use crate::world_host::{WorldConfig, WorldHost};

/// Hosts the world until Ctrl-C, and says what came of it.
///
/// # Errors
/// A fault in the scenario or the configuration; a port that is taken.
pub fn run(args: &cli::Serve, known: &Behaviours, as_json: bool) -> anyhow::Result<Summary> {
    let mut scenario = args.world.open(known)?;
    args.autopilots.assign(&mut scenario);
    let folder = args.out.clone().unwrap_or_else(|| default_folder(&scenario));
    let config = args.config.as_deref().map_or_else(|| Ok(WorldConfig::default()), WorldConfig::read)?;
    let autopilots = (&args.autopilots, folder.as_path());
    let mut world = WorldHost::open(&scenario, config, args.speed, args.port_offset, autopilots)?;
    let began = Instant::now();
    announce(&world, as_json);
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
fn announce(world: &WorldHost, as_json: bool) {
    if as_json {
        let ports: Vec<u16> = world.ports().companion_ports().map(|(port, _)| port).collect();
        eprintln!("{}", json!({ "zenoh": world.locators(), "mavlink_udp": ports }));
        return;
    }
    println!("The world is up. Zenoh on {}; Ctrl-C ends it.", world.locators().join(", "));
    for (number, (port, to)) in (1..).zip(world.ports().companion_ports()) {
        println!("uav/{number}: MAVLink on udp 127.0.0.1:{port}, to 127.0.0.1:{to} until somebody speaks");
    }
    if let Some(audience) = world.ports().audience() {
        println!("From all vehicles to udp {audience}, for QGroundControl.");
    }
}
