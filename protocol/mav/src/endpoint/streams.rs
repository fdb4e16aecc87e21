//! Which messages an autopilot sends by itself, and how often.

use std::time::Duration;

use mavlink::MessageData;
use mavlink::dialects::common::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA,
    DISTANCE_SENSOR_DATA, ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA,
    GPS_GLOBAL_ORIGIN_DATA, GPS_RAW_INT_DATA, HEARTBEAT_DATA, HIGHRES_IMU_DATA, HOME_POSITION_DATA,
    LOCAL_POSITION_NED_DATA, MISSION_CURRENT_DATA, OPTICAL_FLOW_RAD_DATA, SYS_STATUS_DATA, VFR_HUD_DATA,
};

use crate::address::Address;

/// Shortest interval granted.
const MIN_INTERVAL: Duration = Duration::from_millis(4);
/// Interval of a stream that is off.
const OFF: Duration = Duration::MAX;
/// Stations that may have wishes about one stream; the wish of a further one replaces the slowest.
const MAX_WISHES: usize = 8;

/// The rate that a station asks of a stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rate {
    /// As the autopilot likes.
    Default,
    /// Not at all.
    Off,
    /// Once per interval.
    Every(Duration),
}

impl Rate {
    /// From parameter 2 of `MAV_CMD_SET_MESSAGE_INTERVAL`: microseconds, 0 for the default, -1 for none.
    pub(super) fn from_interval_us(interval_us: f64) -> Self {
        if interval_us < 0.0 {
            Self::Off
        } else if interval_us > 0.0 {
            Self::Every(Duration::from_micros(interval_us as u64))
        } else {
            Self::Default
        }
    }
}

/// One message the autopilot can send.
#[derive(Debug, Clone)]
struct Stream {
    message_id: u32,
    default: Duration,
    wishes: Vec<(Address, Duration)>,
    due: Duration,
}

impl Stream {
    /// The shortest interval any station asked for. So a slow ground station never slows a companion down.
    fn interval(&self) -> Duration {
        let wishes = self.wishes.iter().map(|(_, interval)| *interval);
        wishes.min().unwrap_or(self.default)
    }
}

/// The streams of one autopilot.
#[derive(Debug, Clone)]
pub(super) struct Streams {
    list: Vec<Stream>,
    /// The earliest `due` of all, so that nothing is searched at most steps.
    next_due: Duration,
}

impl Default for Streams {
    fn default() -> Self {
        let ms = Duration::from_millis;
        let defaults = [
            (HEARTBEAT_DATA::ID, ms(1000)),
            (LOCAL_POSITION_NED_DATA::ID, ms(20)),
            (ATTITUDE_QUATERNION_DATA::ID, ms(20)),
            (ATTITUDE_DATA::ID, ms(100)),
            (GLOBAL_POSITION_INT_DATA::ID, ms(200)),
            (EXTENDED_SYS_STATE_DATA::ID, ms(200)),
            (VFR_HUD_DATA::ID, ms(250)),
            (SYS_STATUS_DATA::ID, ms(500)),
            (BATTERY_STATUS_DATA::ID, ms(1000)),
            (GPS_RAW_INT_DATA::ID, ms(1000)),
            (GPS_GLOBAL_ORIGIN_DATA::ID, ms(1000)),
            (MISSION_CURRENT_DATA::ID, ms(1000)),
            (HOME_POSITION_DATA::ID, ms(2000)),
            (ESTIMATOR_STATUS_DATA::ID, ms(1000)),
            (AUTOPILOT_VERSION_DATA::ID, OFF),
            (HIGHRES_IMU_DATA::ID, OFF),
            (OPTICAL_FLOW_RAD_DATA::ID, OFF),
            (DISTANCE_SENSOR_DATA::ID, OFF),
        ];
        let list = defaults.map(|(message_id, default)| Stream {
            message_id,
            default,
            wishes: Vec::new(),
            due: if default == OFF { OFF } else { Duration::ZERO },
        });
        Self { list: list.into(), next_due: Duration::ZERO }
    }
}

impl Streams {
    /// Whether the autopilot can send this message.
    pub(super) fn contains(&self, message_id: u32) -> bool {
        self.list.iter().any(|stream| stream.message_id == message_id)
    }

    /// Whether anybody wants it regularly.
    pub(super) fn is_on(&self, message_id: u32) -> bool {
        self.list.iter().any(|stream| stream.message_id == message_id && stream.interval() != OFF)
    }

    /// The interval of a stream in microseconds as `MESSAGE_INTERVAL` reports it: -1 for off, 0 for unknown.
    pub(super) fn interval_us(&self, message_id: u32) -> i32 {
        let known = self.list.iter().find(|stream| stream.message_id == message_id);
        match known.map(Stream::interval) {
            None => 0,
            Some(OFF) => -1,
            Some(interval) => interval.as_micros() as i32,
        }
    }

    /// Takes a station's wish. Returns whether there is such a stream.
    pub(super) fn wish(&mut self, now: Duration, from: Address, message_id: u32, rate: Rate) -> bool {
        let Some(stream) = self.list.iter_mut().find(|stream| stream.message_id == message_id) else {
            return false;
        };
        let wished = match rate {
            Rate::Default => None,
            Rate::Off => Some((from, OFF)),
            Rate::Every(interval) => Some((from, interval.max(MIN_INTERVAL))),
        };
        if wished.is_some_and(|wish| stream.wishes.contains(&wish)) {
            // Whoever repeats a wish puts nothing off.
            return true;
        }
        stream.wishes.retain(|(station, _)| *station != from);
        if stream.wishes.len() == MAX_WISHES {
            // The slowest gives way: it is served by the faster ones as well.
            let slowest = (0..MAX_WISHES).max_by_key(|index| stream.wishes[*index].1).unwrap_or(0);
            stream.wishes.remove(slowest);
        }
        stream.wishes.extend(wished);
        stream.due = now.saturating_add(stream.interval());
        self.next_due = self.next_due.min(stream.due);
        true
    }

    /// Makes a message due at once.
    pub(super) fn hurry(&mut self, message_id: u32) {
        if let Some(stream) = self.list.iter_mut().find(|stream| stream.message_id == message_id) {
            stream.due = Duration::ZERO;
            self.next_due = Duration::ZERO;
        }
    }

    /// Calls `send` for each message that is due.
    pub(super) fn for_each_due(&mut self, now: Duration, mut send: impl FnMut(u32)) {
        if now < self.next_due {
            return;
        }
        for stream in &mut self.list {
            if now >= stream.due {
                send(stream.message_id);
                let interval = stream.interval();
                let on_time = stream.due.saturating_add(interval);
                // After a pause, or when hurried, the rhythm starts anew.
                stream.due = if on_time > now { on_time } else { now.saturating_add(interval) };
            }
        }
        self.next_due = self.list.iter().map(|stream| stream.due).min().unwrap_or(OFF);
    }
}
