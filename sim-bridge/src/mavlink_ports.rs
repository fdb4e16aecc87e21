//! The vehicles' MAVLink links over UDP, as PX4 lays them out.
//!
//! | vehicle `i`, from 0 | listens on | sends to | for |
//! |---|---|---|---|
//! | companion link | 127.0.0.1:14580 + i | 127.0.0.1:14540 + i, until somebody speaks | agents, MAVSDK, MAVROS |
//! | ground link | 127.0.0.1:18570 + i | 127.0.0.1:14550, all vehicles | QGroundControl, pymavlink |
//!
//! Whoever speaks to a port is answered there too, until silent for ten seconds.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use anyhow::Context as _;

/// Of vehicle 0's companion link, the port that it listens on and the one that it sends to.
pub const COMPANION: (u16, u16) = (14580, 14540);
/// The same of its ground link; all vehicles send to one port.
pub const GROUND: (u16, u16) = (18570, 14550);
/// Silence after which nothing is sent to a client any more.
const SILENT_AFTER: Duration = Duration::from_secs(10);
/// Largest datagram taken in; MAVLink's frames are at most 280 bytes.
const DATAGRAM: usize = 2048;
/// Most datagrams taken in on one port in one step: a flood delays nobody's control loop.
const MOST_PER_STEP: usize = 64;
/// Most clients of one port; a further one takes the place of whoever has been silent the longest.
const MOST_CLIENTS: usize = 16;

/// The ports of all vehicles of a world.
pub struct MavlinkPorts {
    /// None for vehicles that have ports of their own.
    vehicles: Vec<Option<[Port; 2]>>,
    offset: u16,
}

impl MavlinkPorts {
    /// Opens two ports for each vehicle that is `served`, all `offset` further up than by convention.
    ///
    /// # Errors
    /// The port that is taken.
    pub fn open(served: impl IntoIterator<Item = bool>, offset: u16) -> anyhow::Result<Self> {
        let open = |(vehicle, is_served): (usize, bool)| {
            if !is_served {
                return Ok(None);
            }
            let index = u16::try_from(vehicle)? + offset;
            let companion = Port::open(COMPANION.0 + index, COMPANION.1 + index, false)?;
            Ok(Some([companion, Port::open(GROUND.0 + index, GROUND.1 + offset, true)?]))
        };
        let vehicles = served.into_iter().enumerate().map(open).collect::<anyhow::Result<_>>()?;
        Ok(Self { vehicles, offset })
    }

    /// Hands on whatever has come, each for the autopilot of a vehicle.
    pub fn receive(&mut self, mut take_in: impl FnMut(usize, &[u8])) {
        for (index, ports) in self.vehicles.iter_mut().enumerate() {
            for port in ports.iter_mut().flatten() {
                port.receive(|bytes| take_in(index, bytes));
            }
        }
    }

    /// Sends what the autopilot of vehicle `index` says.
    pub fn send(&mut self, index: usize, bytes: &[u8]) {
        for port in self.vehicles.get_mut(index).into_iter().flatten().flatten() {
            port.send(bytes);
        }
    }

    /// The port at which ground stations listen for all vehicles.
    pub fn audience(&self) -> Option<SocketAddr> {
        self.vehicles.iter().flatten().next().map(|[_, ground]| ground.audience)
    }

    /// The ports of the companion link of each vehicle, its own where it has one: that it listens on, and that it
    /// sends to until somebody speaks.
    pub fn companion_ports(&self) -> impl Iterator<Item = (u16, u16)> + '_ {
        let (listens_on, sends_to) = (COMPANION.0 + self.offset, COMPANION.1 + self.offset);
        (0..).take(self.vehicles.len()).map(move |index| (listens_on + index, sends_to + index))
    }
}

/// One UDP port, with whoever talks to it.
struct Port {
    socket: UdpSocket,
    /// The address that is spoken to unasked.
    audience: SocketAddr,
    /// It is spoken to even while others speak.
    always: bool,
    clients: Vec<(SocketAddr, Instant)>,
}

impl Port {
    fn open(listens_on: u16, sends_to: u16, always: bool) -> anyhow::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, listens_on)).with_context(|| {
            format!(
                "UDP port {listens_on}: is taken; is another simulator running? --port-offset chooses others"
            )
        })?;
        socket.set_nonblocking(true)?;
        let audience = SocketAddr::from((Ipv4Addr::LOCALHOST, sends_to));
        Ok(Self { socket, audience, always, clients: Vec::new() })
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
        if self.clients.len() == MOST_CLIENTS {
            self.clients.remove(0);
        }
        self.clients.push((from, Instant::now()));
    }

    fn send(&self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let spoken = self.clients.iter().any(|(client, _)| *client == self.audience);
        let unasked = (self.always && !spoken) || self.clients.is_empty();
        let audience = unasked.then_some(&self.audience);
        for client in audience.into_iter().chain(self.clients.iter().map(|(client, _)| client)) {
            // Nobody listening is no error: the vehicle flies on, and its failsafes with it.
            let _ = self.socket.send_to(bytes, client);
        }
    }
}
