//! The autopilot's end of the link.

mod calls;
mod felt;
mod missions;
mod parameter_table;
mod parameters;
mod report;
mod request;
mod streams;

use std::collections::VecDeque;
use std::time::Duration;

use mavlink::MessageData;
use mavlink::dialects::common::{
    AUTOPILOT_VERSION_DATA, COMMAND_ACK_DATA, DISTANCE_SENSOR_DATA, EXTENDED_SYS_STATE_DATA,
    GPS_GLOBAL_ORIGIN_DATA, HEARTBEAT_DATA, HIGHRES_IMU_DATA, HOME_POSITION_DATA, LOG_ENTRY_DATA,
    MANUAL_CONTROL_DATA, MESSAGE_INTERVAL_DATA, MISSION_CURRENT_DATA, MISSION_ITEM_REACHED_DATA,
    MISSION_REQUEST_DATA, MISSION_REQUEST_INT_DATA, MavCmd, MavMessage, MavModeFlag, OPTICAL_FLOW_RAD_DATA,
    PARAM_SET_DATA, PING_DATA, PROTOCOL_VERSION_DATA, SET_MODE_DATA, STATUSTEXT_DATA, TIMESYNC_DATA,
};
use mavlink::types::CharArray;
use nalgebra::Vector3;

use crate::address::Address;
use crate::command::CommandResult;
use crate::dialects::px4;
use crate::external::External;
use crate::frame::{Frame, FrameReader, FrameWriter};
use crate::geodesy::{Datum, Geodetic, LocalFrame};
use crate::measured::Measured;
use crate::mission::MissionItem;
use crate::mode::FlightMode;
use crate::set_point::SetPoint;
use crate::telemetry::{Landed, Severity};
use crate::unparsed::{Unparsed, Want, write_unsupported};
use calls::{Call, Novelty, Remembered};
use felt::Felt;
use missions::{Changed, Missions, whole};
pub use parameter_table::{Parameter, ParameterError, ParameterTable};
use parameters::Parameters;
use report::Report;
pub use report::VehicleState;
pub use request::{AutopilotCommand, Request, Ticket};
use streams::{Rate, Streams};

/// Unread requests kept; a flood beyond them is dropped, and its commands are not acknowledged.
const MAX_REQUESTS: usize = 64;

/// The autopilot's identity and place.
#[derive(Debug, Clone)]
pub struct EndpointConfig {
    /// System id of the vehicle; the component is 1, the autopilot.
    pub system_id: u8,
    /// Datum of the world, which is also the origin of the autopilot's local frame.
    pub datum: Datum,
    pub parameters: ParameterTable,
    /// Which mission items it can fly. An upload with another one is refused whole.
    pub accepts_item: fn(&MissionItem) -> bool,
    /// Whether a list is a geofence that it keeps to.
    pub accepts_fence: fn(&[MissionItem]) -> bool,
    /// Whether a list is one of rally points.
    pub accepts_rally: fn(&[MissionItem]) -> bool,
}

/// The autopilot's end of the link: several stations (a companion, a ground-control program) may talk to it
/// at once, and all of them hear all it says. It speaks PX4's dialect.
///
/// Protocols that do not concern flying (streams, parameters, mission transfer, versions) are dealt with in
/// here; the rest comes out of [`Endpoint::next_request`] as typed wishes.
#[derive(Debug)]
pub struct Endpoint {
    datum: Datum,
    /// The autopilot's local frame, its origin, and how far that has moved from the datum, ENU, m.
    local: LocalFrame,
    origin: Geodetic,
    moved: Vector3<f64>,
    /// When its clock began.
    booted: Duration,
    reader: FrameReader,
    writer: FrameWriter,
    streams: Streams,
    felt: Felt,
    parameters: Parameters,
    missions: Missions,
    remembered: Remembered,
    requests: VecDeque<Request>,
    /// Messages asked for once, sent with the next report.
    asked_once: Vec<u32>,
    reported: Option<Reported>,
}

/// The last report of the things whose change is told at once.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reported {
    mode: FlightMode,
    armed: bool,
    failsafe: bool,
    landed: Landed,
    home: Option<Vector3<f64>>,
    mission_item: u16,
}

impl Reported {
    fn of(state: &VehicleState) -> Self {
        Self {
            mode: state.mode,
            armed: state.armed,
            failsafe: state.failsafe,
            landed: state.landed,
            home: state.home,
            mission_item: state.mission_item,
        }
    }
}

impl Endpoint {
    /// An autopilot's end that has heard nothing yet.
    pub fn new(config: EndpointConfig) -> Self {
        Self {
            datum: config.datum,
            local: LocalFrame::new(&config.datum, &config.datum.place()),
            origin: config.datum.place(),
            moved: Vector3::zeros(),
            booted: Duration::ZERO,
            reader: FrameReader::default(),
            writer: FrameWriter::new(Address::autopilot(config.system_id)),
            streams: Streams::default(),
            felt: Felt::default(),
            parameters: Parameters::new(config.parameters),
            missions: Missions::new(config.accepts_item, config.accepts_fence, config.accepts_rally),
            remembered: Remembered::default(),
            requests: VecDeque::new(),
            asked_once: Vec::new(),
            reported: None,
        }
    }

    /// Takes in bytes from any of the stations. Garbage is skipped, and counted in [`Endpoint::bad_bytes`].
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.reader.push(bytes);
        while let Some(frame) = self.reader.next_frame() {
            if self.concerns(&frame) {
                self.handle(now, &frame);
            }
        }
        while let Some(unread) = self.reader.next_unread() {
            if let Some(unparsed) = Unparsed::read(&unread) {
                self.refuse(&unparsed);
            }
        }
    }

    /// Whether a frame is for this autopilot: an estimate has no address, and comes from its own vehicle.
    fn concerns(&self, frame: &Frame) -> bool {
        let own = self.writer.sender();
        let is_own_estimate =
            matches!(frame.message, MavMessage::ODOMETRY(_)) && frame.sender.system_id == own.system_id;
        is_own_estimate || own.is_addressed_by(&frame.message)
    }

    /// Answers what could not be read whole: the command is not known.
    fn refuse(&mut self, unparsed: &Unparsed) {
        let (system, component) = unparsed.to;
        if !self.writer.sender().is_target(system, component) {
            return;
        }
        match unparsed.want {
            Want::Command(command) => write_unsupported(unparsed.from, command, &mut self.writer),
            Want::Item => self.missions.refuse_item(unparsed.from, &mut self.writer),
        }
    }

    /// The next thing a station asks for, oldest first.
    pub fn next_request(&mut self) -> Option<Request> {
        self.requests.pop_front()
    }

    pub fn answer(&mut self, ticket: Ticket, result: CommandResult) {
        self.remembered.settle(ticket.from, ticket.command, result);
        if ticket.acknowledged {
            self.acknowledge(ticket.from, ticket.command, result);
        }
    }

    /// To be called at each step of the autopilot: sends the telemetry that is due, and at once what has
    /// changed in mode, arming, landed state, home and mission item.
    pub fn report(&mut self, now: Duration, state: &VehicleState) {
        self.hurry_changes(state);
        self.missions.tick(now, &mut self.writer);
        self.parameters.list(&mut self.writer);
        let report = Report {
            now,
            booted: self.booted,
            state,
            datum: &self.datum,
            origin: self.origin,
            local: &self.local,
            mission_len: self.missions.items().len(),
        };
        for message_id in self.asked_once.drain(..) {
            report.write(message_id, &mut self.writer);
        }
        let time = now.saturating_sub(self.booted);
        self.streams.for_each_due(now, |message_id| match message_id {
            HIGHRES_IMU_DATA::ID => self.felt.write(time, &mut self.writer),
            _ => report.write(message_id, &mut self.writer),
        });
    }

    /// Takes in what an instrument has measured by `now`, for who asks for that. To be called at each step of the
    /// inertial unit, before [`Endpoint::report`].
    pub fn measure(&mut self, now: Duration, measured: &Measured) {
        let time = now.saturating_sub(self.booted);
        match measured {
            Measured::Inertial(inertial) => self.felt.take_in(inertial),
            Measured::Flow(flow) if self.streams.is_on(OPTICAL_FLOW_RAD_DATA::ID) => {
                self.writer.write(&flow.encode(time, &self.felt.newest_rate()));
            }
            Measured::Distance(distance) if self.streams.is_on(DISTANCE_SENSOR_DATA::ID) => {
                self.writer.write(&distance.encode(time));
            }
            Measured::Flow(_) | Measured::Distance(_) => {}
        }
    }

    /// Puts the origin of the local frame `moved` off the datum, ENU, m, and tells so.
    pub fn move_origin(&mut self, moved: Vector3<f64>) {
        if self.moved != moved {
            self.moved = moved;
            self.origin = self.datum.to_geodetic(&moved);
            self.local = LocalFrame::new(&self.datum, &self.origin);
            self.streams.hurry(GPS_GLOBAL_ORIGIN_DATA::ID);
        }
    }

    /// Counts the time since it was switched on from `now`.
    pub fn restart_clock(&mut self, now: Duration) {
        self.booted = now;
    }

    /// Tells all stations a line, cut at 50 bytes.
    pub fn text(&mut self, severity: Severity, text: &str) {
        let mut end = text.len().min(50);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        self.writer.write(&STATUSTEXT_DATA {
            severity: severity.into(),
            text: CharArray::from(text.get(..end).unwrap_or_default()),
            ..Default::default()
        });
    }

    /// Tells all stations that a mission item has been reached.
    pub fn item_reached(&mut self, seq: u16) {
        self.writer.write(&MISSION_ITEM_REACHED_DATA { seq });
    }

    pub fn parameters(&self) -> &ParameterTable {
        &self.parameters.table
    }

    pub fn mission(&self) -> &[MissionItem] {
        self.missions.items()
    }

    /// The zones to stay inside and outside of, as a station uploaded them.
    pub fn fence(&self) -> &[MissionItem] {
        self.missions.fence()
    }

    /// The places to return to.
    pub fn rally_points(&self) -> &[MissionItem] {
        self.missions.rally_points()
    }

    /// Takes the bytes to be sent to every station. They are whole frames.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.writer.take()
    }

    /// Bytes skipped so far because they belonged to no intact frame.
    pub fn bad_bytes(&self) -> u64 {
        self.reader.bad_bytes()
    }

    fn handle(&mut self, now: Duration, frame: &Frame) {
        let from = frame.sender;
        let output = &mut self.writer;
        match &frame.message {
            MavMessage::COMMAND_LONG(message) => self.on_call(now, Call::from_long(from, message)),
            MavMessage::COMMAND_INT(message) => self.on_call(now, Call::from_int(from, message)),
            MavMessage::SET_MODE(message) => self.on_set_mode(from, message),
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(message) => {
                if let Some(set_point) = SetPoint::decode(message, &self.local) {
                    self.push(Request::SetPoint { set_point, from });
                }
            }
            MavMessage::ODOMETRY(message) => {
                if let Some(external) = External::read(message, &self.local) {
                    self.push(Request::External(Box::new(external)));
                }
            }
            MavMessage::MANUAL_CONTROL(message) => self.on_sticks(message),
            MavMessage::PING(message) => output.write(&PING_DATA {
                target_system: from.system_id,
                target_component: from.component_id,
                ..*message
            }),
            MavMessage::LOG_REQUEST_LIST(_) => output.write(&LOG_ENTRY_DATA::default()),
            MavMessage::TIMESYNC(message) if message.tc1 == 0 => {
                let its = now.saturating_sub(self.booted);
                output.write(&TIMESYNC_DATA { tc1: its.as_nanos() as i64, ..*message });
            }
            MavMessage::PARAM_REQUEST_LIST(_) => self.parameters.begin_list(),
            MavMessage::PARAM_REQUEST_READ(message) => self.parameters.read(message, output),
            MavMessage::PARAM_SET(message) => self.on_parameter_set(message),
            MavMessage::MISSION_REQUEST_LIST(message) => {
                self.missions.on_list(from, message.mission_type, output);
            }
            MavMessage::MISSION_REQUEST_INT(MISSION_REQUEST_INT_DATA { mission_type, seq, .. })
            | MavMessage::MISSION_REQUEST(MISSION_REQUEST_DATA { mission_type, seq, .. }) => {
                self.missions.on_request(from, *mission_type, *seq, output);
            }
            MavMessage::MISSION_COUNT(message) => {
                let changed = self.missions.on_count(now, from, message, output);
                self.push_mission_change(changed);
            }
            MavMessage::MISSION_ITEM_INT(message) => {
                let changed = self.missions.on_item(now, from, message, output);
                self.push_mission_change(changed);
            }
            MavMessage::MISSION_ITEM(message) => {
                let changed = self.missions.on_item(now, from, &whole(message), output);
                self.push_mission_change(changed);
            }
            MavMessage::MISSION_CLEAR_ALL(message) => {
                let changed = self.missions.on_clear(from, message.mission_type, output);
                self.push_mission_change(changed);
            }
            MavMessage::MISSION_ACK(message) => self.missions.on_ack(from, message),
            MavMessage::MISSION_SET_CURRENT(message) => {
                self.push_unacknowledged(from, AutopilotCommand::SetMissionItem(message.seq));
            }
            _ => {}
        }
    }

    fn push(&mut self, request: Request) {
        if self.requests.len() < MAX_REQUESTS {
            self.requests.push_back(request);
        }
    }

    fn push_mission_change(&mut self, changed: Option<Changed>) {
        match changed {
            None => {}
            Some(Changed::Mission) => self.push(Request::MissionChanged),
            Some(Changed::Places) => self.push(Request::PlacesChanged),
            Some(Changed::All) => {
                self.push(Request::MissionChanged);
                self.push(Request::PlacesChanged);
            }
        }
    }

    fn push_unacknowledged(&mut self, from: Address, command: AutopilotCommand) {
        let ticket = Ticket { from, command: MavCmd::MAV_CMD_DO_SET_MODE, acknowledged: false };
        self.push(Request::Command { ticket, command, from });
    }

    fn on_call(&mut self, now: Duration, call: Call) {
        match self.remembered.note(now, &call) {
            Novelty::Repetition(None) => return,
            Novelty::Repetition(Some(result)) => {
                self.acknowledge(call.from, call.command, result);
                return;
            }
            Novelty::New => {}
        }
        if let Some(result) = self.housekeeping(now, &call) {
            self.remembered.settle(call.from, call.command, result);
            self.acknowledge(call.from, call.command, result);
            return;
        }
        let home_z_m = self.reported.and_then(|reported| reported.home).map_or(0.0, |home| home.z);
        let ticket = Ticket { from: call.from, command: call.command, acknowledged: true };
        match call.meaning(&self.datum, home_z_m) {
            Ok(command) => self.push(Request::Command { ticket, command, from: call.from }),
            Err(result) => self.answer(ticket, result),
        }
    }

    /// Deals with the commands that do not concern flying; `None` for all others.
    fn housekeeping(&mut self, now: Duration, call: &Call) -> Option<CommandResult> {
        let [p1, p2, ..] = call.params;
        let message_id = p1 as u32;
        let done = match call.command {
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                self.streams.wish(now, call.from, message_id, Rate::from_interval_us(p2))
            }
            MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL => {
                self.writer.write(&MESSAGE_INTERVAL_DATA {
                    interval_us: self.streams.interval_us(message_id),
                    message_id: message_id as u16,
                });
                true
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE if message_id == PROTOCOL_VERSION_DATA::ID => {
                self.send_protocol_version()
            }
            MavCmd::MAV_CMD_REQUEST_PROTOCOL_VERSION => self.send_protocol_version(),
            MavCmd::MAV_CMD_REQUEST_MESSAGE => self.ask_once(message_id),
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => self.ask_once(AUTOPILOT_VERSION_DATA::ID),
            MavCmd::MAV_CMD_GET_HOME_POSITION => self.ask_once(HOME_POSITION_DATA::ID),
            _ => return None,
        };
        Some(if done { CommandResult::Accepted } else { CommandResult::Unsupported })
    }

    /// Has a message sent with the next report. Returns whether there is such a message.
    fn ask_once(&mut self, message_id: u32) -> bool {
        let known = self.streams.contains(message_id);
        if known && !self.asked_once.contains(&message_id) {
            self.asked_once.push(message_id);
        }
        known
    }

    fn send_protocol_version(&mut self) -> bool {
        self.writer.write(&PROTOCOL_VERSION_DATA {
            version: 200,
            min_version: 100,
            max_version: 200,
            ..Default::default()
        });
        true
    }

    fn acknowledge(&mut self, to: Address, command: MavCmd, result: CommandResult) {
        self.writer.write(&COMMAND_ACK_DATA {
            command,
            result: result.to_ack(),
            target_system: to.system_id,
            target_component: to.component_id,
            ..Default::default()
        });
    }

    fn on_set_mode(&mut self, from: Address, message: &SET_MODE_DATA) {
        let custom = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        let mode = px4::mode(message.custom_mode);
        if message.base_mode.contains(custom) && !matches!(mode, FlightMode::Other(_)) {
            self.push_unacknowledged(from, AutopilotCommand::SetMode(mode));
        }
    }

    fn on_sticks(&mut self, message: &MANUAL_CONTROL_DATA) {
        // An axis that is not there is i16::MAX; the throttle axis rests at 500 of 0..1000.
        let axis = |value: i16| match value {
            -1000..=1000 => f64::from(value) / 1000.0,
            _ => 0.0,
        };
        let up = if (0..=1000).contains(&message.z) { f64::from(message.z) / 500.0 - 1.0 } else { 0.0 };
        self.push(Request::Sticks {
            forward: axis(message.x),
            left: -axis(message.y),
            up,
            turn_left: -axis(message.r),
        });
    }

    fn on_parameter_set(&mut self, message: &PARAM_SET_DATA) {
        match self.parameters.set(message, &mut self.writer) {
            Ok(name) => self.push(Request::ParameterChanged { name }),
            Err(error) => self.text(Severity::Warning, &error.to_string()),
        }
    }

    fn hurry_changes(&mut self, state: &VehicleState) {
        let current = Reported::of(state);
        if self.reported == Some(current) {
            return;
        }
        if let Some(last) = self.reported.replace(current) {
            let heart = |it: &Reported| (it.mode, it.armed, it.failsafe);
            if heart(&last) != heart(&current) {
                self.streams.hurry(HEARTBEAT_DATA::ID);
            }
            if last.landed != current.landed {
                self.streams.hurry(EXTENDED_SYS_STATE_DATA::ID);
            }
            if last.home != current.home {
                self.streams.hurry(HOME_POSITION_DATA::ID);
            }
            if last.mission_item != current.mission_item {
                self.streams.hurry(MISSION_CURRENT_DATA::ID);
            }
        }
    }
}
