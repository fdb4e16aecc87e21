//! PX4 in the loop: instruments over TCP 4560 + i, MAVLink over UDP 14580 + i.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Ipv4Addr, TcpListener, TcpStream, UdpSocket};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use nalgebra::{UnitQuaternion, Vector3};
use skein_mav::Datum;
use skein_mav::simulator::{Instruments, Px4Link};
use skein_world::{MotorCommands, Pilot, Quadrotor, SensorReadings, VehicleModel};

use super::companions::Companions;
use super::instance::{Instance, fresh};
use super::legs::Legs;
use super::magnetism;
use crate::mavlink_ports::COMPANION;

/// The simulator's port of instance 0.
const SIMULATOR_PORT: u16 = 4560;
/// Instances from here on all speak to one port.
const MOST_INSTANCES: usize = 10;
/// Patience with a PX4 until it connects.
const TIME_TO_CONNECT: Duration = Duration::from_secs(30);
/// Before its mixer is loaded PX4 does not answer; so long is waited for it in each step.
const FIRST_ANSWER: Duration = Duration::from_millis(5);
/// Patience with an answer from then on: a PX4 that was stopped for so long may go on later.
const ANSWER: Duration = Duration::from_secs(2);

/// The companion's end of its MAVLink, and the port that it hears on.
struct Companion {
    socket: UdpSocket,
    hears_on: u16,
}

impl Companion {
    fn of(index: usize) -> anyhow::Result<Self> {
        let [hears_on, speaks_to] = [COMPANION.0, COMPANION.1].map(|base| base + index as u16);
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, speaks_to))
            .with_context(|| format!("UDP port {speaks_to}: is taken; does another companion run?"))?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, hears_on })
    }
}

/// A vehicle flown by PX4.
pub(super) struct Px4 {
    /// None of one that somebody else has started.
    _instance: Option<Instance>,
    name: String,
    stream: Option<TcpStream>,
    link: Px4Link,
    /// None where companions in other processes speak to its own ports.
    companion: Option<Companion>,
    field: Vector3<f64>,
    legs: Legs,
    now: Duration,
    commands: [f64; 4],
    has_answered: bool,
    /// It did not answer the last readings in time.
    is_late: bool,
}

impl Px4 {
    /// Starts PX4 for vehicle `index` and waits until it has connected; without a `program`, waits for one that
    /// somebody else starts.
    pub(super) fn start(
        index: usize,
        datum: Datum,
        model: &VehicleModel,
        program: Option<&Path>,
        folder: &Path,
        companions: Companions,
    ) -> anyhow::Result<Self> {
        let name = format!("PX4 of uav/{}", index + 1);
        anyhow::ensure!(
            index < MOST_INSTANCES,
            "{name}: at most {MOST_INSTANCES} PX4s are served; beyond that they share one port"
        );
        let port = |base: u16| base + index as u16;
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port(SIMULATOR_PORT))).with_context(|| {
            format!("TCP port {}: is taken; does another simulator run?", port(SIMULATOR_PORT))
        })?;
        let companion = match companions {
            Companions::Here => Some(Companion::of(index)?),
            Companions::Elsewhere => None,
        };
        let mut instance = program.map(|program| launch(index, model, program, folder)).transpose()?;
        let stream = accept(&listener, |waited| {
            if let Some(instance) = &mut instance {
                instance.check(folder)?;
            }
            anyhow::ensure!(waited < TIME_TO_CONNECT, "it has not connected within {TIME_TO_CONNECT:?}");
            Ok(())
        })
        .with_context(|| name.clone())?;
        stream.set_nodelay(true)?;
        Ok(Self {
            _instance: instance,
            name,
            stream: Some(stream),
            link: Px4Link::new(datum),
            companion,
            field: magnetism::field(&datum)?,
            legs: Legs::default(),
            now: Duration::ZERO,
            commands: [0.0; 4],
            has_answered: false,
            is_late: false,
        })
    }

    /// Reads on until the answer to the newest readings has come.
    fn await_answer(&mut self) {
        let patience = match (self.has_answered, self.is_late) {
            (true, false) => ANSWER,
            _ => FIRST_ANSWER,
        };
        let deadline = Instant::now() + patience;
        let mut buffer = [0; 4096];
        loop {
            while let Some(answer) = self.link.next_commands() {
                self.commands = answer.motors;
                self.has_answered = true;
                if answer.at >= self.now {
                    self.is_late = false;
                    return;
                }
            }
            let Some(stream) = &mut self.stream else { return };
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                if self.has_answered && !self.is_late {
                    tracing::warn!("{} does not answer any more", self.name);
                    self.is_late = true;
                }
                return;
            }
            // Never zero, which would mean for ever.
            let _ = stream.set_read_timeout(Some(left));
            match stream.read(&mut buffer) {
                Ok(0) => self.lose(),
                Ok(length) => self.link.receive(&buffer[..length]),
                Err(error) if [ErrorKind::WouldBlock, ErrorKind::TimedOut].contains(&error.kind()) => {}
                Err(_) => self.lose(),
            }
        }
    }

    /// It is gone, and its rotors stand.
    fn lose(&mut self) {
        tracing::warn!("{} has gone", self.name);
        self.stream = None;
        self.commands = [0.0; 4];
    }
}

impl Pilot for Px4 {
    fn sense(&mut self, now: Duration, readings: &SensorReadings, body: &Quadrotor) {
        self.now = now;
        let attitude = body.state().attitude;
        // The compass's error turns the field about the vertical.
        let magnetic_field = readings.magnetic_heading.map(|heading| {
            let (_, _, yaw) = attitude.euler_angles();
            let error = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw - heading);
            attitude.inverse() * (error * self.field)
        });
        self.link.sense(
            now,
            &Instruments {
                angular_rate: readings.imu.angular_rate,
                specific_force: self.legs.soften(&readings.imu.specific_force),
                magnetic_field,
                pressure_height_m: readings.baro_height_m,
                satellite: readings.gps.map(|fix| [fix.position, fix.velocity]),
            },
        );
        let output = self.link.take_output();
        if let Some(stream) = &mut self.stream
            && stream.write_all(&output).is_err()
        {
            self.lose();
        }
    }

    fn commands(&mut self) -> MotorCommands {
        self.await_answer();
        MotorCommands(self.commands)
    }

    fn receive(&mut self, bytes: &[u8]) {
        if let Some(Companion { socket, hears_on }) = self.companion.as_ref().filter(|_| !bytes.is_empty()) {
            // One that does not listen yet is spoken to again.
            let _ = socket.send_to(bytes, (Ipv4Addr::LOCALHOST, *hears_on));
        }
    }

    fn take_output(&mut self) -> Vec<u8> {
        let (mut output, mut datagram) = (Vec::new(), [0; 2048]);
        let Some(Companion { socket, .. }) = &self.companion else { return output };
        loop {
            match socket.recv(&mut datagram) {
                Ok(length) => output.extend_from_slice(&datagram[..length]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return output,
                // Nobody listened to the last datagram.
                Err(_) => {}
            }
        }
    }
}

fn launch(index: usize, model: &VehicleModel, program: &Path, folder: &Path) -> anyhow::Result<Instance> {
    let program = program.canonicalize().with_context(|| format!("--px4 {}", program.display()))?;
    let etc = program
        .ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join("etc"))
        .find(|etc| etc.join("init.d-posix/rcS").is_file())
        .with_context(|| {
            format!(
                "--px4 {}: there is no etc/init.d-posix/rcS in its folder or the one above",
                program.display()
            )
        })?;
    fresh(folder)?;
    let endurance_s = model.battery.capacity_wh / model.battery.hover_power_w * 3600.0;
    let mut command = Command::new(program);
    command
        .args(["-d", "-i"])
        .arg(index.to_string())
        .arg("-s")
        .arg(etc.join("init.d-posix/rcS"))
        .arg(&etc)
        .env("PX4_SIM_MODEL", "none_iris")
        .env_remove("PX4_SIMULATOR")
        // Its battery empties as the vehicle's does in hover. There is no remote control, and nobody reads its logs.
        .env("PX4_PARAM_SIM_BAT_DRAIN", format!("{endurance_s:.0}"))
        .env("PX4_PARAM_SIM_BAT_MIN_PCT", "0")
        .env("PX4_PARAM_COM_RC_IN_MODE", "4")
        .env("PX4_PARAM_SDLOG_BACKEND", "0");
    Instance::start(command, folder)
}

/// Waits for a connection; `go_on` says after each look whether to wait on.
fn accept(
    listener: &TcpListener,
    mut go_on: impl FnMut(Duration) -> anyhow::Result<()>,
) -> anyhow::Result<TcpStream> {
    listener.set_nonblocking(true)?;
    let began = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => go_on(began.elapsed())?,
            Err(error) => return Err(error.into()),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
