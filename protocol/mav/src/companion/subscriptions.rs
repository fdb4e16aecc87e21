//! Subscriptions: the messages the companion lives on, asked for until they come and asked for again when
//! they stop (an autopilot that restarted has forgotten; ArduPilot sends nothing unasked).

use std::time::Duration;

use mavlink::MessageData;
use mavlink::dialects::common::{
    ATTITUDE_QUATERNION_DATA, BATTERY_STATUS_DATA, COMMAND_LONG_DATA, DISTANCE_SENSOR_DATA,
    ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GPS_GLOBAL_ORIGIN_DATA, GPS_RAW_INT_DATA, HEARTBEAT_DATA,
    HIGHRES_IMU_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MavCmd, OPTICAL_FLOW_RAD_DATA,
    SYS_STATUS_DATA,
};

/// A message that is missing is asked for this often at most.
const ASK_AGAIN: Duration = Duration::from_secs(1);

/// Rate at which a message is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wish {
    /// As a stream with this interval.
    Every(Duration),
    /// One at a time, at this interval: the autopilot refuses to send it as a stream.
    Singly(Duration),
    /// As a stream with this interval, from an autopilot that may not have it at all.
    IfItHas(Duration),
    /// Once; the autopilot repeats it by itself when it changes.
    Once,
}

#[derive(Debug, Clone)]
struct Subscription {
    message_id: u32,
    wish: Wish,
    seen_at: Option<Duration>,
    asked_at: Option<Duration>,
}

/// All the messages wanted.
#[derive(Debug, Clone)]
pub(super) struct Subscriptions {
    list: Vec<Subscription>,
    with_measured: bool,
}

impl Subscriptions {
    /// With or without what instruments measure.
    pub(super) fn new(with_measured: bool) -> Self {
        let every = |message_id, interval_ms| (message_id, Wish::Every(Duration::from_millis(interval_ms)));
        let wishes = [
            // A pilot's mode change is to be known at once, not with the next second.
            every(HEARTBEAT_DATA::ID, 100),
            every(LOCAL_POSITION_NED_DATA::ID, 20),
            every(ATTITUDE_QUATERNION_DATA::ID, 20),
            (GPS_GLOBAL_ORIGIN_DATA::ID, Wish::Once),
            (HOME_POSITION_DATA::ID, Wish::Once),
            every(EXTENDED_SYS_STATE_DATA::ID, 200),
            every(SYS_STATUS_DATA::ID, 500),
            every(ESTIMATOR_STATUS_DATA::ID, 200),
            every(GPS_RAW_INT_DATA::ID, 200),
            every(BATTERY_STATUS_DATA::ID, 1000),
        ];
        let if_it_has =
            |message_id, interval_ms| (message_id, Wish::IfItHas(Duration::from_millis(interval_ms)));
        let measured = [
            if_it_has(HIGHRES_IMU_DATA::ID, 8),
            if_it_has(OPTICAL_FLOW_RAD_DATA::ID, 20),
            if_it_has(DISTANCE_SENSOR_DATA::ID, 40),
        ];
        let measured = measured.into_iter().filter(|_| with_measured);
        let list = wishes.into_iter().chain(measured).map(|(message_id, wish)| Subscription {
            message_id,
            wish,
            seen_at: None,
            asked_at: None,
        });
        Self { list: list.collect(), with_measured }
    }

    /// A message of this kind arrived.
    pub(super) fn seen(&mut self, now: Duration, message_id: u32) {
        if let Some(known) = self.list.iter_mut().find(|known| known.message_id == message_id) {
            known.seen_at = Some(now);
        }
    }

    /// The autopilot refused what was asked about this message: the other way is tried.
    pub(super) fn refused(&mut self, message_id: u32) {
        let Some(known) = self.list.iter_mut().find(|known| known.message_id == message_id) else { return };
        known.wish = match known.wish {
            Wish::Every(interval) => Wish::Singly(interval),
            Wish::Singly(interval) => Wish::Every(interval),
            wish @ (Wish::IfItHas(_) | Wish::Once) => wish,
        };
    }

    /// Everything is to be asked for anew.
    pub(super) fn forget(&mut self) {
        *self = Self::new(self.with_measured);
    }

    /// The message that is overdue, and the command that asks for it: of several, the one not asked for the
    /// longest, so that each gets its turn even if an autopilot never answers about one of them. Streams are
    /// all asked for once, because the autopilot may already send them at another rate. `estimator_message` is
    /// what this make sends for `ESTIMATOR_STATUS`.
    pub(super) fn next_request(
        &mut self,
        now: Duration,
        estimator_message: u32,
    ) -> Option<(u32, COMMAND_LONG_DATA)> {
        let overdue =
            self.list.iter_mut().filter(|known| known.is_overdue(now)).min_by_key(|known| known.asked_at)?;
        overdue.asked_at = Some(now);
        // Message ids are below 2^24 and intervals below 2^24 us, so both are exact as floats.
        let param1 = match overdue.message_id {
            ESTIMATOR_STATUS_DATA::ID => estimator_message,
            id => id,
        } as f32;
        let request = match overdue.wish {
            Wish::Every(interval) | Wish::IfItHas(interval) => COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
                param1,
                param2: interval.as_micros() as f32,
                ..Default::default()
            },
            Wish::Singly(_) | Wish::Once => {
                COMMAND_LONG_DATA { command: MavCmd::MAV_CMD_REQUEST_MESSAGE, param1, ..Default::default() }
            }
        };
        Some((overdue.message_id, request))
    }
}

impl Subscription {
    fn is_overdue(&self, now: Duration) -> bool {
        let since = |at: Option<Duration>| at.map(|at| now.saturating_sub(at));
        if let Wish::Singly(interval) = self.wish {
            return [self.asked_at, self.seen_at]
                .into_iter()
                .all(|at| since(at).is_none_or(|age| age >= interval));
        }
        if since(self.asked_at).is_some_and(|age| age < ASK_AGAIN) {
            return false;
        }
        match (self.wish, since(self.seen_at)) {
            (_, None) => true,
            (Wish::Once, Some(_)) => false,
            (Wish::Every(interval) | Wish::Singly(interval) | Wish::IfItHas(interval), Some(age)) => {
                self.asked_at.is_none() || age > ASK_AGAIN + 3 * interval
            }
        }
    }
}
