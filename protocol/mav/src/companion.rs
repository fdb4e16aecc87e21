//! The companion's end of an autopilot's link.

mod clock;
mod commands;
mod missions;
mod parameters;
mod reports;
mod subscriptions;

use std::collections::VecDeque;
use std::time::Duration;

use mavlink::dialects::common::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavState, MavType,
    SET_GPS_GLOBAL_ORIGIN_DATA,
};
use mavlink::{MavlinkVersion, Message};

use crate::address::Address;
use crate::command::{Command, CommandResult};
use crate::dialect::Dialect;
use crate::event::MavEvent;
use crate::external::External;
use crate::frame::{Frame, FrameReader, FrameWriter};
use crate::geodesy::{Datum, LocalFrame};
use crate::measured::Measured;
use crate::mission::MissionItem;
use crate::parameter::{MAX_NAME_LEN, ParameterValue};
use crate::set_point::SetPoint;
use crate::signing::Signing;
use crate::telemetry::{Stamped, Telemetry};
use commands::{Commands, Purpose};
use missions::{Missions, Wanted};
use parameters::Parameters;
use reports::Reports;
use subscriptions::Subscriptions;

/// Interval of the companion's own heartbeat.
const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);
/// An autopilot that goes on in MAVLink 1 for so long, while it is written to in 2, is answered in 1.
const ONLY_MAVLINK_1: Duration = Duration::from_secs(3);
/// The origin is told this often to an autopilot that has none.
const ORIGIN_INTERVAL: Duration = Duration::from_secs(1);
/// Readings of instruments that are kept until they are taken.
const MOST_MEASURED: usize = 256;
/// MAVLink's component id for the first companion computer.
const ONBOARD_COMPUTER: u8 = 191;

/// The companion's identity and place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompanionConfig {
    /// System id of the vehicle, which the companion shares.
    pub system_id: u8,
    /// Component id of the companion: 191.
    pub component_id: u8,
    /// Datum of the world's ENU frame.
    pub datum: Datum,
    /// Whether the autopilot is asked for what its instruments measure: see [`Companion::take_measured`].
    pub wants_measured: bool,
    /// The link's signatures, if its frames are signed.
    pub signing: Option<Signing>,
}

impl CompanionConfig {
    /// The companion computer of the vehicle `system_id`.
    pub fn new(system_id: u8, datum: Datum) -> Self {
        Self { system_id, component_id: ONBOARD_COMPUTER, datum, wants_measured: false, signing: None }
    }
}

/// The companion's end of an autopilot's link. The heartbeat tells the make of the autopilot, from which its
/// [`Dialect`] follows.
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
    autopilot: Address,
    reader: FrameReader,
    writer: FrameWriter,
    reports: Reports,
    commands: Commands,
    subscriptions: Subscriptions,
    parameters: Parameters,
    missions: Missions,
    events: VecDeque<MavEvent>,
    next_heartbeat: Duration,
    /// Since when the autopilot's frames have been in MAVLink 1, without one in 2.
    mavlink_1_since: Option<Duration>,
    /// Whether it gives no commands and sends no set-points.
    only_listens: bool,
    /// See [`Dialect::set_point`].
    kept_yaw: Option<f64>,
    datum: Datum,
    measured: Vec<Stamped<Measured>>,
    next_origin: Duration,
    signing: Option<Signing>,
}

impl Companion {
    /// A companion that has heard nothing yet.
    pub fn new(config: CompanionConfig) -> Self {
        let CompanionConfig { system_id, component_id, .. } = config;
        let (mut reader, mut writer) =
            (FrameReader::default(), FrameWriter::new(Address { system_id, component_id }));
        if let Some(signing) = &config.signing {
            (reader, writer) = (FrameReader::signed(signing), writer.signed(signing));
        }
        Self {
            autopilot: Address::autopilot(config.system_id),
            reader,
            writer,
            reports: Reports::new(config.datum),
            commands: Commands::default(),
            subscriptions: Subscriptions::new(config.wants_measured),
            parameters: Parameters::default(),
            missions: Missions::default(),
            events: VecDeque::new(),
            next_heartbeat: Duration::ZERO,
            mavlink_1_since: None,
            only_listens: false,
            kept_yaw: None,
            datum: config.datum,
            measured: Vec::new(),
            next_origin: Duration::ZERO,
            signing: config.signing,
        }
    }

    /// From now on nothing leaves that the vehicle would obey: commands count as accepted, set-points as sent.
    pub fn only_listen(&mut self) {
        self.only_listens = true;
    }

    /// Takes in bytes from the autopilot, in whatever pieces they came. Garbage is skipped, and counted in
    /// [`Companion::bad_bytes`]; messages of other systems and components are ignored.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.set_signing_time(now);
        self.reader.push(bytes);
        while let Some(frame) = self.reader.next_frame() {
            if frame.sender == self.autopilot {
                self.answer_in(now, frame.version);
                self.handle(now, &frame);
            }
        }
    }

    /// Tells both directions the time. The autopilot's may be ahead of it, as satellites tell it the time: it refuses
    /// what is older than it has heard.
    fn set_signing_time(&mut self, now: Duration) {
        if let Some(signing) = &self.signing {
            self.reader.not_before(signing.began.after(now));
            self.writer.not_before(self.reader.newest_signing_time());
            self.reports.telemetry.refused = self.reader.refused();
        }
    }

    /// Writes in MAVLink 2, unless the autopilot knows 1 only, which has no signatures.
    fn answer_in(&mut self, now: Duration, heard: MavlinkVersion) {
        let since = (heard == MavlinkVersion::V1).then(|| self.mavlink_1_since.unwrap_or(now));
        self.mavlink_1_since = since;
        let knows_1_only = since.is_some_and(|since| now.saturating_sub(since) >= ONLY_MAVLINK_1);
        self.reports.telemetry.knows_mavlink_1_only = knows_1_only;
        let answers_in_1 = knows_1_only && self.signing.is_none();
        self.writer.speak(if answers_in_1 { MavlinkVersion::V1 } else { MavlinkVersion::V2 });
    }

    /// Does what is due: heartbeat, repetitions, requests, time-outs.
    pub fn tick(&mut self, now: Duration) {
        self.set_signing_time(now);
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
        if self.reports.end_without_heartbeat(now) {
            self.subscriptions.forget();
            self.events.push_back(MavEvent::HeartbeatLost);
        }
        for purpose in self.commands.tick(now, &mut self.writer) {
            if let Purpose::Flight(command) = purpose {
                self.events.push_back(MavEvent::CommandTimedOut { command });
            }
        }
        if !self.telemetry().connected {
            return;
        }
        if let Some(question) = self.reports.clock.ask(now) {
            self.writer.write(&question);
        }
        self.ask_for_messages(now);
        let encoding = self.dialect().parameter_encoding();
        for name in self.parameters.tick(now, encoding, self.autopilot, &mut self.writer) {
            self.events.push_back(MavEvent::ParameterMissing { name });
        }
        self.events.extend(self.missions.tick(now, self.autopilot, &mut self.writer));
    }

    /// Takes the bytes to be sent to the autopilot. They are whole frames, so any datagram may carry them.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.writer.take()
    }

    /// Gives a command at once and repeats it until it is acknowledged: [`MavEvent::CommandAcked`] or
    /// [`MavEvent::CommandTimedOut`] follows. A mode command replaces one that is not acknowledged yet.
    pub fn command(&mut self, now: Duration, command: Command) {
        let encoded = match self.telemetry().last_heartbeat {
            Some(_) => self.dialect().encode(command, self.telemetry().home_height_m),
            None => Err(CommandResult::NoAutopilot),
        };
        let ended = match encoded {
            Ok(_) if self.only_listens => Some((command, CommandResult::Accepted)),
            Ok(message) => match self.send_command(now, Purpose::Flight(command), message) {
                Some(Purpose::Flight(replaced)) => Some((replaced, CommandResult::Cancelled)),
                _ => None,
            },
            Err(result) => Some((command, result)),
        };
        self.events.extend(ended.map(|(command, result)| MavEvent::CommandAcked { command, result }));
    }

    /// Sends a set-point (20 Hz or more keep the autopilot in offboard). Returns whether it was sent: not
    /// before the autopilot is known, not without its local origin if it holds a position, not with a number
    /// that is not finite.
    pub fn set_point(&mut self, now: Duration, set_point: SetPoint) -> bool {
        let adapted = self.dialect().set_point(set_point, &self.reports.telemetry, &mut self.kept_yaw);
        let message = adapted.filter(SetPoint::is_finite).and_then(|set_point| {
            let time_boot_ms = now.as_millis() as u32;
            set_point.encode(self.autopilot.system_id, self.reports.local_frame(), time_boot_ms)
        });
        if let Some(message) = message.as_ref().filter(|_| !self.only_listens) {
            self.writer.write(message);
        }
        message.is_some()
    }

    /// Tells the autopilot an estimate of its motion that it may fly by; and to one that knows of no origin, where that
    /// is: at the datum. Returns whether it was sent.
    pub fn external(&mut self, now: Duration, external: &External) -> bool {
        if self.telemetry().last_heartbeat.is_none() || self.only_listens {
            return false;
        }
        let origin = self.datum.place();
        if self.reports.local_frame().is_none() && now >= self.next_origin {
            self.next_origin = now + ORIGIN_INTERVAL;
            self.writer.write(&SET_GPS_GLOBAL_ORIGIN_DATA {
                target_system: self.autopilot.system_id,
                latitude: origin.latitude_e7(),
                longitude: origin.longitude_e7(),
                altitude: origin.height_mm(),
                time_usec: now.as_micros() as u64,
            });
        }
        let to_be = LocalFrame::new(&self.datum, &origin);
        let local = self.reports.local_frame().unwrap_or(&to_be);
        self.reports.dialect.external(now, external, local, &mut self.writer)
    }

    /// Takes what the autopilot's instruments have measured since the last call, oldest first, each with its time as
    /// near as the clocks are known. Empty unless [`CompanionConfig::wants_measured`].
    pub fn take_measured(&mut self) -> Vec<Stamped<Measured>> {
        std::mem::take(&mut self.measured)
    }

    /// The dialect of the autopilot's make, as its heartbeats say.
    pub fn dialect(&self) -> &'static dyn Dialect {
        self.reports.dialect
    }

    /// The newest of everything heard.
    pub fn telemetry(&self) -> &Telemetry {
        &self.reports.telemetry
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
        self.events.extend(self.missions.want(Wanted::Download));
    }

    /// Gives the autopilot a mission in place of the one it has: [`MavEvent::MissionUploaded`] or
    /// [`MavEvent::MissionFailed`] follows.
    pub fn upload_mission(&mut self, items: Vec<MissionItem>) {
        self.events.extend(self.missions.want(Wanted::Upload(items)));
    }

    /// Bytes skipped so far because they belonged to no intact frame.
    pub fn bad_bytes(&self) -> u64 {
        self.reader.bad_bytes()
    }

    fn request_parameter(&mut self, name: &str, write: Option<ParameterValue>) {
        if name.is_empty() || name.len() > MAX_NAME_LEN {
            let name = name.to_owned();
            self.events.push_back(MavEvent::ParameterMissing { name });
        } else {
            self.parameters.request(name, write.filter(|_| !self.only_listens));
        }
    }

    /// Returns the purpose of the command that this one replaces, if any.
    fn send_command(
        &mut self,
        now: Duration,
        purpose: Purpose,
        mut message: COMMAND_LONG_DATA,
    ) -> Option<Purpose> {
        message.target_system = self.autopilot.system_id;
        message.target_component = self.autopilot.component_id;
        self.commands.send(now, purpose, message, &mut self.writer)
    }

    /// Asks for one overdue message at a time: an acknowledgement does not say which one it is for.
    fn ask_for_messages(&mut self, now: Duration) {
        if self.commands.is_pending(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL)
            || self.commands.is_pending(MavCmd::MAV_CMD_REQUEST_MESSAGE)
        {
            return;
        }
        let estimator_message = self.dialect().estimator_message();
        if let Some((message_id, request)) = self.subscriptions.next_request(now, estimator_message) {
            self.send_command(now, Purpose::Subscription(message_id), request);
        }
    }

    fn handle(&mut self, now: Duration, frame: &Frame) {
        self.subscriptions.seen(now, frame.message.message_id());
        let for_me = self.writer.sender().is_addressed_by(&frame.message);
        match &frame.message {
            MavMessage::COMMAND_ACK(message) if for_me => {
                match self.commands.on_ack(now, message.command, message.result) {
                    Some((Purpose::Flight(command), result)) => {
                        self.events.push_back(MavEvent::CommandAcked { command, result });
                    }
                    Some((Purpose::Subscription(message_id), result)) if !result.is_accepted() => {
                        self.subscriptions.refused(message_id);
                    }
                    _ => {}
                }
            }
            MavMessage::TIMESYNC(message) => self.reports.clock.hear(now, message),
            MavMessage::PARAM_VALUE(message) => {
                let encoding = self.dialect().parameter_encoding();
                let (name, value) = self.parameters.on_value(message, encoding);
                self.events.push_back(MavEvent::ParameterRead { name, value });
            }
            message if for_me => {
                self.events.extend(self.missions.receive(now, message, self.autopilot, &mut self.writer));
            }
            message => match Measured::read(message) {
                Some((time, value)) if self.measured.len() < MOST_MEASURED => {
                    let age = self.reports.clock.age(now, time).unwrap_or_default();
                    self.measured.push(Stamped { stamp: now.saturating_sub(age), value });
                }
                Some(_) => {}
                None => self.reports.hear(now, message, &mut self.events),
            },
        }
    }
}
