//! The bytes between the agent and its autopilot, or a station that shares its line: UDP, TCP or a serial line.
//! Nothing here ever waits.

use std::fmt;
use std::io::{self, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpStream, UdpSocket};
use std::str::FromStr;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use serde::{Deserialize, Serialize};
use serialport::SerialPort;

/// A link that is broken, or cannot be opened yet, is tried again this often.
const OPEN_AGAIN: Duration = Duration::from_secs(1);
/// Time limit for opening a TCP link; until it is open no vehicle is flown over it.
const CONNECT: Duration = Duration::from_millis(500);
/// Whoever spoke first on a listening port is answered until it has been silent for this long.
const FAITHFUL_FOR: Duration = Duration::from_secs(2);
/// Larger than any MAVLink datagram, and than what a serial line brings between two looks.
const BUFFER: usize = 8192;
/// Most datagrams taken in at one look: more than the system keeps waiting.
const MOST_AT_ONCE: usize = 4096;

/// Where the autopilot is, as the configuration says it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Address {
    /// Listens here and answers whoever speaks.
    UdpIn(SocketAddr),
    /// Speaks to this address first.
    UdpOut(SocketAddr),
    Tcp(SocketAddr),
    Serial {
        device: String,
        baud: u32,
    },
}

impl FromStr for Address {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let expected = "expected `udp:127.0.0.1:14540`, `udpout:ADDRESS:PORT`, `tcp:ADDRESS:PORT` or `serial:DEVICE:BAUD`";
        let (kind, rest) = text.split_once(':').with_context(|| format!("{text:?}: {expected}"))?;
        let address = || rest.parse().with_context(|| format!("{text:?}: {expected}"));
        Ok(match kind {
            "udp" => Self::UdpIn(address()?),
            "udpout" => Self::UdpOut(address()?),
            "tcp" => Self::Tcp(address()?),
            "serial" => {
                let (device, baud) =
                    rest.rsplit_once(':').with_context(|| format!("{text:?}: {expected}"))?;
                let baud = baud.parse().with_context(|| format!("{text:?}: {expected}"))?;
                Self::Serial { device: device.to_owned(), baud }
            }
            _ => bail!("{text:?}: {expected}"),
        })
    }
}

impl TryFrom<String> for Address {
    type Error = anyhow::Error;

    fn try_from(text: String) -> anyhow::Result<Self> {
        text.parse()
    }
}

impl From<Address> for String {
    fn from(address: Address) -> Self {
        address.to_string()
    }
}

impl Address {
    /// Whether each piece that comes is some whole frames.
    pub fn brings_whole_frames(&self) -> bool {
        matches!(self, Self::UdpIn(_) | Self::UdpOut(_))
    }

    /// Refuses what other computers could speak to, unless the cable is private.
    pub fn check(&self, cable_is_private: bool) -> anyhow::Result<()> {
        let ip: IpAddr = match self {
            Self::UdpIn(address) | Self::UdpOut(address) | Self::Tcp(address) => address.ip(),
            Self::Serial { .. } => return Ok(()),
        };
        ensure!(
            cable_is_private || ip.is_loopback(),
            "`{self}` is not on the loopback interface, and MAVLink believes anybody: use this computer's 127.0.0.1, or set `cable_is_private = true` if nobody else is on that cable"
        );
        Ok(())
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UdpIn(address) => write!(f, "udp:{address}"),
            Self::UdpOut(address) => write!(f, "udpout:{address}"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Serial { device, baud } => write!(f, "serial:{device}:{baud}"),
        }
    }
}

/// The link, opened again whenever it breaks.
pub struct AutopilotLink {
    address: Address,
    open: Option<Open>,
    tried: Option<Instant>,
    /// Whether the user knows of the present trouble.
    complained: bool,
}

enum Open {
    Udp {
        socket: UdpSocket,
        peer: Option<SocketAddr>,
        heard: Instant,
        listens: bool,
    },
    Stream {
        stream: Box<dyn Stream>,
        /// The end of a frame that did not fit: the next one follows it.
        unsent: Vec<u8>,
    },
}

/// A TCP connection or a serial line that does not wait.
trait Stream: Read + Write + Send {}

impl Stream for TcpStream {}

/// A serial line reports silence as a time-out.
struct SerialLine(Box<dyn SerialPort>);

impl Read for SerialLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.0.bytes_to_read().map_err(io::Error::from)? == 0 {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        self.0.read(buffer)
    }
}

impl Write for SerialLine {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Stream for SerialLine {}

impl AutopilotLink {
    /// A link that is opened at the first look.
    pub fn new(address: Address) -> Self {
        Self { address, open: None, tried: None, complained: false }
    }

    /// Hands on everything that has come.
    pub fn receive(&mut self, mut take_in: impl FnMut(&[u8])) {
        self.look_after();
        let mut buffer = [0; BUFFER];
        let outcome = match &mut self.open {
            None => return,
            Some(Open::Udp { socket, peer, heard, listens }) => {
                let listens = *listens;
                receive_datagrams(socket, &mut buffer, |from, bytes| {
                    let faithless = peer.is_none() || heard.elapsed() > FAITHFUL_FOR;
                    if listens && faithless {
                        *peer = Some(from);
                    }
                    if *peer == Some(from) {
                        *heard = Instant::now();
                        take_in(bytes);
                    }
                })
            }
            Some(Open::Stream { stream, .. }) => receive_stream(stream.as_mut(), &mut buffer, take_in),
        };
        if let Err(error) = outcome {
            self.broken(&error.into());
        }
    }

    /// Sends whole MAVLink frames. What cannot be sent now is old by the next time, and is dropped.
    pub fn send(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let outcome = match &mut self.open {
            Some(Open::Udp { socket, peer: Some(peer), .. }) => socket.send_to(bytes, *peer).map(drop),
            Some(Open::Stream { stream, unsent }) => send_stream(stream.as_mut(), unsent, bytes),
            _ => return,
        };
        match outcome {
            Err(error) if !passes(&error) => self.broken(&error.into()),
            _ => {}
        }
    }

    fn look_after(&mut self) {
        if self.open.is_some() || self.tried.is_some_and(|at| at.elapsed() < OPEN_AGAIN) {
            return;
        }
        self.tried = Some(Instant::now());
        match open(&self.address) {
            Ok(open) => {
                tracing::info!("MAVLink on {}", self.address);
                self.open = Some(open);
                self.complained = false;
            }
            Err(error) => self.broken(&error),
        }
    }

    fn broken(&mut self, error: &anyhow::Error) {
        self.open = None;
        if !std::mem::replace(&mut self.complained, true) {
            tracing::error!("MAVLink on {}: {error:#}; it is tried again every second", self.address);
        }
    }
}

/// Nothing there now, or nobody who listens now: both may be otherwise the next time.
fn passes(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock
            | io::ErrorKind::TimedOut
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::Interrupted
    )
}

fn open(address: &Address) -> anyhow::Result<Open> {
    let udp = |local: SocketAddr, peer| -> anyhow::Result<Open> {
        let socket = UdpSocket::bind(local).with_context(|| {
            format!("UDP port {} cannot be had; does another agent hold this autopilot?", local.port())
        })?;
        socket.set_nonblocking(true)?;
        Ok(Open::Udp { socket, peer, heard: Instant::now(), listens: peer.is_none() })
    };
    match address {
        Address::UdpIn(local) => udp(*local, None),
        Address::UdpOut(peer) => {
            let any: IpAddr = if peer.is_ipv4() { [0, 0, 0, 0].into() } else { [0_u16; 8].into() };
            let local: IpAddr = if peer.ip().is_loopback() { peer.ip() } else { any };
            udp((local, 0).into(), Some(*peer))
        }
        Address::Tcp(peer) => {
            let stream = TcpStream::connect_timeout(peer, CONNECT)?;
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            Ok(Open::Stream { stream: Box::new(stream), unsent: Vec::new() })
        }
        Address::Serial { device, baud } => {
            let port = serialport::new(device.as_str(), *baud).timeout(Duration::from_millis(1)).open()?;
            Ok(Open::Stream { stream: Box::new(SerialLine(port)), unsent: Vec::new() })
        }
    }
}

fn receive_datagrams(
    socket: &UdpSocket,
    buffer: &mut [u8],
    mut take_in: impl FnMut(SocketAddr, &[u8]),
) -> io::Result<()> {
    for _ in 0..MOST_AT_ONCE {
        match socket.recv_from(buffer) {
            Ok((length, from)) => take_in(from, &buffer[..length]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
            Err(error) if passes(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Sends as much as fits. What follows a frame that was cut is its end; frames that find no room are dropped whole.
fn send_stream(stream: &mut dyn Stream, unsent: &mut Vec<u8>, bytes: &[u8]) -> io::Result<()> {
    let mut untouched = unsent.is_empty();
    if untouched {
        unsent.extend_from_slice(bytes);
    }
    while !unsent.is_empty() {
        match stream.write(unsent) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(length) => {
                unsent.drain(..length);
                untouched = false;
            }
            Err(error) if passes(&error) => {
                // Nothing of it has left: it is old by the next time.
                if untouched {
                    unsent.clear();
                }
                return Ok(());
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn receive_stream(
    stream: &mut dyn Stream,
    buffer: &mut [u8],
    mut take_in: impl FnMut(&[u8]),
) -> io::Result<()> {
    for _ in 0..MOST_AT_ONCE {
        match stream.read(buffer) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(length) => take_in(&buffer[..length]),
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                break;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks at the link until so many datagrams or pieces have come.
    fn hear(link: &mut AutopilotLink, pieces: usize) -> Vec<Vec<u8>> {
        let deadline = Instant::now() + Duration::from_secs(10);
        let mut heard = Vec::new();
        while heard.len() < pieces {
            assert!(Instant::now() < deadline, "only {heard:?} has come");
            link.receive(|bytes| heard.push(bytes.to_vec()));
        }
        heard
    }

    fn local(port: u16) -> SocketAddr {
        ([127, 0, 0, 1], port).into()
    }

    #[test]
    fn addresses_are_read_and_written() {
        for text in
            ["udp:127.0.0.1:14540", "udpout:[::1]:14580", "tcp:127.0.0.1:5760", "serial:/dev/ttyAMA0:921600"]
        {
            let address: Address = text.parse().unwrap();
            assert_eq!(address.to_string(), text);
            address.check(false).unwrap();
        }
        for text in
            ["", "udp", "udp:14540", "carrier-pigeon:127.0.0.1:1", "serial:/dev/ttyAMA0", "tcp:127.0.0.1:x"]
        {
            let error = text.parse::<Address>().unwrap_err().to_string();
            assert!(error.contains("udp:127.0.0.1:14540"), "{error}");
        }
    }

    #[test]
    fn other_computers_are_refused_unless_the_cable_is_private() {
        let address: Address = "udp:192.168.1.2:14540".parse().unwrap();
        assert!(address.check(false).unwrap_err().to_string().contains("cable_is_private"));
        address.check(true).unwrap();
    }

    #[test]
    fn who_speaks_first_is_answered_and_nobody_else_is_heard() {
        let (autopilot, stranger) = (UdpSocket::bind(local(0)).unwrap(), UdpSocket::bind(local(0)).unwrap());
        let port = UdpSocket::bind(local(0)).unwrap().local_addr().unwrap();
        let mut link = AutopilotLink::new(Address::UdpIn(port));
        link.receive(|_| panic!("nobody has spoken"));
        link.send(b"to nobody");
        autopilot.send_to(b"one", port).unwrap();
        assert_eq!(hear(&mut link, 1), [b"one"]);
        stranger.send_to(b"two", port).unwrap();
        autopilot.send_to(b"three", port).unwrap();
        assert_eq!(hear(&mut link, 1), [b"three"]);
        link.send(b"answer");
        let mut buffer = [0; 16];
        let (length, _) = autopilot.recv_from(&mut buffer).unwrap();
        assert_eq!(&buffer[..length], b"answer");
    }

    #[test]
    fn a_link_that_breaks_is_opened_again() {
        let listener = std::net::TcpListener::bind(local(0)).unwrap();
        let address = Address::Tcp(listener.local_addr().unwrap());
        let mut link = AutopilotLink::new(address);
        link.receive(|_| {});
        drop(listener.accept().unwrap());
        listener.set_nonblocking(true).unwrap();
        let deadline = Instant::now() + Duration::from_secs(10);
        let (mut again, _) = loop {
            assert!(Instant::now() < deadline, "it is not opened again");
            link.receive(|_| panic!("nothing was said"));
            if let Ok(accepted) = listener.accept() {
                break accepted;
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        again.write_all(b"hello").unwrap();
        assert_eq!(hear(&mut link, 1), [b"hello"]);
    }
}
