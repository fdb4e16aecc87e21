//! The mission protocol at the autopilot's end: it keeps a mission, a geofence and rally points, hands them
//! out, and takes in new ones.

use std::time::Duration;

use mavlink::dialects::common::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_DATA, MISSION_ITEM_INT_DATA, MavFrame,
    MavMissionResult, MavMissionType,
};

use crate::address::Address;
use crate::frame::FrameWriter;
use crate::mission::{MissionItem, MissionReceiver, is_mission, write_ack, write_count};

/// The lists, and the transfer under way, if any: there is one at a time, so that nobody is told of a list
/// that another station changes meanwhile.
#[derive(Debug, Clone)]
pub(super) struct Missions {
    mission: Vec<MissionItem>,
    fence: Vec<MissionItem>,
    rally: Vec<MissionItem>,
    accepts: fn(&MissionItem) -> bool,
    accepts_fence: fn(&[MissionItem]) -> bool,
    accepts_rally: fn(&[MissionItem]) -> bool,
    upload: Option<Upload>,
    /// The last station that uploaded, and what. It repeats its last item if the acknowledgement was lost.
    last_uploader: Option<(Address, MavMissionType)>,
}

#[derive(Debug, Clone)]
struct Upload {
    from: Address,
    kind: MavMissionType,
    receiver: MissionReceiver,
}

/// The parts that have changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Changed {
    Mission,
    /// The geofence or the rally points.
    Places,
    All,
}

impl Missions {
    pub(super) fn new(
        accepts: fn(&MissionItem) -> bool,
        accepts_fence: fn(&[MissionItem]) -> bool,
        accepts_rally: fn(&[MissionItem]) -> bool,
    ) -> Self {
        let [mission, fence, rally] = [const { Vec::new() }; 3];
        let (upload, last_uploader) = (None, None);
        Self { mission, fence, rally, accepts, accepts_fence, accepts_rally, upload, last_uploader }
    }

    pub(super) fn items(&self) -> &[MissionItem] {
        &self.mission
    }

    pub(super) fn fence(&self) -> &[MissionItem] {
        &self.fence
    }

    pub(super) fn rally_points(&self) -> &[MissionItem] {
        &self.rally
    }

    fn list(&self, kind: MavMissionType) -> Option<&Vec<MissionItem>> {
        match kind {
            MavMissionType::MAV_MISSION_TYPE_MISSION => Some(&self.mission),
            MavMissionType::MAV_MISSION_TYPE_FENCE => Some(&self.fence),
            MavMissionType::MAV_MISSION_TYPE_RALLY => Some(&self.rally),
            MavMissionType::MAV_MISSION_TYPE_ALL => None,
        }
    }

    fn list_mut(&mut self, kind: MavMissionType) -> Option<&mut Vec<MissionItem>> {
        match kind {
            MavMissionType::MAV_MISSION_TYPE_MISSION => Some(&mut self.mission),
            MavMissionType::MAV_MISSION_TYPE_FENCE => Some(&mut self.fence),
            MavMissionType::MAV_MISSION_TYPE_RALLY => Some(&mut self.rally),
            MavMissionType::MAV_MISSION_TYPE_ALL => None,
        }
    }

    /// `MISSION_REQUEST_LIST`.
    pub(super) fn on_list(&self, from: Address, kind: MavMissionType, output: &mut FrameWriter) {
        match self.list(kind) {
            Some(items) => write_count(from, kind, items.len() as u16, output),
            None => write_ack(from, kind, MavMissionResult::MAV_MISSION_UNSUPPORTED, output),
        }
    }

    /// `MISSION_REQUEST_INT` or the older `MISSION_REQUEST`, answered alike.
    pub(super) fn on_request(&self, from: Address, kind: MavMissionType, seq: u16, output: &mut FrameWriter) {
        match self.list(kind).and_then(|items| items.get(usize::from(seq))) {
            Some(item) => output.write(&item.to_message(seq, from, kind)),
            None => write_ack(from, kind, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, output),
        }
    }

    /// `MISSION_COUNT`: an upload begins, or begins anew. Returns what has changed (to an empty list).
    pub(super) fn on_count(
        &mut self,
        now: Duration,
        from: Address,
        message: &MISSION_COUNT_DATA,
        output: &mut FrameWriter,
    ) -> Option<Changed> {
        let kind = message.mission_type;
        if self.list(kind).is_none() {
            write_ack(from, kind, MavMissionResult::MAV_MISSION_UNSUPPORTED, output);
            return None;
        }
        let mut upload = match self.upload.take() {
            Some(upload) if upload.from != from => {
                self.upload = Some(upload);
                write_ack(from, kind, MavMissionResult::MAV_MISSION_DENIED, output);
                return None;
            }
            Some(upload) if upload.kind == kind => upload,
            _ => Upload { from, kind, receiver: MissionReceiver::new(now) },
        };
        self.last_uploader = None;
        if upload.receiver.on_count(now, message.count).is_err() {
            write_ack(from, kind, MavMissionResult::MAV_MISSION_NO_SPACE, output);
            return None;
        }
        self.upload = Some(upload);
        self.ask_or_finish(output)
    }

    /// `MISSION_ITEM_INT`. Returns what has changed.
    pub(super) fn on_item(
        &mut self,
        now: Duration,
        from: Address,
        message: &MISSION_ITEM_INT_DATA,
        output: &mut FrameWriter,
    ) -> Option<Changed> {
        let (item, kind) = (MissionItem::from_message(message), message.mission_type);
        match &mut self.upload {
            Some(upload) if upload.from == from && upload.kind == kind => {
                if is_mission(kind) && !(self.accepts)(&item) {
                    self.abandon(MavMissionResult::MAV_MISSION_UNSUPPORTED, output);
                    return None;
                }
                if upload.receiver.on_item(now, message.seq, item) {
                    self.ask_or_finish(output)
                } else {
                    None
                }
            }
            Some(_) => None,
            None => {
                let is_last =
                    self.list(kind).is_some_and(|items| usize::from(message.seq) + 1 == items.len());
                if self.last_uploader == Some((from, kind)) && is_last {
                    write_ack(from, kind, MavMissionResult::MAV_MISSION_ACCEPTED, output);
                }
                None
            }
        }
    }

    /// An item with a command that nobody knows: the upload that it belongs to is refused.
    pub(super) fn refuse_item(&mut self, from: Address, output: &mut FrameWriter) {
        if self.upload.as_ref().is_some_and(|upload| upload.from == from) {
            self.abandon(MavMissionResult::MAV_MISSION_UNSUPPORTED, output);
        }
    }

    /// `MISSION_ACK`: a station that gives its upload up says so.
    pub(super) fn on_ack(&mut self, from: Address, message: &MISSION_ACK_DATA) {
        let is_over = message.mavtype != MavMissionResult::MAV_MISSION_ACCEPTED;
        self.upload.take_if(|upload| is_over && upload.from == from && upload.kind == message.mission_type);
    }

    /// `MISSION_CLEAR_ALL`: denied while another station uploads. A station's own upload ends with it.
    /// Returns what has changed.
    pub(super) fn on_clear(
        &mut self,
        from: Address,
        kind: MavMissionType,
        output: &mut FrameWriter,
    ) -> Option<Changed> {
        if self.upload.as_ref().is_some_and(|upload| upload.from != from) {
            write_ack(from, kind, MavMissionResult::MAV_MISSION_DENIED, output);
            return None;
        }
        if self.upload.is_some() {
            self.abandon(MavMissionResult::MAV_MISSION_OPERATION_CANCELLED, output);
        }
        write_ack(from, kind, MavMissionResult::MAV_MISSION_ACCEPTED, output);
        self.last_uploader = None;
        let Some(list) = self.list_mut(kind) else {
            self.mission.clear();
            self.fence.clear();
            self.rally.clear();
            return Some(Changed::All);
        };
        (!std::mem::take(list).is_empty()).then_some(changed(kind))
    }

    /// Asks again for what is overdue, and gives a dead upload up.
    pub(super) fn tick(&mut self, now: Duration, output: &mut FrameWriter) {
        let Some(Upload { from, kind, receiver }) = &mut self.upload else {
            return;
        };
        match receiver.tick(now) {
            Ok(None) => {}
            Ok(Some(request)) => request.write(*from, *kind, output),
            Err(_) => self.abandon(MavMissionResult::MAV_MISSION_OPERATION_CANCELLED, output),
        }
    }

    fn abandon(&mut self, result: MavMissionResult, output: &mut FrameWriter) {
        if let Some(Upload { from, kind, .. }) = self.upload.take() {
            write_ack(from, kind, result, output);
        }
    }

    /// Asks for the next item, or takes the whole list over: until then the old one stays in force.
    fn ask_or_finish(&mut self, output: &mut FrameWriter) -> Option<Changed> {
        let Upload { from, kind, receiver } = self.upload.take()?;
        if !receiver.is_complete() {
            receiver.request().write(from, kind, output);
            self.upload = Some(Upload { from, kind, receiver });
            return None;
        }
        let items = receiver.into_items();
        if !self.is_sound(kind, &items) {
            write_ack(from, kind, MavMissionResult::MAV_MISSION_UNSUPPORTED, output);
            return None;
        }
        *self.list_mut(kind)? = items;
        self.last_uploader = Some((from, kind));
        write_ack(from, kind, MavMissionResult::MAV_MISSION_ACCEPTED, output);
        Some(changed(kind))
    }

    fn is_sound(&self, kind: MavMissionType, items: &[MissionItem]) -> bool {
        match kind {
            MavMissionType::MAV_MISSION_TYPE_FENCE => (self.accepts_fence)(items),
            MavMissionType::MAV_MISSION_TYPE_RALLY => (self.accepts_rally)(items),
            _ => true,
        }
    }
}

fn changed(kind: MavMissionType) -> Changed {
    if is_mission(kind) { Changed::Mission } else { Changed::Places }
}

/// An item of the older message, whose latitude and longitude are in degrees where its frame is global.
pub(super) fn whole(message: &MISSION_ITEM_DATA) -> MISSION_ITEM_INT_DATA {
    use MavFrame::{MAV_FRAME_LOCAL_ENU, MAV_FRAME_LOCAL_NED, MAV_FRAME_MISSION};
    let factor = match message.frame {
        MAV_FRAME_LOCAL_NED | MAV_FRAME_LOCAL_ENU => 1e4,
        MAV_FRAME_MISSION => 1.0,
        _ => 1e7,
    };
    let scaled = |value: f32| (f64::from(value) * factor).round() as i32;
    MISSION_ITEM_INT_DATA {
        param1: message.param1,
        param2: message.param2,
        param3: message.param3,
        param4: message.param4,
        x: scaled(message.x),
        y: scaled(message.y),
        z: message.z,
        seq: message.seq,
        command: message.command,
        target_system: message.target_system,
        target_component: message.target_component,
        frame: message.frame,
        current: message.current,
        autocontinue: message.autocontinue,
        mission_type: message.mission_type,
    }
}
