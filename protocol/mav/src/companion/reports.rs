//! Telemetry from the messages that an autopilot sends to everyone.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use mavlink::dialects::common::{
    ATTITUDE_QUATERNION_DATA, BATTERY_STATUS_DATA, ESTIMATOR_STATUS_DATA, EVENT_DATA, EstimatorStatusFlags,
    GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA,
    MavLandedState, MavMessage, MavModeFlag, MavState, MavSysStatusSensor, SYS_STATUS_DATA,
};
use nalgebra::{Quaternion, UnitQuaternion};

use super::clock::{Clock, Stamp};
use crate::axes;
use crate::dialect::Dialect;
use crate::dialects;
use crate::event::MavEvent;
use crate::geodesy::{Datum, Geodetic, LocalFrame};
use crate::telemetry::{Battery, HEARTBEAT_TIMEOUT, Landed, Severity, Stamped, Telemetry, Text};

/// Standard deviation of the position of an estimator that says that it has none, m.
const NOWHERE_SIGMA_M: f64 = 100.0;

/// The telemetry, and what is needed to read the next message.
#[derive(Debug, Clone)]
pub(super) struct Reports {
    pub(super) telemetry: Telemetry,
    pub(super) dialect: &'static dyn Dialect,
    pub(super) clock: Clock,
    datum: Datum,
    /// Whether its estimator, which knows no accuracy of its own, stands by its position; `None` of one that knows.
    stands_by: Option<bool>,
    /// Follows from `telemetry.local_origin`.
    local: Option<LocalFrame>,
    batteries: Batteries,
}

impl Reports {
    pub(super) fn new(datum: Datum) -> Self {
        Self {
            telemetry: Telemetry::default(),
            dialect: dialects::UNKNOWN,
            clock: Clock::default(),
            datum,
            stands_by: None,
            local: None,
            batteries: Batteries::default(),
        }
    }

    /// The autopilot's local frame, once it has told its origin.
    pub(super) fn local_frame(&self) -> Option<&LocalFrame> {
        self.local.as_ref()
    }

    /// Takes in a message; what it changes at once is added to the events.
    pub(super) fn hear(&mut self, now: Duration, message: &MavMessage, events: &mut VecDeque<MavEvent>) {
        let telemetry = &mut self.telemetry;
        match message {
            MavMessage::HEARTBEAT(message) => self.on_heartbeat(now, message, events),
            MavMessage::LOCAL_POSITION_NED(message) => self.on_local_position(now, message),
            MavMessage::ATTITUDE_QUATERNION(message) => self.on_attitude(now, message),
            MavMessage::ESTIMATOR_STATUS(message) => self.on_estimator(now, message),
            MavMessage::GPS_RAW_INT(message) => self.on_gps(now, message),
            MavMessage::GPS_GLOBAL_ORIGIN(message) => {
                self.on_origin(Geodetic::from_e7(message.latitude, message.longitude, message.altitude));
            }
            MavMessage::HOME_POSITION(message) => self.on_home(message),
            MavMessage::EXTENDED_SYS_STATE(message) => {
                telemetry.landed = match message.landed_state {
                    MavLandedState::MAV_LANDED_STATE_UNDEFINED => Landed::Unknown,
                    MavLandedState::MAV_LANDED_STATE_ON_GROUND => Landed::OnGround,
                    MavLandedState::MAV_LANDED_STATE_IN_AIR => Landed::InAir,
                    MavLandedState::MAV_LANDED_STATE_TAKEOFF => Landed::TakingOff,
                    MavLandedState::MAV_LANDED_STATE_LANDING => Landed::Landing,
                };
            }
            MavMessage::SYS_STATUS(message) => self.on_system_status(message),
            MavMessage::BATTERY_STATUS(message) => {
                self.batteries.hear(now, message);
                telemetry.battery = self.batteries.worst();
            }
            MavMessage::STATUSTEXT(message) => {
                let text = message.text.to_str().unwrap_or_default().to_owned();
                self.on_text(now, Text { severity: Severity::from(message.severity), text }, events);
            }
            MavMessage::EVENT(message) => self.on_text(now, event_text(message), events),
            _ => {}
        }
    }

    /// Counts the autopilot as lost if its heartbeats have just stayed away for too long.
    pub(super) fn end_without_heartbeat(&mut self, now: Duration) -> bool {
        let telemetry = &mut self.telemetry;
        let silent =
            telemetry.last_heartbeat.is_some_and(|last| now.saturating_sub(last) > HEARTBEAT_TIMEOUT);
        silent && std::mem::take(&mut telemetry.connected)
    }

    fn on_heartbeat(&mut self, now: Duration, message: &HEARTBEAT_DATA, events: &mut VecDeque<MavEvent>) {
        let telemetry = &mut self.telemetry;
        self.dialect = dialects::of(message);
        let first = telemetry.last_heartbeat.replace(now).is_none();
        if !std::mem::replace(&mut telemetry.connected, true) {
            events.push_back(MavEvent::HeartbeatRegained);
            if !telemetry.armed {
                // Its power may have been off, for other batteries.
                self.batteries = Batteries::default();
            }
        }
        let mode = self.dialect.mode(message.custom_mode);
        let from = std::mem::replace(&mut telemetry.mode, mode);
        if from != mode && !first {
            events.push_back(MavEvent::ModeChanged { from, to: mode });
        }
        let armed = message.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
        if std::mem::replace(&mut telemetry.armed, armed) != armed {
            events.push_back(MavEvent::ArmedChanged { armed });
        }
        telemetry.failsafe =
            matches!(message.system_status, MavState::MAV_STATE_CRITICAL | MavState::MAV_STATE_EMERGENCY);
        if message.system_status == MavState::MAV_STATE_BOOT {
            telemetry.ready_to_arm = false;
        }
    }

    fn on_local_position(&mut self, now: Duration, message: &LOCAL_POSITION_NED_DATA) {
        let position = axes::vector(message.x, message.y, message.z);
        let velocity = axes::vector(message.vx, message.vy, message.vz);
        if !position.iter().chain(velocity.iter()).all(|number| number.is_finite()) {
            return;
        }
        let time = Duration::from_millis(message.time_boot_ms.into());
        let velocity = axes::ned_to_enu(&velocity);
        let position = self.local.as_ref().map(|local| local.position_to_world(&position));
        let telemetry = &mut self.telemetry;
        match self.clock.stamp(now, time) {
            Stamp::Overtaken => return,
            // Said again, it is as old as it was. Of a clock that stands the values tell.
            Stamp::Same
                if telemetry.velocity.map(|known| known.value) == Some(velocity)
                    && telemetry.position.map(|known| known.value) == position
                    && time > Duration::ZERO =>
            {
                return;
            }
            Stamp::Restarted => telemetry.restarts += 1,
            Stamp::Same | Stamp::Newer => {}
        }
        telemetry.velocity = Some(Stamped { stamp: now, value: velocity });
        if let Some(value) = position {
            telemetry.position = Some(Stamped { stamp: now, value });
            telemetry.position_time = Some(time);
            telemetry.position_age = self.clock.age(now, time);
        }
    }

    /// An estimator tells its accuracy, or whether it stands by its position: then the receiver's accuracy counts.
    fn on_estimator(&mut self, now: Duration, message: &ESTIMATOR_STATUS_DATA) {
        let told = [message.pos_horiz_accuracy, message.pos_vert_accuracy].map(f64::from);
        if told.iter().all(|sigma_m| sigma_m.is_finite() && *sigma_m > 0.0) {
            self.stands_by = None;
            self.telemetry.position_sigma_m = Some(Stamped { stamp: now, value: told });
            return;
        }
        // Ratios of innovations to what they may be.
        let ratios = [message.vel_ratio, message.pos_horiz_ratio, message.pos_vert_ratio];
        let stands_by = message.flags.contains(EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_ABS)
            && !message.flags.contains(EstimatorStatusFlags::ESTIMATOR_CONST_POS_MODE)
            && ratios.iter().all(|ratio| *ratio <= 1.0);
        if !stands_by {
            self.telemetry.position_sigma_m = Some(Stamped { stamp: now, value: [NOWHERE_SIGMA_M; 2] });
        }
        self.stands_by = Some(stands_by);
    }

    fn on_gps(&mut self, now: Duration, message: &GPS_RAW_INT_DATA) {
        let none = [GpsFixType::GPS_FIX_TYPE_NO_GPS, GpsFixType::GPS_FIX_TYPE_NO_FIX];
        let has_fix =
            !none.contains(&message.fix_type) && message.fix_type != GpsFixType::GPS_FIX_TYPE_2D_FIX;
        self.telemetry.has_gps_fix = Some(has_fix);
        // 0 is unknown.
        if self.stands_by == Some(true) && has_fix && message.h_acc > 0 && message.v_acc > 0 {
            let value = [message.h_acc, message.v_acc].map(|millimetres| f64::from(millimetres) / 1000.0);
            self.telemetry.position_sigma_m = Some(Stamped { stamp: now, value });
        }
    }

    fn on_attitude(&mut self, now: Duration, message: &ATTITUDE_QUATERNION_DATA) {
        let [w, x, y, z] = [message.q1, message.q2, message.q3, message.q4].map(f64::from);
        let rate = axes::vector(message.rollspeed, message.pitchspeed, message.yawspeed);
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
            self.local = Some(LocalFrame::new(&self.datum, &origin));
        }
    }

    fn on_home(&mut self, message: &HOME_POSITION_DATA) {
        let home = Geodetic::from_e7(message.latitude, message.longitude, message.altitude);
        self.telemetry.home = Some(self.datum.to_enu(&home));
        self.telemetry.home_height_m = Some(home.height_m);
    }

    /// The pre-arm bit tells whether the vehicle is ready to arm. PX4 has it from 1.13; an older one is ready
    /// when its sensors are healthy.
    fn on_system_status(&mut self, message: &SYS_STATUS_DATA) {
        let pre_arm = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled;
        let healthy = message.onboard_control_sensors_health;
        self.telemetry.sensors_ok = healthy.contains(used - pre_arm);
        self.telemetry.ready_to_arm =
            if used.contains(pre_arm) { healthy.contains(pre_arm) } else { self.telemetry.sensors_ok };
    }

    fn on_text(&mut self, now: Duration, text: Text, events: &mut VecDeque<MavEvent>) {
        let texts = &mut self.telemetry.texts;
        if texts.len() == Telemetry::MAX_TEXTS {
            texts.pop_front();
        }
        texts.push_back(Stamped { stamp: now, value: text.clone() });
        events.push_back(MavEvent::Text(text));
    }
}

/// A PX4 event as a line: the words that belong to its number are in the firmware's metadata.
fn event_text(message: &EVENT_DATA) -> Text {
    let severity = Severity::of_level(message.log_levels & 0x0f);
    let arguments = message.arguments;
    let len = arguments.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let hex: String = arguments.iter().take(len).map(|byte| format!(" {byte:02x}")).collect();
    Text { severity, text: format!("event {}{}{hex}", message.id, if len > 0 { ", arguments" } else { "" }) }
}

/// The batteries that have told their charge, each by its id with the newest one.
#[derive(Debug, Clone, Default)]
struct Batteries(BTreeMap<u8, Stamped<Battery>>);

impl Batteries {
    fn hear(&mut self, now: Duration, message: &BATTERY_STATUS_DATA) {
        if let Some(value) = battery(message) {
            self.0.insert(message.id, Stamped { stamp: now, value });
        }
    }

    /// The one with the least charge, as of when each was known to have that much.
    fn worst(&self) -> Option<Stamped<Battery>> {
        let stamp = self.0.values().map(|battery| battery.stamp).min()?;
        let least = self.0.values().min_by(|a, b| a.value.fraction.total_cmp(&b.value.fraction))?;
        Some(Stamped { stamp, value: least.value })
    }
}

/// The battery, if its charge is known.
fn battery(message: &BATTERY_STATUS_DATA) -> Option<Battery> {
    // u16::MAX marks a cell that is not there, -1 an unknown charge.
    let cells = message.voltages.iter().filter(|cell| **cell != u16::MAX);
    let millivolts: u32 = cells.map(|cell| u32::from(*cell)).sum();
    (0..=100).contains(&message.battery_remaining).then(|| Battery {
        fraction: f64::from(message.battery_remaining) / 100.0,
        voltage_v: f64::from(millivolts) / 1000.0,
    })
}
