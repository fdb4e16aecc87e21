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
use super::instance::{Instance, ending, fresh, wait_for};
use super::legs::Legs;
use super::magnetism;
use crate::mavlink_ports::{COMPANION, GROUND};

/// The simulator's port of instance 0.
const SIMULATOR_PORT: u16 = 4560;
/// The ports that companions hear on and those that they speak to are so many apart.
const MOST_INSTANCES: usize = 40;
/// Instances that somebody else starts all speak to one port from here on.
const MOST_OF_OTHERS: usize = 10;
/// Names of the airframe that it flies, the newer first.
const AIRFRAMES: [&str; 2] = ["none_iris", "iris"];
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
    instance: Option<Instance>,
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
        let most = if program.is_some() { MOST_INSTANCES } else { MOST_OF_OTHERS };
        anyhow::ensure!(
            index < most,
            "{name}: at most {most} PX4s are served; beyond that they share one port"
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
        listener.set_nonblocking(true)?;
        let (stream, _) = wait_for(&mut instance, TIME_TO_CONNECT, || {
            listener.accept().with_context(|| format!("it has not connected within {TIME_TO_CONNECT:?}"))
        })
        .with_context(|| name.clone())?;
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        Ok(Self {
            instance,
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
        tracing::warn!("{} has gone{}", self.name, ending(&mut self.instance));
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
    let airframe = find_airframe(&etc)?;
    let folder = fresh(folder)?;
    for (name, script) in [("px4-rc.params", parameters_of(model)), ("px4-rc.mavlink", links())] {
        std::fs::write(folder.join(name), script).with_context(|| format!("{}/{name}", folder.display()))?;
    }
    // Its start script takes these two from the path, and those of PX4 itself only after it.
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path = std::iter::once(folder.clone()).chain(std::env::split_paths(&others));
    let mut command = Command::new(program);
    command
        .args(["-d", "-i"])
        .arg(index.to_string())
        .arg("-s")
        .arg(etc.join("init.d-posix/rcS"))
        .arg(&etc)
        .env("PATH", std::env::join_paths(path)?)
        .env("PX4_SIM_MODEL", airframe)
        .env_remove("PX4_SIMULATOR");
    Instance::start(command, &folder)
}

/// The name by which this PX4 knows the airframe without a simulator of its own; until 1.13 a plain `iris`.
fn find_airframe(etc: &Path) -> anyhow::Result<&'static str> {
    let folder = etc.join("init.d-posix/airframes");
    let listed = std::fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
    let files: Vec<String> =
        listed.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    let is_there = |airframe: &&str| {
        files.iter().any(|file| file.split_once('_').is_some_and(|(_, name)| name == *airframe))
    };
    AIRFRAMES.into_iter().find(is_there).with_context(|| {
        format!("{}: expected the airframe {}; build px4_sitl", folder.display(), AIRFRAMES.join(" or "))
    })
}

/// Sets parameters for this world: its battery empties as the vehicle's does in hover, there is no remote control,
/// and nobody reads its logs.
fn parameters_of(model: &VehicleModel) -> String {
    let endurance_s = model.battery.capacity_wh / model.battery.hover_power_w * 3600.0;
    format!(
        "param set SIM_BAT_DRAIN {endurance_s:.0}\nparam set SIM_BAT_MIN_PCT 0\n\
         param set COM_RC_IN_MODE 4\nparam set SDLOG_MODE -1\n"
    )
}

/// Opens its links to ground stations and to its companion, each on a port of its own.
fn links() -> String {
    let ((hears_on, speaks_to), (ground_hears_on, _)) = (COMPANION, GROUND);
    format!(
        "mavlink start -x -u $(({ground_hears_on}+px4_instance)) -r 4000000 -f\n\
         mavlink start -x -u $(({hears_on}+px4_instance)) -r 4000000 -f -m onboard -o $(({speaks_to}+px4_instance))\n"
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    /// A program that tells which airframe it is given, and what the scripts say that it finds on its path.
    const TELLS: &str = "#!/bin/sh\necho $PX4_SIM_MODEL\npx4_instance=3\n\
        param() { echo param $*; }\nmavlink() { echo mavlink $*; }\n. px4-rc.params\n. px4-rc.mavlink\n";

    #[test]
    fn old_and_new_ones_get_their_airframe_and_the_parameters_of_this_world() {
        let build = tempfile::tempdir().unwrap();
        let airframes = build.path().join("etc/init.d-posix/airframes");
        fs::create_dir_all(&airframes).unwrap();
        fs::write(build.path().join("etc/init.d-posix/rcS"), "").unwrap();
        let program = build.path().join("bin/px4");
        fs::create_dir(build.path().join("bin")).unwrap();
        fs::write(&program, TELLS).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let model = VehicleModel::built_in("x500").unwrap();
        let folder = build.path().join("uav-1");
        let error = launch(0, &model, &program, &folder).err().unwrap().to_string();
        assert!(error.contains("expected the airframe none_iris or iris"), "{error}");
        for (file, airframe) in [("10016_iris", "iris"), ("10016_none_iris", "none_iris")] {
            fs::write(airframes.join(file), "").unwrap();
            let mut instance = launch(0, &model, &program, &folder).unwrap();
            let deadline = Instant::now() + TIME_TO_CONNECT;
            while instance.check().is_ok() {
                assert!(Instant::now() < deadline);
            }
            let log = fs::read_to_string(folder.join("log.txt")).unwrap();
            assert!(log.starts_with(&format!("{airframe}\nparam set SIM_BAT_DRAIN ")), "{log}");
            assert!(log.contains("-u 14583 -r 4000000 -f -m onboard -o 14543\n"), "{log}");
        }
    }
}
