//! The companion's end of an autopilot's link.

mod commands;
mod missions;
mod parameters;
mod subscriptions;

use std::collections::VecDeque;
use std::time::Duration;

use mavlink::Message;
use mavlink::dialects::common::{
    ATTITUDE_QUATERNION_DATA, BATTERY_STATUS_DATA, EXTENDED_SYS_STATE_DATA, HEARTBEAT_DATA,
    HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavLandedState, MavMessage,
    MavModeFlag, MavState, MavSysStatusSensor, MavType, STATUSTEXT_DATA, SYS_STATUS_DATA,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::axes;
use crate::command::{Command, CommandResult};
use crate::frame::{Address, Frame, FrameReader, FrameWriter};
use crate::geodesy::{Datum, Geodetic, LocalFrame};
use crate::mission::{MissionError, MissionItem};
use crate::mode::{AutopilotKind, FlightMode};
use crate::parameter::{MAX_NAME_LEN, ParameterValue};
use crate::set_point::SetPoint;
use crate::telemetry::{Battery, Landed, Severity, Stamped, Telemetry, Text};
use commands::{Commands, Purpose};
use missions::{Missions, Wanted};
use parameters::Parameters;
use subscriptions::Subscriptions;

/// An autopilot whose heartbeat (1 Hz) stays away this long is lost.
pub const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(3);
/// Interval of the companion's own heartbeat.
const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);
/// MAVLink's component id for the first companion computer.
const ONBOARD_COMPUTER: u8 = 191;
/// How quickly a height error is flown off where planar set-points must become velocities, 1/s.
const PLANAR_CLIMB_GAIN: f64 = 1.0;
/// Fastest climb or descent then, m/s.
const PLANAR_MAX_CLIMB_M_S: f64 = 1.5;

/// Who the companion is, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompanionConfig {
    /// System id of the vehicle, which the companion shares.
    pub system_id: u8,
    /// Component id of the companion: 191.
    pub component_id: u8,
    /// Datum of the world's ENU frame.
    pub datum: Datum,
}

impl CompanionConfig {
    /// The companion computer of the vehicle `system_id`.
    pub fn new(system_id: u8, datum: Datum) -> Self {
        Self { system_id, component_id: ONBOARD_COMPUTER, datum }
    }
}

/// Something that happened on the link.
#[derive(Debug, Clone, PartialEq)]
pub enum MavEvent {
    /// The autopilot answered a command, or it could not be sent.
    CommandAcked {
        command: Command,
        /// Accepted, or why not.
        result: CommandResult,
    },
    /// The autopilot never answered, for all repetitions. It may have obeyed.
    CommandTimedOut { command: Command },
    /// The flight mode changed, whoever asked for it.
    ModeChanged { from: FlightMode, to: FlightMode },
    /// The autopilot armed or disarmed, whoever asked for it.
    ArmedChanged { armed: bool },
    /// Heartbeats stopped for [`HEARTBEAT_TIMEOUT`].
    HeartbeatLost,
    /// Heartbeats came (again).
    HeartbeatRegained,
    /// A parameter that was read or written has this value.
    ParameterRead { name: String, value: ParameterValue },
    /// A parameter that was asked for never came: the autopilot does not have it, or the link is bad.
    ParameterMissing { name: String },
    /// The mission was downloaded.
    MissionReceived {
        /// Its items in order.
        items: Vec<MissionItem>,
    },
    /// The mission was uploaded, and the autopilot accepted it.
    MissionUploaded,
    /// A mission transfer failed.
    MissionFailed { error: MissionError },
    /// The autopilot wrote a line.
    Text(Text),
}

/// The companion's end of an autopilot's link: PX4, Skein's built-in autopilot, ArduPilot. Which of them it
/// is, is learnt from the heartbeat, and every number follows from that.
///
/// Without I/O: the caller passes received bytes in, calls [`Companion::tick`] at least every 100 ms, and
/// sends what [`Companion::take_output`] gives. Everything is in the world's ENU frame.
///
/// ```
/// use std::time::Duration;
/// use skein_mav::{Command, Companion, CompanionConfig, Datum};
///
/// let datum = Datum::from_degrees(47.397742, 8.545594, 488.0);
/// let mut companion = Companion::new(CompanionConfig::new(1, datum));
/// companion.tick(Duration::ZERO);
/// assert!(!companion.take_output().is_empty(), "a heartbeat");
///
/// companion.command(Duration::ZERO, Command::Arm);
/// // No autopilot has been heard, so nothing is sent and an event says why.
/// println!("{:?}", companion.poll_event());
/// ```
#[derive(Debug, Clone)]
pub struct Companion {
    config: CompanionConfig,
    reader: FrameReader,
    writer: FrameWriter,
    telemetry: Telemetry,
    /// The autopilot's local frame in the world, once it has told its origin.
    local: Option<LocalFrame>,
    commands: Commands,
    subscriptions: Subscriptions,
    parameters: Parameters,
    missions: Missions,
    events: VecDeque<MavEvent>,
    next_heartbeat: Duration,
    /// Heading kept for ArduPilot while set-points leave it open: it would turn the nose.
    kept_yaw: Option<f64>,
}

impl Companion {
    /// A companion that has heard nothing yet.
    pub fn new(config: CompanionConfig) -> Self {
        Self {
            config,
            reader: FrameReader::default(),
            writer: FrameWriter::new(Address {
                system_id: config.system_id,
                component_id: config.component_id,
            }),
            telemetry: Telemetry::default(),
            local: None,
            commands: Commands::default(),
            subscriptions: Subscriptions::default(),
            parameters: Parameters::default(),
            missions: Missions::default(),
            events: VecDeque::new(),
            next_heartbeat: Duration::ZERO,
            kept_yaw: None,
        }
    }

    /// Takes in bytes from the autopilot, in whatever pieces they came. Garbage is skipped, and counted in
    /// [`Companion::bad_bytes`]; messages of other systems and components are ignored.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.reader.push(bytes);
        while let Some(frame) = self.reader.next_frame() {
            if frame.sender == self.autopilot() {
                self.handle(now, &frame);
            }
        }
    }

    /// Does what is due: heartbeat, repetitions, requests, time-outs.
    pub fn tick(&mut self, now: Duration) {
        if now >= self.next_heartbeat {
            self.next_heartbeat = now + HEARTBEAT_INTERVAL;
            self.writer.write(&HEARTBEAT_DATA {
                mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
                autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
                ..Default::default()
            });
        }
        self.watch_heartbeat(now);
        for purpose in self.commands.tick(now, &mut self.writer) {
            if let Purpose::Flight(command) = purpose {
                self.events.push_back(MavEvent::CommandTimedOut { command });
            }
        }
        let Some(kind) = self.telemetry.autopilot.filter(|_| self.telemetry.connected) else {
            return;
        };
        self.ask_for_messages(now);
        let autopilot = self.autopilot();
        for name in self.parameters.tick(now, kind, autopilot, &mut self.writer) {
            self.events.push_back(MavEvent::ParameterMissing { name });
        }
        let event = self.missions.tick(now, autopilot, &mut self.writer);
        self.events.extend(event);
    }

    /// Takes the bytes to be sent to the autopilot. They are whole frames, so any datagram may carry them.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.writer.take()
    }

    /// Gives a command at once and repeats it until it is acknowledged: [`MavEvent::CommandAcked`] or
    /// [`MavEvent::CommandTimedOut`] follows. A mode command replaces one that is not acknowledged yet.
    pub fn command(&mut self, now: Duration, command: Command) {
        let encoded = self
            .telemetry
            .autopilot
            .ok_or(CommandResult::NoAutopilot)
            .and_then(|kind| command.encode(kind, self.telemetry.home_height_m));
        let mut message = match encoded {
            Ok(message) => message,
            Err(result) => {
                self.events.push_back(MavEvent::CommandAcked { command, result });
                return;
            }
        };
        message.target_system = self.config.system_id;
        message.target_component = self.autopilot().component_id;
        let replaced = self.commands.send(now, Purpose::Flight(command), message, &mut self.writer);
        if let Some(Purpose::Flight(command)) = replaced {
            self.events.push_back(MavEvent::CommandAcked { command, result: CommandResult::Cancelled });
        }
    }

    /// Sends a set-point (20 Hz or more keep the autopilot in offboard). Returns whether it was sent: not
    /// before the autopilot is known, not without its local origin if it holds a position, not with a number
    /// that is not finite.
    pub fn set_point(&mut self, now: Duration, set_point: SetPoint) -> bool {
        let adapted = match self.telemetry.autopilot {
            Some(AutopilotKind::Px4) => Some(set_point),
            Some(AutopilotKind::ArduPilot) => self.for_ardupilot(set_point),
            Some(AutopilotKind::Other) | None => None,
        };
        let message = adapted.filter(SetPoint::is_finite).and_then(|set_point| {
            let time_boot_ms = now.as_millis() as u32;
            set_point.encode(self.config.system_id, self.local.as_ref(), time_boot_ms)
        });
        if let Some(message) = &message {
            self.writer.write(message);
        }
        message.is_some()
    }

    /// The newest of everything heard.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// The next event, oldest first.
    pub fn poll_event(&mut self) -> Option<MavEvent> {
        self.events.pop_front()
    }

    /// Reads a parameter by name (at most 16 bytes): [`MavEvent::ParameterRead`] or
    /// [`MavEvent::ParameterMissing`] follows. Waits for the autopilot to be connected.
    pub fn read_parameter(&mut self, name: &str) {
        self.request_parameter(name, None);
    }

    /// Writes a parameter and reads it back: [`MavEvent::ParameterRead`] has the value that the autopilot
    /// took.
    pub fn write_parameter(&mut self, name: &str, value: ParameterValue) {
        self.request_parameter(name, Some(value));
    }

    /// Reads the mission back from the autopilot: [`MavEvent::MissionReceived`] or
    /// [`MavEvent::MissionFailed`] follows.
    pub fn download_mission(&mut self) {
        let event = self.missions.want(Wanted::Download);
        self.events.extend(event);
    }

    /// Gives the autopilot a mission in place of the one it has: [`MavEvent::MissionUploaded`] or
    /// [`MavEvent::MissionFailed`] follows.
    pub fn upload_mission(&mut self, items: Vec<MissionItem>) {
        let event = self.missions.want(Wanted::Upload(items));
        self.events.extend(event);
    }

    /// Bytes skipped so far because they belonged to no intact frame.
    pub fn bad_bytes(&self) -> u64 {
        self.reader.bad_bytes()
    }

    fn autopilot(&self) -> Address {
        Address::autopilot(self.config.system_id)
    }

    fn request_parameter(&mut self, name: &str, write: Option<ParameterValue>) {
        if name.is_empty() || name.len() > MAX_NAME_LEN {
            let name = name.to_owned();
            self.events.push_back(MavEvent::ParameterMissing { name });
        } else {
            self.parameters.request(name, write);
        }
    }

    fn watch_heartbeat(&mut self, now: Duration) {
        let silent =
            self.telemetry.last_heartbeat.is_some_and(|last| now.saturating_sub(last) > HEARTBEAT_TIMEOUT);
        if self.telemetry.connected && silent {
            self.telemetry.connected = false;
            self.subscriptions.forget();
            self.events.push_back(MavEvent::HeartbeatLost);
        }
    }

    /// Asks for one overdue message at a time: an acknowledgement does not say which one it is for.
    fn ask_for_messages(&mut self, now: Duration) {
        if self.commands.is_pending(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL)
            || self.commands.is_pending(MavCmd::MAV_CMD_REQUEST_MESSAGE)
        {
            return;
        }
        if let Some(mut request) = self.subscriptions.next_request(now) {
            request.target_system = self.config.system_id;
            request.target_component = self.autopilot().component_id;
            self.commands.send(now, Purpose::Subscription, request, &mut self.writer);
        }
    }

    /// ArduPilot stops the vehicle on a set-point with partial axes and turns the nose on one without
    /// heading: planar ones become full velocities, and an open heading the one the vehicle had.
    fn for_ardupilot(&mut self, set_point: SetPoint) -> Option<SetPoint> {
        self.kept_yaw = set_point.yaw().or(self.kept_yaw).or_else(|| {
            let attitude = self.telemetry.attitude?;
            Some(axes::yaw(&attitude.value))
        });
        let yaw = self.kept_yaw;
        Some(match set_point {
            SetPoint::Planar { vx, vy, z, .. } => {
                let climb = PLANAR_CLIMB_GAIN * (z - self.telemetry.position?.value.z);
                let vz = climb.clamp(-PLANAR_MAX_CLIMB_M_S, PLANAR_MAX_CLIMB_M_S);
                SetPoint::Velocity { velocity: Vector3::new(vx, vy, vz), yaw }
            }
            SetPoint::Velocity { velocity, .. } => SetPoint::Velocity { velocity, yaw },
            SetPoint::Position { position, .. } => SetPoint::Position { position, yaw },
        })
    }

    fn handle(&mut self, now: Duration, frame: &Frame) {
        self.subscriptions.seen(now, frame.message.message_id());
        match &frame.message {
            MavMessage::HEARTBEAT(message) => self.on_heartbeat(now, message),
            MavMessage::LOCAL_POSITION_NED(message) => self.on_local_position(now, message),
            MavMessage::ATTITUDE_QUATERNION(message) => self.on_attitude(now, message),
            MavMessage::GPS_GLOBAL_ORIGIN(message) => {
                self.on_origin(Geodetic::from_e7(message.latitude, message.longitude, message.altitude))
            }
            MavMessage::HOME_POSITION(message) => self.on_home(message),
            MavMessage::EXTENDED_SYS_STATE(message) => self.on_extended_state(message),
            MavMessage::SYS_STATUS(message) => self.on_system_status(message),
            MavMessage::BATTERY_STATUS(message) => self.on_battery(now, message),
            MavMessage::STATUSTEXT(message) => self.on_text(now, message),
            MavMessage::COMMAND_ACK(message) => {
                let for_me = self.writer.sender().is_target(message.target_system, message.target_component);
                let settled =
                    for_me.then(|| self.commands.on_ack(now, message.command, message.result)).flatten();
                if let Some((Purpose::Flight(command), result)) = settled {
                    self.events.push_back(MavEvent::CommandAcked { command, result });
                }
            }
            MavMessage::PARAM_VALUE(message) => {
                let kind = self.telemetry.autopilot.unwrap_or(AutopilotKind::Other);
                if let Some((name, value)) = self.parameters.on_value(message, kind) {
                    self.events.push_back(MavEvent::ParameterRead { name, value });
                }
            }
            other => self.on_mission_message(now, other),
        }
    }

    fn on_mission_message(&mut self, now: Duration, message: &MavMessage) {
        let for_me = message.target_system_id().is_some_and(|system| {
            let component = message.target_component_id().unwrap_or(0);
            self.writer.sender().is_target(system, component)
        });
        if for_me {
            let autopilot = self.autopilot();
            let event = self.missions.receive(now, message, autopilot, &mut self.writer);
            self.events.extend(event);
        }
    }

    fn on_heartbeat(&mut self, now: Duration, message: &HEARTBEAT_DATA) {
        let kind = AutopilotKind::from(message.autopilot);
        let first = self.telemetry.autopilot.is_none();
        self.telemetry.autopilot = Some(kind);
        self.telemetry.last_heartbeat = Some(now);
        if !self.telemetry.connected {
            self.telemetry.connected = true;
            self.events.push_back(MavEvent::HeartbeatRegained);
        }
        let mode = FlightMode::from_custom(kind, message.custom_mode);
        let from = std::mem::replace(&mut self.telemetry.mode, mode);
        if from != mode && !first {
            self.events.push_back(MavEvent::ModeChanged { from, to: mode });
        }
        let armed = message.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
        if std::mem::replace(&mut self.telemetry.armed, armed) != armed {
            self.events.push_back(MavEvent::ArmedChanged { armed });
        }
        if message.system_status == MavState::MAV_STATE_BOOT {
            self.telemetry.ready_to_arm = false;
        }
    }

    fn on_local_position(&mut self, now: Duration, message: &LOCAL_POSITION_NED_DATA) {
        let position = vector(message.x, message.y, message.z);
        let velocity = vector(message.vx, message.vy, message.vz);
        if !position.iter().chain(velocity.iter()).all(|number| number.is_finite()) {
            return;
        }
        self.telemetry.velocity = Some(Stamped { stamp: now, value: axes::ned_to_enu(&velocity) });
        if let Some(local) = &self.local {
            self.telemetry.position = Some(Stamped { stamp: now, value: local.position_to_world(&position) });
        }
    }

    fn on_attitude(&mut self, now: Duration, message: &ATTITUDE_QUATERNION_DATA) {
        let [w, x, y, z] = [message.q1, message.q2, message.q3, message.q4].map(f64::from);
        let rate = vector(message.rollspeed, message.pitchspeed, message.yawspeed);
        // Half a unit away from one is no rotation any more, but a broken sender.
        let Some(attitude) = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.5) else {
            return;
        };
        if !attitude.coords.iter().chain(rate.iter()).all(|number| number.is_finite()) {
            return;
        }
        self.telemetry.attitude = Some(Stamped { stamp: now, value: axes::attitude_from_ned(&attitude) });
        self.telemetry.angular_rate = Some(Stamped { stamp: now, value: axes::frd_to_flu(&rate) });
    }

    fn on_origin(&mut self, origin: Geodetic) {
        if self.telemetry.local_origin != Some(origin) {
            self.telemetry.local_origin = Some(origin);
            self.local = Some(LocalFrame::new(&self.config.datum, &origin));
        }
    }

    fn on_home(&mut self, message: &HOME_POSITION_DATA) {
        let home = Geodetic::from_e7(message.latitude, message.longitude, message.altitude);
        self.telemetry.home = Some(self.config.datum.to_enu(&home));
        self.telemetry.home_height_m = Some(home.height_m);
    }

    fn on_extended_state(&mut self, message: &EXTENDED_SYS_STATE_DATA) {
        self.telemetry.landed = match message.landed_state {
            MavLandedState::MAV_LANDED_STATE_UNDEFINED => Landed::Unknown,
            MavLandedState::MAV_LANDED_STATE_ON_GROUND => Landed::OnGround,
            MavLandedState::MAV_LANDED_STATE_IN_AIR => Landed::InAir,
            MavLandedState::MAV_LANDED_STATE_TAKEOFF => Landed::TakingOff,
            MavLandedState::MAV_LANDED_STATE_LANDING => Landed::Landing,
        };
    }

    /// Ready to arm is the pre-arm bit (ArduPilot, PX4 from 1.13); an older PX4 without it is taken at its
    /// sensors' word.
    fn on_system_status(&mut self, message: &SYS_STATUS_DATA) {
        let pre_arm = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled;
        let healthy = message.onboard_control_sensors_health;
        self.telemetry.sensors_ok = healthy.contains(used - pre_arm);
        self.telemetry.ready_to_arm =
            if used.contains(pre_arm) { healthy.contains(pre_arm) } else { self.telemetry.sensors_ok };
    }

    fn on_battery(&mut self, now: Duration, message: &BATTERY_STATUS_DATA) {
        // u16::MAX marks a cell that is not there, -1 an unknown charge.
        let cells = message.voltages.iter().filter(|cell| **cell != u16::MAX);
        let millivolts: u32 = cells.map(|cell| u32::from(*cell)).sum();
        if message.id == 0 && (0..=100).contains(&message.battery_remaining) {
            self.telemetry.battery = Some(Stamped {
                stamp: now,
                value: Battery {
                    fraction: f64::from(message.battery_remaining) / 100.0,
                    voltage_v: f64::from(millivolts) / 1000.0,
                },
            });
        }
    }

    fn on_text(&mut self, now: Duration, message: &STATUSTEXT_DATA) {
        let text = Text {
            severity: Severity::from(message.severity),
            text: message.text.to_str().unwrap_or_default().to_owned(),
        };
        if self.telemetry.texts.len() == Telemetry::MAX_TEXTS {
            self.telemetry.texts.pop_front();
        }
        self.telemetry.texts.push_back(Stamped { stamp: now, value: text.clone() });
        self.events.push_back(MavEvent::Text(text));
    }
}

fn vector(x: f32, y: f32, z: f32) -> Vector3<f64> {
    Vector3::new(f64::from(x), f64::from(y), f64::from(z))
}
