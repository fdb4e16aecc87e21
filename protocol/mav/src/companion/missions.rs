//! The mission protocol at the companion's end: one download or upload at a time.

use std::time::Duration;

use mavlink::dialects::common::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_REQUEST_INT_DATA, MISSION_REQUEST_LIST_DATA, MavMessage,
    MavMissionResult, MavMissionType,
};

use super::MavEvent;
use crate::frame::{Address, FrameWriter};
use crate::mission::{
    MAX_ITEMS, MissionError, MissionItem, MissionReceiver, MissionSender, ReceiverMessage, SenderMessage,
};

/// The transfer under way, if any.
#[derive(Debug, Clone, Default)]
pub(super) enum Missions {
    #[default]
    Idle,
    /// Asked for by the agent; begins at the next tick.
    Wanted(Wanted),
    Downloading(MissionReceiver),
    Uploading(MissionSender),
}

#[derive(Debug, Clone)]
pub(super) enum Wanted {
    Download,
    Upload(Vec<MissionItem>),
}

impl Missions {
    /// Wants a transfer, in place of one that may be under way. Returns what is to be told about the latter
    /// or of a refusal.
    pub(super) fn want(&mut self, wanted: Wanted) -> Option<MavEvent> {
        if let Wanted::Upload(items) = &wanted
            && items.len() > usize::from(MAX_ITEMS)
        {
            return Some(failed(MissionError::TooLong { items: items.len() }));
        }
        let before = std::mem::replace(self, Self::Wanted(wanted));
        (!matches!(before, Self::Idle)).then(|| failed(MissionError::Superseded))
    }

    /// A message of the mission protocol arrived.
    pub(super) fn receive(
        &mut self,
        now: Duration,
        message: &MavMessage,
        autopilot: Address,
        output: &mut FrameWriter,
    ) -> Option<MavEvent> {
        match (&mut *self, message) {
            (Self::Downloading(receiver), MavMessage::MISSION_COUNT(count))
                if is_mission(count.mission_type) =>
            {
                if let Err(error) = receiver.on_count(now, count.count) {
                    *self = Self::Idle;
                    return Some(failed(error));
                }
                self.ask_or_finish(autopilot, output)
            }
            (Self::Downloading(receiver), MavMessage::MISSION_ITEM_INT(item))
                if is_mission(item.mission_type) =>
            {
                if receiver.on_item(now, item.seq, MissionItem::from_message(item)) {
                    return self.ask_or_finish(autopilot, output);
                }
                None
            }
            (Self::Uploading(sender), MavMessage::MISSION_REQUEST_INT(request))
                if is_mission(request.mission_type) =>
            {
                let answer = sender.on_request(now, request.seq)?;
                say(answer, autopilot, output);
                None
            }
            (Self::Uploading(sender), MavMessage::MISSION_REQUEST(request))
                if is_mission(request.mission_type) =>
            {
                let answer = sender.on_request(now, request.seq)?;
                say(answer, autopilot, output);
                None
            }
            (Self::Uploading(_) | Self::Downloading(_), MavMessage::MISSION_ACK(ack))
                if is_mission(ack.mission_type) =>
            {
                let uploading = matches!(self, Self::Uploading(_));
                match ack.mavtype {
                    MavMissionResult::MAV_MISSION_ACCEPTED if uploading => {
                        *self = Self::Idle;
                        Some(MavEvent::MissionUploaded)
                    }
                    // The end of an earlier upload, heard again.
                    MavMissionResult::MAV_MISSION_ACCEPTED => None,
                    refusal => {
                        *self = Self::Idle;
                        Some(failed(MissionError::Refused(refusal)))
                    }
                }
            }
            _ => None,
        }
    }

    /// Begins what is wanted and repeats what is overdue.
    pub(super) fn tick(
        &mut self,
        now: Duration,
        autopilot: Address,
        output: &mut FrameWriter,
    ) -> Option<MavEvent> {
        let outcome = match self {
            Self::Idle => Ok(()),
            Self::Wanted(Wanted::Download) => {
                let receiver = MissionReceiver::new(now);
                ask(receiver.request(), autopilot, output);
                *self = Self::Downloading(receiver);
                Ok(())
            }
            Self::Wanted(Wanted::Upload(items)) => {
                let sender = MissionSender::new(now, std::mem::take(items));
                say(sender.repeat(), autopilot, output);
                *self = Self::Uploading(sender);
                Ok(())
            }
            Self::Downloading(receiver) => {
                receiver.tick(now).map(|again| again.into_iter().for_each(|it| ask(it, autopilot, output)))
            }
            Self::Uploading(sender) => {
                sender.tick(now).map(|again| again.into_iter().for_each(|it| say(it, autopilot, output)))
            }
        };
        outcome.err().map(|error| {
            *self = Self::Idle;
            failed(error)
        })
    }

    /// Asks for the next item, or thanks for the last.
    fn ask_or_finish(&mut self, autopilot: Address, output: &mut FrameWriter) -> Option<MavEvent> {
        let Self::Downloading(receiver) = self else {
            return None;
        };
        if !receiver.is_complete() {
            ask(receiver.request(), autopilot, output);
            return None;
        }
        output.write(&MISSION_ACK_DATA {
            target_system: autopilot.system_id,
            target_component: autopilot.component_id,
            mavtype: MavMissionResult::MAV_MISSION_ACCEPTED,
            ..Default::default()
        });
        match std::mem::take(self) {
            Self::Downloading(receiver) => Some(MavEvent::MissionReceived { items: receiver.into_items() }),
            _ => None,
        }
    }
}

fn is_mission(mission_type: MavMissionType) -> bool {
    mission_type == MavMissionType::MAV_MISSION_TYPE_MISSION
}

fn failed(error: MissionError) -> MavEvent {
    MavEvent::MissionFailed { error }
}

fn say(message: SenderMessage, autopilot: Address, output: &mut FrameWriter) {
    match message {
        SenderMessage::Count(count) => output.write(&MISSION_COUNT_DATA {
            count,
            target_system: autopilot.system_id,
            target_component: autopilot.component_id,
            ..Default::default()
        }),
        SenderMessage::Item(seq, item) => output.write(&item.to_message(seq, autopilot)),
    }
}

fn ask(message: ReceiverMessage, autopilot: Address, output: &mut FrameWriter) {
    match message {
        ReceiverMessage::List => output.write(&MISSION_REQUEST_LIST_DATA {
            target_system: autopilot.system_id,
            target_component: autopilot.component_id,
            ..Default::default()
        }),
        ReceiverMessage::Item(seq) => output.write(&MISSION_REQUEST_INT_DATA {
            seq,
            target_system: autopilot.system_id,
            target_component: autopilot.component_id,
            ..Default::default()
        }),
    }
}
