//! ArduPilot in the loop: servos and motion over UDP 9002 + 10 i, MAVLink over TCP 5760 + 10 i.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::Context as _;
use skein_mav::simulator::Motion;
use skein_mav::simulator::ardupilot::{Servos, answer};
use skein_mav::{ARDUPILOT, Datum};
use skein_world::{MotorCommands, Pilot, Quadrotor, STEP, SensorReadings, VehicleModel};

use super::instance::{Instance, ending, fresh, wait_for};
use super::legs::Legs;

/// The port to which instance 0 sends its servos, and the one on which it speaks MAVLink.
const SERVO_PORT: u16 = 9002;
const MAVLINK_PORT: u16 = 5760;
/// From one instance's ports to the next one's.
const PORTS_APART: u16 = 10;
/// Answers in one step of the world: its main loop wants at least 800 a second.
const ANSWERS: u32 = 4;
/// Patience with an ArduPilot until it listens.
const TIME_TO_CONNECT: Duration = Duration::from_secs(30);
/// Patience with a packet: one that was stopped for so long may go on later.
const PACKET: Duration = Duration::from_secs(2);
/// The same, of one that did not send the last in time.
const LATE_PACKET: Duration = Duration::from_millis(5);
/// Its motors' thrust by its default throttle curve, which its mixer straightens: this share of it is quadratic
/// (MOT_THST_EXPO).
const QUADRATIC: f64 = 0.65;

/// A vehicle flown by ArduPilot.
pub(super) struct ArduPilot {
    /// None of one that somebody else has started.
    instance: Option<Instance>,
    name: String,
    servos: UdpSocket,
    mavlink: Option<TcpStream>,
    throttle: [f64; 4],
    /// Where the vehicle was one step ago, and where it is.
    motion: Option<[Motion; 2]>,
    legs: Legs,
    now: Duration,
    voltage_v: f64,
    has_sent: bool,
    /// It did not send its last packet in time.
    is_late: bool,
}

impl ArduPilot {
    /// Starts ArduCopter for vehicle `index`; without a `program`, waits for one that somebody else starts.
    pub(super) fn start(
        index: usize,
        datum: Datum,
        model: &VehicleModel,
        program: Option<&Path>,
        defaults: Option<&Path>,
        folder: &Path,
    ) -> anyhow::Result<Self> {
        let name = format!("ArduPilot of uav/{}", index + 1);
        let port = |base: u16| base + PORTS_APART * index as u16;
        let servos = UdpSocket::bind((Ipv4Addr::LOCALHOST, port(SERVO_PORT))).with_context(|| {
            format!("UDP port {}: is taken; does another simulator run?", port(SERVO_PORT))
        })?;
        let mut instance =
            program.map(|program| launch(index, &datum, model, program, defaults, folder)).transpose()?;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port(MAVLINK_PORT)));
        let mavlink = wait_for(&mut instance, TIME_TO_CONNECT, || {
            TcpStream::connect(address).with_context(|| format!("it does not listen on TCP {address}"))
        })
        .with_context(|| name.clone())?;
        if instance.is_some() {
            // It reads its parameters only now, and ends when it cannot.
            servos.set_read_timeout(Some(Duration::from_millis(5)))?;
            wait_for(&mut instance, TIME_TO_CONNECT, || {
                servos.peek(&mut [0; 1]).context("it sends no servos")
            })
            .with_context(|| name.clone())?;
        }
        mavlink.set_nodelay(true)?;
        mavlink.set_nonblocking(true)?;
        Ok(Self {
            instance,
            name,
            servos,
            mavlink: Some(mavlink),
            throttle: [0.0; 4],
            motion: None,
            legs: Legs::default(),
            now: Duration::ZERO,
            voltage_v: 0.0,
            has_sent: false,
            is_late: false,
        })
    }

    /// Takes in one packet and answers it: the vehicle is `share` of a step further than one step ago.
    fn exchange(&mut self, share: f64) -> bool {
        let patience = match (self.is_late, self.has_sent) {
            (true, _) => LATE_PACKET,
            (false, true) => PACKET,
            (false, false) => TIME_TO_CONNECT,
        };
        let _ = self.servos.set_read_timeout(Some(patience));
        let mut datagram = [0; 256];
        let packet = self.servos.recv_from(&mut datagram).ok();
        let Some((servos, from)) =
            packet.and_then(|(length, from)| Some((Servos::read(&datagram[..length])?, from)))
        else {
            if !std::mem::replace(&mut self.is_late, true) {
                tracing::warn!("{} does not answer any more", self.name);
            }
            return false;
        };
        (self.has_sent, self.is_late) = (true, false);
        self.throttle = servos.throttle;
        if let Some([before, after]) = &self.motion {
            let at = self.now + STEP.mul_f64(share);
            let text = answer(at, &between(before, after, share), self.voltage_v);
            let _ = self.servos.send_to(text.as_bytes(), from);
        }
        true
    }

    /// It is gone, and its rotors stand.
    fn lose(&mut self) {
        tracing::warn!("{} has gone{}", self.name, ending(&mut self.instance));
        self.mavlink = None;
        self.throttle = [0.0; 4];
    }
}

impl Pilot for ArduPilot {
    fn sense(&mut self, now: Duration, readings: &SensorReadings, body: &Quadrotor) {
        self.now = now;
        self.voltage_v = readings.battery.voltage_v;
        let state = body.state();
        let motion = Motion {
            // From it ArduPilot makes its satellites and its pressure.
            position: state.position + readings.fix_error,
            velocity: state.velocity,
            attitude: state.attitude,
            angular_rate: readings.imu.angular_rate,
            specific_force: self.legs.soften(&readings.imu.specific_force),
        };
        let before = self.motion.map_or(motion, |[_, last]| last);
        self.motion = Some([before, motion]);
    }

    fn commands(&mut self) -> MotorCommands {
        for number in 1..=ANSWERS {
            if self.mavlink.is_none() || !self.exchange(f64::from(number) / f64::from(ANSWERS)) {
                break;
            }
        }
        let thrust = |throttle: f64| (1.0 - QUADRATIC) * throttle + QUADRATIC * throttle * throttle;
        MotorCommands(self.throttle.map(thrust))
    }

    fn receive(&mut self, bytes: &[u8]) {
        if let Some(stream) = &mut self.mavlink
            && stream.write_all(bytes).is_err_and(|error| error.kind() != ErrorKind::WouldBlock)
        {
            self.lose();
        }
    }

    fn take_output(&mut self) -> Vec<u8> {
        let (mut output, mut buffer) = (Vec::new(), [0; 4096]);
        while let Some(stream) = &mut self.mavlink {
            match stream.read(&mut buffer) {
                Ok(0) => self.lose(),
                Ok(length) => output.extend_from_slice(&buffer[..length]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => self.lose(),
            }
        }
        output
    }
}

/// The motion at a share of the way from one to the other.
fn between(before: &Motion, after: &Motion, share: f64) -> Motion {
    Motion {
        position: before.position.lerp(&after.position, share),
        velocity: before.velocity.lerp(&after.velocity, share),
        attitude: before.attitude.try_slerp(&after.attitude, share, 1e-9).unwrap_or(after.attitude),
        angular_rate: before.angular_rate.lerp(&after.angular_rate, share),
        specific_force: after.specific_force,
    }
}

fn launch(
    index: usize,
    datum: &Datum,
    model: &VehicleModel,
    program: &Path,
    defaults: Option<&Path>,
    folder: &Path,
) -> anyhow::Result<Instance> {
    let program = program.canonicalize().with_context(|| format!("--ardupilot {}", program.display()))?;
    let defaults = match defaults {
        Some(defaults) => defaults.canonicalize().with_context(|| defaults.display().to_string())?,
        None => find_defaults(&program)?,
    };
    let folder = fresh(folder)?;
    let parameters = folder.join("skein.parm");
    std::fs::write(&parameters, parameters_of(index, model))?;
    let place = datum.place();
    let home = format!(
        "{:.7},{:.7},{:.2},0",
        place.latitude_rad.to_degrees(),
        place.longitude_rad.to_degrees(),
        place.height_m
    );
    let mut command = Command::new(program);
    command
        .args(["--model", "JSON:127.0.0.1", "--home", &home])
        .arg(format!("-I{index}"))
        .args(["--sysid", &(index + 1).to_string()])
        .arg("--defaults")
        .arg(format!("{},{}", defaults.display(), parameters.display()));
    Instance::start(command, &folder)
}

/// The parameters of its default copter, where its releases and its sources have them.
fn find_defaults(program: &Path) -> anyhow::Result<PathBuf> {
    let places = ["default_params/copter.parm", "Tools/autotest/default_params/copter.parm"];
    program
        .ancestors()
        .skip(1)
        .take(4)
        .flat_map(|folder| places.map(|place| folder.join(place)))
        .find(|file| file.is_file())
        .with_context(|| {
            format!(
                "--ardupilot {}: no default_params/copter.parm near it; name it with --ardupilot-defaults",
                program.display()
            )
        })
}

/// The parameters of the copter that the world has, which lands when its companion dies.
fn parameters_of(index: usize, model: &VehicleModel) -> String {
    let nominal_v = (model.battery.full_v + model.battery.empty_v) / 2.0;
    let capacity_mah = model.battery.capacity_wh / nominal_v * 1000.0;
    let frame = "FRAME_CLASS 1\nFRAME_TYPE 1\n";
    let failsafes = ARDUPILOT.safe_settings(u8::try_from(index + 1).unwrap_or(u8::MAX));
    let failsafes = failsafes.iter().map(|(name, value)| format!("{name} {value}\n"));
    format!("{frame}BATT_CAPACITY {capacity_mah:.0}\n{}", failsafes.collect::<String>())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use std::net::TcpListener;
    use std::time::Instant;

    use super::*;

    /// So far up that no real one is there.
    const INDEX: usize = 70;

    #[test]
    fn the_rotors_of_one_that_has_gone_stand() {
        let model = VehicleModel::built_in("x500").unwrap();
        let datum = Datum::from_degrees(47.4, 8.5, 488.0);
        let port = |base: u16| base + PORTS_APART * INDEX as u16;
        let mavlink = TcpListener::bind((Ipv4Addr::LOCALHOST, port(MAVLINK_PORT))).unwrap();
        let mut copter = ArduPilot::start(INDEX, datum, &model, None, None, Path::new("")).unwrap();
        let (link, _) = mavlink.accept().unwrap();
        let servos = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let mut packet = [0; 40];
        packet[..2].copy_from_slice(&18_458_u16.to_le_bytes());
        (0..4).for_each(|motor| packet[8 + 2 * motor..][..2].copy_from_slice(&1500_u16.to_le_bytes()));
        for _ in 0..ANSWERS {
            servos.send_to(&packet, (Ipv4Addr::LOCALHOST, port(SERVO_PORT))).unwrap();
        }
        let half = 0.5 * (1.0 - QUADRATIC) + 0.25 * QUADRATIC;
        assert_eq!(copter.commands(), MotorCommands([half; 4]));
        drop(link);
        let began = Instant::now();
        while copter.mavlink.is_some() {
            assert!(began.elapsed() < TIME_TO_CONNECT, "its end is not noticed");
            copter.take_output();
        }
        assert_eq!(copter.commands(), MotorCommands([0.0; 4]));
    }
}
