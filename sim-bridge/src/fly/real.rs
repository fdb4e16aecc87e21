//! The clock on the wall: the same swarm, step by step in real time, its events over Zenoh, its vehicles' MAVLink
//! over UDP, and the console beside it.
//!
//! All vehicles share one session and the ground station has its own, joined over TCP on loopback, so that what passes
//! between vehicles and ground passes through the network stack.

use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use anyhow::Context as _;
use skein_ground::console::Console;
use skein_wire::{Fleet, Key, Link};
use skein_world::STEP;
use skein_zenoh::{Mode, NetworkSettings, ZenohConfig, ZenohSession};

use super::{Agents, Flight, Happenings, Host, Links, Recording, Swarm, setup::FLEET};
use crate::{
    autopilots::make::Make,
    cli, configure,
    mavlink_ports::MavlinkPorts,
    node_names::{GROUND, vehicle_name},
    scenario::Scenario,
    scene_view,
    summary::{Summary, Traffic},
    table::LiveTable,
};

/// The port at which other nodes can join.
const ZENOH_PORT: u16 = 7447;
/// Time to see the end of the mission in the console.
const LAST_LOOK: Duration = Duration::from_secs(1);
/// Patience with the two sessions until they find each other.
const TIME_TO_CONNECT: Duration = Duration::from_secs(10);

/// Flies in real time, `--speed` times as fast.
pub fn fly(
    scenario: &Scenario,
    args: &cli::Fly,
    recording: Recording,
    mut table: LiveTable<std::io::Stderr>,
    out: &Path,
) -> anyhow::Result<Summary> {
    let fleet = Fleet::new(FLEET)?;
    let open = |network| ZenohSession::open(ZenohConfig::new(fleet.clone(), network));
    let known = format!("tcp/127.0.0.1:{}", ZENOH_PORT + args.port_offset);
    // Relays, so that who joins at the one address that is told reaches the ground station too.
    let relay = NetworkSettings { mode: Mode::Router, ..NetworkSettings::default() };
    let vehicles = open(NetworkSettings { listen: vec![known], ..relay.clone() })
        // Beside another swarm, anywhere.
        .or_else(|_| open(relay))
        .context("Zenoh session of the vehicles")?;
    let at_relay = NetworkSettings::connected_to(vehicles.locators().to_vec());
    let ground = open(NetworkSettings { mode: Mode::Client, ..at_relay })
        .context("Zenoh session of the ground station")?;
    await_connection(&ground)?;
    let vehicle_links = (0..scenario.vehicles.len())
        .map(|index| Ok(Box::new(vehicles.link(&vehicle_name(index))?) as Box<dyn Link>))
        .collect::<anyhow::Result<_>>()?;
    let heard = Key::subscriptions_with_boards(&fleet, &GROUND);
    let links = Links { vehicles: vehicle_links, ground: Box::new(ground.listen(heard)?) };

    let address = args.console.unwrap_or_else(|| configure::console(args.port_offset));
    let mut console = serve_console(address)?;
    console.note_recording(&out.join("mission.mcap"));
    table.note(&format!("console: {}", console.url()))?;
    table.note(&format!("other nodes: Zenoh on {}", vehicles.locators().join(", ")))?;
    // PX4 has ports of its own, the same ones.
    let served = scenario.vehicles.iter().map(|plan| plan.make() != Make::Px4);
    let ports = MavlinkPorts::open(served, args.port_offset);
    match &ports {
        Ok(ports) => {
            if let Some(audience) = ports.audience() {
                table.note(&format!("MAVLink: from all vehicles to udp {audience}, for QGroundControl"))?;
            }
        }
        // Two swarms on one computer fly all the same.
        Err(error) => table.note(&format!("no MAVLink for other programs: {error:#}"))?,
    }
    let table = (!args.headless).then_some(table);
    let mut agents = Agents::of(scenario, args.controller);
    let epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    agents.configs.iter_mut().for_each(|config| config.epoch = epoch);
    let mut flight = Flight::new(scenario, agents, links, Some(recording), table)?;
    flight.seat(&args.autopilots, out)?;
    flight.fly(&mut RealTime {
        began: Instant::now(),
        speed: args.speed,
        sessions: [vehicles, ground],
        console,
        scene_due: Some(Duration::ZERO),
        ports: ports.ok(),
    })
}

/// At the address asked for, or at any that is free.
fn serve_console(address: SocketAddr) -> anyhow::Result<Console> {
    let console = Console::serve(address, None, || {});
    Ok(console.or_else(|error| match error {
        skein_ground::console::ConsoleError::Listen { .. } => {
            Console::serve((address.ip(), 0).into(), None, || {})
        }
        error => Err(error),
    })?)
}

/// Keeps pace with the clock, and lets others look on and have a say.
struct RealTime {
    began: Instant,
    speed: f64,
    sessions: [ZenohSession; 2],
    console: Console,
    /// When the scene is shown; once if nothing of it moves.
    scene_due: Option<Duration>,
    ports: Option<MavlinkPorts>,
}

impl Host for RealTime {
    fn before_step(&mut self, swarm: &mut Swarm) {
        let due = self.began + (swarm.now() + STEP).div_f64(self.speed);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        if let Some(ports) = &mut self.ports {
            ports.receive(|index, bytes| swarm.send_mavlink(index, bytes));
        }
        for wish in self.console.take_orders() {
            wish.carry_out(swarm.ground_mut());
        }
        swarm.ground_mut().attend(self.console.present());
    }

    fn after_step(&mut self, swarm: &Swarm, happenings: &Happenings) {
        if let Some(ports) = &mut self.ports {
            for (index, bytes) in happenings.mavlink.iter().enumerate() {
                ports.send(index, bytes);
            }
        }
        if self.scene_due.is_some_and(|due| swarm.now() >= due) {
            let scene = swarm.simulation().scene();
            self.console.show_scene(swarm.ground(), Some(&scene_view::view(scene)));
            self.scene_due = scene.moving().next().map(|_| swarm.now() + scene_view::MOVING_PERIOD);
        }
        if happenings.ticked {
            self.console.publish(swarm.now(), swarm.ground(), &happenings.selections);
        }
    }

    fn after_all(&mut self, swarm: &mut Swarm) {
        let until = Instant::now() + LAST_LOOK;
        while Instant::now() < until {
            self.before_step(swarm);
            let happenings = swarm.step();
            self.after_step(swarm, &happenings);
        }
    }

    fn traffic(&self) -> Traffic {
        let stats = self.sessions.each_ref().map(ZenohSession::stats);
        Traffic {
            messages: stats.iter().map(|stats| stats.messages).sum(),
            bytes: stats.iter().map(|stats| stats.bytes).sum(),
        }
    }
}

fn await_connection(session: &ZenohSession) -> anyhow::Result<()> {
    let deadline = Instant::now() + TIME_TO_CONNECT;
    while session.connected_peers() == 0 {
        anyhow::ensure!(Instant::now() < deadline, "the Zenoh sessions did not connect over loopback");
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
