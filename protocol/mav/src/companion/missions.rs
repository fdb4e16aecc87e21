//! The mission protocol at the companion's end: one download or upload at a time.

use std::time::Duration;

use mavlink::dialects::common::{
    MISSION_REQUEST_DATA, MISSION_REQUEST_INT_DATA, MavMessage, MavMissionResult, MavMissionType,
};

use crate::address::Address;
use crate::event::MavEvent;
use crate::frame::FrameWriter;
use crate::mission::{
    MAX_ITEMS, MissionError, MissionItem, MissionReceiver, MissionSender, is_mission, write_ack,
};

const KIND: MavMissionType = MavMissionType::MAV_MISSION_TYPE_MISSION;

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
        match (&mut *self, about_mission(message)?) {
            (Self::Downloading(receiver), MavMessage::MISSION_COUNT(count)) => {
                if let Err(error) = receiver.on_count(now, count.count) {
                    *self = Self::Idle;
                    return Some(failed(error));
                }
                self.ask_or_finish(autopilot, output)
            }
            (Self::Downloading(receiver), MavMessage::MISSION_ITEM_INT(item)) => {
                let expected = receiver.on_item(now, item.seq, MissionItem::from_message(item));
                expected.then(|| self.ask_or_finish(autopilot, output)).flatten()
            }
            (
                Self::Uploading(sender),
                MavMessage::MISSION_REQUEST_INT(MISSION_REQUEST_INT_DATA { seq, .. })
                | MavMessage::MISSION_REQUEST(MISSION_REQUEST_DATA { seq, .. }),
            ) => {
                sender.on_request(now, *seq)?.write(autopilot, output);
                None
            }
            (Self::Uploading(_) | Self::Downloading(_), MavMessage::MISSION_ACK(ack)) => {
                let event = match (ack.mavtype, &*self) {
                    (MavMissionResult::MAV_MISSION_ACCEPTED, Self::Uploading(_)) => MavEvent::MissionUploaded,
                    // The end of an earlier upload, heard again.
                    (MavMissionResult::MAV_MISSION_ACCEPTED, _) => return None,
                    (refusal, _) => failed(MissionError::Refused(refusal)),
                };
                *self = Self::Idle;
                Some(event)
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
                receiver.request().write(autopilot, KIND, output);
                *self = Self::Downloading(receiver);
                Ok(())
            }
            Self::Wanted(Wanted::Upload(items)) => {
                let sender = MissionSender::new(now, std::mem::take(items));
                sender.repeat().write(autopilot, output);
                *self = Self::Uploading(sender);
                Ok(())
            }
            Self::Downloading(receiver) => receiver
                .tick(now)
                .map(|again| again.into_iter().for_each(|it| it.write(autopilot, KIND, output))),
            Self::Uploading(sender) => {
                sender.tick(now).map(|again| again.into_iter().for_each(|it| it.write(autopilot, output)))
            }
        };
        outcome.err().map(|error| {
            *self = Self::Idle;
            failed(error)
        })
    }

    /// Asks for the next item, or thanks for the last.
    fn ask_or_finish(&mut self, autopilot: Address, output: &mut FrameWriter) -> Option<MavEvent> {
        let Self::Downloading(receiver) = std::mem::take(self) else {
            return None;
        };
        if !receiver.is_complete() {
            receiver.request().write(autopilot, KIND, output);
            *self = Self::Downloading(receiver);
            return None;
        }
        write_ack(autopilot, KIND, MavMissionResult::MAV_MISSION_ACCEPTED, output);
        Some(MavEvent::MissionReceived { items: receiver.into_items() })
    }
}

/// The message, if it belongs to the transfer of a mission.
fn about_mission(message: &MavMessage) -> Option<&MavMessage> {
    let kind = match message {
        MavMessage::MISSION_COUNT(message) => message.mission_type,
        MavMessage::MISSION_ITEM_INT(message) => message.mission_type,
        MavMessage::MISSION_REQUEST_INT(message) => message.mission_type,
        MavMessage::MISSION_REQUEST(message) => message.mission_type,
        MavMessage::MISSION_ACK(message) => message.mission_type,
        _ => return None,
    };
    is_mission(kind).then_some(message)
}

fn failed(error: MissionError) -> MavEvent {
    MavEvent::MissionFailed { error }
}
