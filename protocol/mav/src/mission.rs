//! Missions: the list of items an autopilot flies by itself or a ground station shows, and the transfer of
//! such a list in either direction (`MISSION_COUNT`, `MISSION_REQUEST_INT`, `MISSION_ITEM_INT`,
//! `MISSION_ACK`).
//!
//! A transfer has two roles, whichever end asked for it: one end announces and sends the items, the other
//! asks for each in turn. Both ends of this crate use the same two state machines, which repeat themselves
//! until answered, so that a transfer survives loss in either direction.

use std::time::Duration;

use mavlink::dialects::common::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA,
    MISSION_REQUEST_LIST_DATA, MavCmd, MavFrame, MavMissionResult, MavMissionType,
};
use nalgebra::{Vector2, Vector3};

use crate::address::Address;
use crate::frame::FrameWriter;
use crate::geodesy::{Datum, Geodetic};
use crate::patience::{Patience, Retry, Turn};

const RETRY: Retry = Retry { every: Duration::from_millis(250), times: 12 };
/// Longest mission that is taken in, items. A longer one is refused, so that no peer can fill the memory.
pub const MAX_ITEMS: u16 = 2000;

/// One item of a mission, in MAVLink's own terms so that what is read back is exactly what was sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissionItem {
    /// A waypoint is `MAV_CMD_NAV_WAYPOINT`.
    pub command: MavCmd,
    /// The meaning of `x`, `y`, `z`.
    pub frame: MavFrame,
    /// The command's parameters 1 to 4. For a waypoint: seconds to stay, acceptance radius in metres, pass-by
    /// radius, heading in degrees clockwise from north (NaN: any).
    pub params: [f32; 4],
    /// Parameter 5: latitude in 1e-7 degrees in a global frame.
    pub x: i32,
    /// Parameter 6: longitude in 1e-7 degrees in a global frame.
    pub y: i32,
    /// Parameter 7: height in metres, above home or above mean sea level as the frame says.
    pub z: f32,
    /// Whether the next item follows by itself.
    pub autocontinue: bool,
}

impl MissionItem {
    /// A waypoint at a world position (ENU, metres), with its height given absolutely, where to stay `hold_s`
    /// seconds.
    pub fn waypoint(datum: &Datum, position: &Vector3<f64>, hold_s: f32) -> Self {
        let place = datum.to_geodetic(position);
        Self {
            command: MavCmd::MAV_CMD_NAV_WAYPOINT,
            frame: MavFrame::MAV_FRAME_GLOBAL_INT,
            params: [hold_s, 0.0, 0.0, f32::NAN],
            x: place.latitude_e7(),
            y: place.longitude_e7(),
            z: place.height_m as f32,
            autocontinue: true,
        }
    }

    /// World position (ENU, metres) of an item in a global frame; heights above home are added to
    /// `home_height_m` (metres in the vertical reference of the datum). `None` for other frames and for an
    /// item that gives no place (0, 0 by convention).
    pub fn position(&self, datum: &Datum, home_height_m: f64) -> Option<Vector3<f64>> {
        let base = match self.frame {
            MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT => 0.0,
            MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT => {
                home_height_m
            }
            _ => return None,
        };
        if (self.x == 0 && self.y == 0) || !self.z.is_finite() {
            return None;
        }
        let mut place = Geodetic::from_e7(self.x, self.y, 0);
        place.height_m = base + f64::from(self.z);
        Some(datum.to_enu(&place))
    }

    /// The place on the ground (ENU, metres) of an item in a global frame; `None` for other frames.
    pub fn ground(&self, datum: &Datum) -> Option<Vector2<f64>> {
        use MavFrame::{
            MAV_FRAME_GLOBAL, MAV_FRAME_GLOBAL_INT, MAV_FRAME_GLOBAL_RELATIVE_ALT,
            MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        };
        let is_global = matches!(
            self.frame,
            MAV_FRAME_GLOBAL
                | MAV_FRAME_GLOBAL_INT
                | MAV_FRAME_GLOBAL_RELATIVE_ALT
                | MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        );
        let mut place = Geodetic::from_e7(self.x, self.y, 0);
        place.height_m = datum.height_m;
        is_global.then(|| datum.to_enu(&place).xy())
    }

    pub(crate) fn to_message(self, seq: u16, target: Address, kind: MavMissionType) -> MISSION_ITEM_INT_DATA {
        let [param1, param2, param3, param4] = self.params;
        MISSION_ITEM_INT_DATA {
            param1,
            param2,
            param3,
            param4,
            x: self.x,
            y: self.y,
            z: self.z,
            seq,
            command: self.command,
            target_system: target.system_id,
            target_component: target.component_id,
            frame: self.frame,
            current: 0,
            autocontinue: u8::from(self.autocontinue),
            mission_type: kind,
        }
    }

    pub(crate) fn from_message(message: &MISSION_ITEM_INT_DATA) -> Self {
        Self {
            command: message.command,
            frame: message.frame,
            params: [message.param1, message.param2, message.param3, message.param4],
            x: message.x,
            y: message.y,
            z: message.z,
            autocontinue: message.autocontinue != 0,
        }
    }
}

/// Whether a list is one to fly. Fences and rally points come over the same messages.
pub(crate) fn is_mission(kind: MavMissionType) -> bool {
    kind == MavMissionType::MAV_MISSION_TYPE_MISSION
}

pub(crate) fn write_count(to: Address, kind: MavMissionType, count: u16, output: &mut FrameWriter) {
    output.write(&MISSION_COUNT_DATA {
        count,
        target_system: to.system_id,
        target_component: to.component_id,
        mission_type: kind,
        opaque_id: 0,
    });
}

pub(crate) fn write_ack(
    to: Address,
    kind: MavMissionType,
    result: MavMissionResult,
    output: &mut FrameWriter,
) {
    output.write(&MISSION_ACK_DATA {
        target_system: to.system_id,
        target_component: to.component_id,
        mavtype: result,
        mission_type: kind,
        ..Default::default()
    });
}

/// Why a transfer did not end well.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MissionError {
    /// The other end stopped answering.
    #[error("the other end stopped answering during the mission transfer: check the link and repeat it")]
    TimedOut,
    /// The other end refused.
    #[error("the other end refused the mission: {0:?}")]
    Refused(MavMissionResult),
    /// The list is longer than [`MAX_ITEMS`].
    #[error("the mission has {items} items, at most {MAX_ITEMS} are taken: split it")]
    TooLong { items: usize },
    /// Another transfer began before this one had ended.
    #[error("another mission transfer began before this one had ended")]
    Superseded,
}

/// A message of the sending role.
#[derive(Debug, PartialEq)]
pub(crate) enum SenderMessage {
    Count(u16),
    Item(u16, MissionItem),
}

impl SenderMessage {
    pub(crate) fn write(self, to: Address, output: &mut FrameWriter) {
        match self {
            Self::Count(count) => write_count(to, MavMissionType::MAV_MISSION_TYPE_MISSION, count, output),
            Self::Item(seq, item) => {
                output.write(&item.to_message(seq, to, MavMissionType::MAV_MISSION_TYPE_MISSION));
            }
        }
    }
}

/// The sending role of a transfer.
#[derive(Debug, Clone)]
pub(crate) struct MissionSender {
    items: Vec<MissionItem>,
    /// The item sent last; `None` while only the count has been announced.
    last_sent: Option<u16>,
    patience: Patience,
}

impl MissionSender {
    /// Begins: the caller sends the [`SenderMessage::Count`] of [`Self::repeat`].
    pub(crate) fn new(now: Duration, items: Vec<MissionItem>) -> Self {
        Self { items, last_sent: None, patience: RETRY.from(now) }
    }

    /// Answers a request for an item; `None` for one that does not exist.
    pub(crate) fn on_request(&mut self, now: Duration, seq: u16) -> Option<SenderMessage> {
        let item = *self.items.get(usize::from(seq))?;
        self.last_sent = Some(seq);
        self.patience = RETRY.from(now);
        Some(SenderMessage::Item(seq, item))
    }

    /// The message sent last.
    pub(crate) fn repeat(&self) -> SenderMessage {
        let item = |seq| self.items.get(usize::from(seq)).map(|item| (seq, *item));
        match self.last_sent.and_then(item) {
            Some((seq, item)) => SenderMessage::Item(seq, item),
            None => SenderMessage::Count(self.items.len() as u16),
        }
    }

    /// The message to repeat now, if any.
    ///
    /// # Errors
    /// When the other end is gone.
    pub(crate) fn tick(&mut self, now: Duration) -> Result<Option<SenderMessage>, MissionError> {
        Ok(is_overdue(&mut self.patience, now)?.then(|| self.repeat()))
    }
}

/// A message of the receiving role.
#[derive(Debug, PartialEq)]
pub(crate) enum ReceiverMessage {
    /// `MISSION_REQUEST_LIST`.
    List,
    /// `MISSION_REQUEST_INT`.
    Item(u16),
}

impl ReceiverMessage {
    pub(crate) fn write(self, to: Address, mission_type: MavMissionType, output: &mut FrameWriter) {
        let (target_system, target_component) = (to.system_id, to.component_id);
        match self {
            Self::List => {
                output.write(&MISSION_REQUEST_LIST_DATA { target_system, target_component, mission_type });
            }
            Self::Item(seq) => {
                output.write(&MISSION_REQUEST_INT_DATA { seq, target_system, target_component, mission_type })
            }
        }
    }
}

/// The receiving role of a transfer.
#[derive(Debug, Clone)]
pub(crate) struct MissionReceiver {
    /// Number of items; `None` until the other end has told it.
    count: Option<u16>,
    items: Vec<MissionItem>,
    patience: Patience,
}

impl MissionReceiver {
    /// Begins by asking for the list.
    pub(crate) fn new(now: Duration) -> Self {
        Self { count: None, items: Vec::new(), patience: RETRY.from(now) }
    }

    /// The number of items, announced by the sending role.
    pub(crate) fn on_count(&mut self, now: Duration, count: u16) -> Result<(), MissionError> {
        if count > MAX_ITEMS {
            return Err(MissionError::TooLong { items: usize::from(count) });
        }
        if self.count != Some(count) {
            self.count = Some(count);
            self.items.clear();
        }
        self.patience = RETRY.from(now);
        Ok(())
    }

    /// An item arrived. Returns whether it was the one asked for.
    pub(crate) fn on_item(&mut self, now: Duration, seq: u16, item: MissionItem) -> bool {
        if usize::from(seq) != self.items.len() || self.is_complete() || self.count.is_none() {
            return false;
        }
        self.items.push(item);
        self.patience = RETRY.from(now);
        true
    }

    /// Whether everything announced is here.
    pub(crate) fn is_complete(&self) -> bool {
        self.count.is_some_and(|count| self.items.len() == usize::from(count))
    }

    /// The items; sensible once complete.
    pub(crate) fn into_items(self) -> Vec<MissionItem> {
        self.items
    }

    /// The request for what is missing.
    pub(crate) fn request(&self) -> ReceiverMessage {
        match self.count {
            None => ReceiverMessage::List,
            Some(_) => ReceiverMessage::Item(self.items.len() as u16),
        }
    }

    /// The message to repeat now, if any.
    ///
    /// # Errors
    /// When the other end is gone.
    pub(crate) fn tick(&mut self, now: Duration) -> Result<Option<ReceiverMessage>, MissionError> {
        Ok(is_overdue(&mut self.patience, now)?.then(|| self.request()))
    }
}

fn is_overdue(patience: &mut Patience, now: Duration) -> Result<bool, MissionError> {
    match patience.turn(now) {
        Turn::Wait => Ok(false),
        Turn::Repeat => Ok(true),
        Turn::GiveUp => Err(MissionError::TimedOut),
    }
}
