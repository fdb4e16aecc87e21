//! Messages with a command that the common dialect does not know, and which want an answer all the same.

use crate::address::Address;
use crate::frame::{FrameWriter, Unread};

const COMMAND_INT: u32 = 75;
const COMMAND_LONG: u32 = 76;
const MISSION_ITEM: u32 = 39;
const MISSION_ITEM_INT: u32 = 73;
/// `COMMAND_ACK`: its id, the seed of its checksum, and its result for what is not supported.
const COMMAND_ACK: (u32, u8) = (77, 143);
const UNSUPPORTED: u8 = 3;
/// Longest of the payloads that are looked at, in bytes.
const LEN: usize = 38;

/// The wish of such a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Want {
    /// A command is to be done.
    Command(u16),
    /// An item belongs to a mission.
    Item,
}

/// A message that could not be read whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Unparsed {
    pub(crate) from: Address,
    /// Whom it is for: system and component.
    pub(crate) to: (u8, u8),
    pub(crate) want: Want,
}

impl Unparsed {
    /// Reads what can be read of a message; `None` for those that want no answer.
    pub(crate) fn read(unread: &Unread) -> Option<Self> {
        let mut bytes = [0; LEN];
        for (byte, sent) in bytes.iter_mut().zip(&unread.payload) {
            *byte = *sent;
        }
        let (want, to) = match unread.message_id {
            COMMAND_LONG | COMMAND_INT => (Want::Command(u16::from_le_bytes([bytes[28], bytes[29]])), 30),
            MISSION_ITEM | MISSION_ITEM_INT => (Want::Item, 32),
            _ => return None,
        };
        Some(Self { from: unread.sender, to: (bytes[to], bytes[to + 1]), want })
    }
}

/// Tells a station that a command is not supported.
pub(crate) fn write_unsupported(to: Address, command: u16, output: &mut FrameWriter) {
    let [low, high] = command.to_le_bytes();
    let payload = [low, high, UNSUPPORTED, 0, 0, 0, 0, 0, to.system_id, to.component_id];
    output.write_payload(COMMAND_ACK, &payload);
}

#[cfg(test)]
mod tests {
    use mavlink::dialects::common::{COMMAND_ACK_DATA, MavCmd, MavMessage, MavResult};

    use super::*;
    use crate::frame::FrameReader;

    const STATION: Address = Address { system_id: 250, component_id: 190 };

    #[test]
    fn a_command_of_nobody_is_read_as_far_as_it_goes() {
        let mut writer = FrameWriter::new(STATION);
        let mut payload = [0; 33];
        payload[28..33].copy_from_slice(&[0x60, 0xEA, 3, 1, 0]);
        writer.write_payload((COMMAND_LONG, 152), &payload);
        let mut reader = FrameReader::default();
        reader.push(&writer.take());
        assert_eq!(reader.next_frame(), None);
        let unparsed = Unparsed { from: STATION, to: (3, 1), want: Want::Command(60_000) };
        assert_eq!(reader.next_unread().as_ref().and_then(Unparsed::read), Some(unparsed));
        assert_eq!(reader.next_unread(), None);
    }

    #[test]
    fn a_refusal_is_the_acknowledgement_that_stations_know() {
        let mut writer = FrameWriter::new(Address::autopilot(3));
        let command = MavCmd::MAV_CMD_DO_PARACHUTE;
        write_unsupported(STATION, command as u16, &mut writer);
        let mut reader = FrameReader::default();
        reader.push(&writer.take());
        let Some(MavMessage::COMMAND_ACK(COMMAND_ACK_DATA { command: told, result, target_system, .. })) =
            reader.next_frame().map(|frame| frame.message)
        else {
            panic!("an acknowledgement")
        };
        assert_eq!((told, result, target_system), (command, MavResult::MAV_RESULT_UNSUPPORTED, 250));
    }
}
