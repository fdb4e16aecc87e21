//! The clock on the wall: the same swarm, step by step in real time, its events over Zenoh.
//!
//! All vehicles share one session and the ground station has its own, joined over TCP on loopback, so that what passes
//! between vehicles and ground passes through the network stack.

use std::time::{Duration, Instant};

use anyhow::Context as _;
use skein_wire::{Fleet, Link};
use skein_zenoh::{ZenohConfig, ZenohSession};

use super::{
    Flight, Links, Recording,
    setup::{FLEET, GROUND, vehicle_name},
};
use crate::{
    cli,
    scenario::Scenario,
    summary::{Summary, Traffic},
    table::LiveTable,
};

/// How long the two sessions may take to find each other.
const TIME_TO_CONNECT: Duration = Duration::from_secs(10);

/// Flies in real time, `--speed` times as fast.
pub fn fly(
    scenario: &Scenario,
    args: &cli::Fly,
    recording: Recording,
    table: LiveTable<std::io::Stderr>,
) -> anyhow::Result<Summary> {
    let fleet = Fleet::new(FLEET)?;
    let vehicles = ZenohSession::open(ZenohConfig {
        listen: vec!["tcp/127.0.0.1:0".to_owned()],
        ..ZenohConfig::new(fleet.clone())
    })
    .context("Zenoh session of the vehicles")?;
    let ground =
        ZenohSession::open(ZenohConfig { connect: vehicles.locators().to_vec(), ..ZenohConfig::new(fleet) })
            .context("Zenoh session of the ground station")?;
    await_connection(&ground)?;
    let vehicle_links = (0..scenario.vehicles.len())
        .map(|index| Ok(Box::new(vehicles.link(&vehicle_name(index))?) as Box<dyn Link>))
        .collect::<anyhow::Result<_>>()?;
    let links = Links { vehicles: vehicle_links, ground: Box::new(ground.link(&GROUND)?) };

    let flight = Flight::new(scenario, args, links, recording, table)?;
    let began = Instant::now();
    let speed = args.speed;
    let keep_pace = move |now: Duration| {
        let due = began + now.div_f64(speed);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    };
    let traffic = || {
        let (vehicles, ground) = (vehicles.stats(), ground.stats());
        Traffic { messages: vehicles.messages + ground.messages, bytes: vehicles.bytes + ground.bytes }
    };
    flight.fly(keep_pace, traffic)
}

fn await_connection(session: &ZenohSession) -> anyhow::Result<()> {
    let deadline = Instant::now() + TIME_TO_CONNECT;
    while session.connected_peers() == 0 {
        anyhow::ensure!(Instant::now() < deadline, "the Zenoh sessions did not connect over loopback");
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
