//! `serve`: the world and its autopilots alone, for MAVLink clients in other processes.
//!
//! Vehicle `i`, counted from 0, follows PX4's convention: it listens on UDP 127.0.0.1:14580+i, sends to 127.0.0.1:14540+i
//! until somebody speaks to it, and from then on to everyone who has spoken in the last few seconds.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde_json::json;
use skein_world::{STEP, Simulation};

use crate::cli;
use crate::fly::simulation_config;
use crate::scenario::Scenario;

/// Port on which vehicle 0 listens.
const LISTEN_PORT: u16 = 14580;
/// Port to which vehicle 0 sends while nobody has spoken to it.
const SEND_PORT: u16 = 14540;
/// Who has been silent for longer is no longer sent to.
const SILENT_AFTER: Duration = Duration::from_secs(10);
/// Largest datagram taken in; MAVLink's frames are at most 280 bytes.
const DATAGRAM: usize = 2048;
/// Most datagrams taken in for one vehicle in one step: a flood delays nobody's control loop.
const MOST_PER_STEP: usize = 64;

/// Hosts the world until the process is ended.
///
/// # Errors
/// What is wrong with the scenario; a port that is taken.
pub fn run(args: &cli::Serve, as_json: bool) -> anyhow::Result<()> {
    let scenario = Scenario::open(&args.world.scenario, &args.world.overrides(), args.world.seed)?;
    let mut simulation = Simulation::new(simulation_config(&scenario));
    let mut ports =
        (0..scenario.vehicles.len()).map(MavlinkPort::open).collect::<anyhow::Result<Vec<_>>>()?;
    announce(&ports, as_json);
    let began = Instant::now();
    loop {
        let due = began + (simulation.now() + STEP).div_f64(args.speed);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        for (index, port) in ports.iter_mut().enumerate() {
            port.receive(|bytes| simulation.send(index, bytes));
        }
        simulation.step();
        for (index, port) in ports.iter_mut().enumerate() {
            port.send(&simulation.receive(index));
        }
    }
}

fn announce(ports: &[MavlinkPort], as_json: bool) {
    let addresses: Vec<String> =
        ports.iter().map(|port| format!("udp:127.0.0.1:{}", port.listens_on)).collect();
    if as_json {
        println!("{}", json!({ "mavlink": addresses }));
    } else {
        for (number, (address, port)) in (1..).zip(addresses.iter().zip(ports)) {
            println!(
                "uav/{number}: MAVLink on {address}, to 127.0.0.1:{} until somebody speaks",
                port.sends_to.port()
            );
        }
    }
}

/// One autopilot's UDP port, with whoever talks to it.
struct MavlinkPort {
    socket: UdpSocket,
    listens_on: u16,
    sends_to: SocketAddr,
    clients: Vec<(SocketAddr, Instant)>,
}

impl MavlinkPort {
    fn open(vehicle: usize) -> anyhow::Result<Self> {
        let offset = u16::try_from(vehicle)?;
        let listens_on = LISTEN_PORT + offset;
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, listens_on))
            .with_context(|| format!("UDP port {listens_on}: is taken; is another simulator running?"))?;
        socket.set_nonblocking(true)?;
        let sends_to = SocketAddr::from((Ipv4Addr::LOCALHOST, SEND_PORT + offset));
        Ok(Self { socket, listens_on, sends_to, clients: Vec::new() })
    }

    /// Hands on every datagram that has come, and remembers who sent it.
    fn receive(&mut self, mut take_in: impl FnMut(&[u8])) {
        let mut datagram = [0; DATAGRAM];
        for _ in 0..MOST_PER_STEP {
            match self.socket.recv_from(&mut datagram) {
                Ok((length, from)) => {
                    self.remember(from);
                    take_in(&datagram[..length]);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // A client that is gone shows as a refused connection here; the next datagram may be another's.
                Err(_) => {}
            }
        }
    }

    fn remember(&mut self, from: SocketAddr) {
        self.clients.retain(|(client, heard)| *client != from && heard.elapsed() < SILENT_AFTER);
        self.clients.push((from, Instant::now()));
    }

    fn send(&self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        // Nobody listening is no error: the vehicle flies on, and its failsafes with it.
        if self.clients.is_empty() {
            let _ = self.socket.send_to(bytes, self.sends_to);
        }
        for (client, _) in &self.clients {
            let _ = self.socket.send_to(bytes, client);
        }
    }
}
