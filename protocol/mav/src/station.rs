//! Other stations on an autopilot's line, whose bytes its companion passes on: which of them take the vehicle over.

use mavlink::dialects::common::{MavCmd, MavMessage};

use crate::address::Address;
use crate::frame::FrameReader;

/// Hears what a station says to the autopilot of one vehicle.
#[derive(Debug, Clone)]
pub struct Station {
    autopilot: Address,
    reader: FrameReader,
}

impl Station {
    /// A station that speaks to the autopilot with this system id.
    pub fn of(system_id: u8) -> Self {
        Self { autopilot: Address::autopilot(system_id), reader: FrameReader::default() }
    }

    /// Takes in what it said; returns the first order in it that takes the vehicle over, by its name in MAVLink.
    /// Sticks do not: whose they are is decided by the flight mode.
    pub fn hear(&mut self, bytes: &[u8]) -> Option<String> {
        self.reader.push(bytes);
        let mut first = None;
        while let Some(frame) = self.reader.next_frame() {
            if self.autopilot.is_addressed_by(&frame.message) {
                first = first.or_else(|| order(&frame.message));
            }
        }
        first
    }
}

/// The name of an order to move, or not to.
fn order(message: &MavMessage) -> Option<String> {
    match message {
        MavMessage::COMMAND_LONG(message) => command(message.command),
        MavMessage::COMMAND_INT(message) => command(message.command),
        MavMessage::SET_MODE(_) => Some("SET_MODE".to_owned()),
        MavMessage::SET_POSITION_TARGET_LOCAL_NED(_) => Some("SET_POSITION_TARGET_LOCAL_NED".to_owned()),
        MavMessage::SET_POSITION_TARGET_GLOBAL_INT(_) => Some("SET_POSITION_TARGET_GLOBAL_INT".to_owned()),
        MavMessage::SET_ATTITUDE_TARGET(_) => Some("SET_ATTITUDE_TARGET".to_owned()),
        _ => None,
    }
}

fn command(command: MavCmd) -> Option<String> {
    let takes_over = matches!(
        command,
        MavCmd::MAV_CMD_DO_REPOSITION
            | MavCmd::MAV_CMD_DO_ORBIT
            | MavCmd::MAV_CMD_DO_FOLLOW
            | MavCmd::MAV_CMD_DO_CHANGE_ALTITUDE
            | MavCmd::MAV_CMD_DO_PAUSE_CONTINUE
            | MavCmd::MAV_CMD_DO_SET_MODE
            | MavCmd::MAV_CMD_DO_FLIGHTTERMINATION
            | MavCmd::MAV_CMD_COMPONENT_ARM_DISARM
            | MavCmd::MAV_CMD_GUIDED_CHANGE_ALTITUDE
            | MavCmd::MAV_CMD_GUIDED_CHANGE_HEADING
            | MavCmd::MAV_CMD_GUIDED_CHANGE_SPEED
            | MavCmd::MAV_CMD_MISSION_START
            | MavCmd::MAV_CMD_NAV_TAKEOFF
            | MavCmd::MAV_CMD_NAV_LAND
            | MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH
    );
    takes_over.then(|| format!("{command:?}").trim_start_matches("MAV_CMD_").to_owned())
}

#[cfg(test)]
mod tests {
    use mavlink::dialects::common::{
        COMMAND_INT_DATA, COMMAND_LONG_DATA, HEARTBEAT_DATA, MANUAL_CONTROL_DATA,
    };

    use super::*;
    use crate::frame::FrameWriter;

    const ME: u8 = 7;

    fn long(command: MavCmd, target_system: u8) -> COMMAND_LONG_DATA {
        COMMAND_LONG_DATA { command, target_system, target_component: 1, ..Default::default() }
    }

    #[test]
    fn an_order_to_this_vehicle_takes_it_over_and_other_talk_does_not() {
        let heard = |write: &dyn Fn(&mut FrameWriter)| {
            let mut writer = FrameWriter::new(Address { system_id: 255, component_id: 190 });
            write(&mut writer);
            Station::of(ME).hear(&writer.take())
        };
        let reposition = MavCmd::MAV_CMD_DO_REPOSITION;
        let to_me = COMMAND_INT_DATA { command: reposition, target_system: ME, ..Default::default() };
        assert_eq!(heard(&|writer| writer.write(&to_me)).as_deref(), Some("DO_REPOSITION"));
        assert_eq!(heard(&|writer| writer.write(&long(reposition, ME))).as_deref(), Some("DO_REPOSITION"));
        assert_eq!(heard(&|writer| writer.write(&long(reposition, ME + 1))), None, "to another vehicle");
        assert_eq!(heard(&|writer| writer.write(&long(MavCmd::MAV_CMD_REQUEST_MESSAGE, ME))), None);
        assert_eq!(heard(&|writer| writer.write(&HEARTBEAT_DATA::default())), None);
        let sticks = MANUAL_CONTROL_DATA { target: ME, ..Default::default() };
        assert_eq!(heard(&|writer| writer.write(&sticks)), None);
    }
}
