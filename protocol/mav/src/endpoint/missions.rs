//! The mission protocol at the autopilot's end: it keeps the mission, hands it out, and takes in a new one.

use std::time::Duration;

use mavlink::dialects::common::{
    MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MavMissionResult, MavMissionType,
};

use crate::frame::{Address, FrameWriter};
use crate::mission::{MissionItem, MissionReceiver, is_mission, write_ack, write_count};

/// The mission and the transfer under way, if any.
#[derive(Debug, Clone)]
pub(super) struct Missions {
    items: Vec<MissionItem>,
    accepts: fn(&MissionItem) -> bool,
    upload: Option<(Address, MissionReceiver)>,
    /// The last station that uploaded a mission. It repeats its last item if the acknowledgement was lost.
    last_uploader: Option<Address>,
}

impl Missions {
    pub(super) fn new(accepts: fn(&MissionItem) -> bool) -> Self {
        Self { items: Vec::new(), accepts, upload: None, last_uploader: None }
    }

    pub(super) fn items(&self) -> &[MissionItem] {
        &self.items
    }

    /// `MISSION_REQUEST_LIST`. Fences and rally points are empty lists here.
    pub(super) fn on_list(&self, from: Address, kind: MavMissionType, output: &mut FrameWriter) {
        let count = if is_mission(kind) { self.items.len() } else { 0 };
        write_count(from, kind, count as u16, output);
    }

    /// `MISSION_REQUEST_INT` or the older `MISSION_REQUEST`, answered alike.
    pub(super) fn on_request(&self, from: Address, kind: MavMissionType, seq: u16, output: &mut FrameWriter) {
        match self.items.get(usize::from(seq)) {
            Some(item) if is_mission(kind) => output.write(&item.to_message(seq, from)),
            _ => write_ack(from, kind, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, output),
        }
    }

    /// `MISSION_COUNT`: an upload begins, or begins anew. Returns whether the mission changed (to an empty
    /// one).
    pub(super) fn on_count(
        &mut self,
        now: Duration,
        from: Address,
        message: &MISSION_COUNT_DATA,
        output: &mut FrameWriter,
    ) -> bool {
        if !is_mission(message.mission_type) {
            let result = if message.count == 0 {
                MavMissionResult::MAV_MISSION_ACCEPTED
            } else {
                MavMissionResult::MAV_MISSION_UNSUPPORTED
            };
            write_ack(from, message.mission_type, result, output);
            return false;
        }
        let receiver = match self.upload.take() {
            Some((uploader, receiver)) if uploader != from => {
                self.upload = Some((uploader, receiver));
                write_ack(from, message.mission_type, MavMissionResult::MAV_MISSION_DENIED, output);
                return false;
            }
            Some((_, receiver)) => receiver,
            None => MissionReceiver::new(now),
        };
        self.last_uploader = None;
        let (_, receiver) = self.upload.insert((from, receiver));
        if receiver.on_count(now, message.count).is_err() {
            self.abandon(from, MavMissionResult::MAV_MISSION_NO_SPACE, output);
            return false;
        }
        self.ask_or_finish(output)
    }

    /// `MISSION_ITEM_INT`. Returns whether the mission changed.
    pub(super) fn on_item(
        &mut self,
        now: Duration,
        from: Address,
        message: &MISSION_ITEM_INT_DATA,
        output: &mut FrameWriter,
    ) -> bool {
        if !is_mission(message.mission_type) {
            return false;
        }
        let item = MissionItem::from_message(message);
        match &mut self.upload {
            Some((uploader, _)) if *uploader == from && !(self.accepts)(&item) => {
                self.abandon(from, MavMissionResult::MAV_MISSION_UNSUPPORTED, output);
                false
            }
            Some((uploader, receiver)) if *uploader == from => {
                receiver.on_item(now, message.seq, item) && self.ask_or_finish(output)
            }
            Some(_) => false,
            None => {
                if self.last_uploader == Some(from) && usize::from(message.seq) + 1 == self.items.len() {
                    accept(from, output);
                }
                false
            }
        }
    }

    /// `MISSION_CLEAR_ALL`. Returns whether the mission changed.
    pub(super) fn on_clear(&mut self, from: Address, kind: MavMissionType, output: &mut FrameWriter) -> bool {
        write_ack(from, kind, MavMissionResult::MAV_MISSION_ACCEPTED, output);
        let clears = is_mission(kind) || kind == MavMissionType::MAV_MISSION_TYPE_ALL;
        clears && !std::mem::take(&mut self.items).is_empty()
    }

    /// Asks again for what is overdue, and gives a dead upload up.
    pub(super) fn tick(&mut self, now: Duration, output: &mut FrameWriter) {
        let Some((from, receiver)) = &mut self.upload else {
            return;
        };
        match receiver.tick(now) {
            Ok(None) => {}
            Ok(Some(request)) => request.write(*from, output),
            Err(_) => {
                let from = *from;
                self.abandon(from, MavMissionResult::MAV_MISSION_OPERATION_CANCELLED, output);
            }
        }
    }

    fn abandon(&mut self, from: Address, result: MavMissionResult, output: &mut FrameWriter) {
        self.upload = None;
        write_ack(from, MavMissionType::MAV_MISSION_TYPE_MISSION, result, output);
    }

    /// Asks for the next item, or takes the whole mission over: until then the old one stays in force.
    fn ask_or_finish(&mut self, output: &mut FrameWriter) -> bool {
        let Some((from, receiver)) = self.upload.take() else {
            return false;
        };
        if !receiver.is_complete() {
            receiver.request().write(from, output);
            self.upload = Some((from, receiver));
            return false;
        }
        self.items = receiver.into_items();
        self.last_uploader = Some(from);
        accept(from, output);
        true
    }
}

fn accept(target: Address, output: &mut FrameWriter) {
    let kind = MavMissionType::MAV_MISSION_TYPE_MISSION;
    write_ack(target, kind, MavMissionResult::MAV_MISSION_ACCEPTED, output);
}
