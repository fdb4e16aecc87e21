//! Events of an autopilot's link.

use crate::command::{Command, CommandResult};
use crate::mission::{MissionError, MissionItem};
use crate::mode::FlightMode;
use crate::parameter::ParameterValue;
use crate::telemetry::Text;

/// Something that happened on the link.
#[derive(Debug, Clone, PartialEq)]
pub enum MavEvent {
    /// The autopilot answered a command, or it could not be sent.
    CommandAcked { command: Command, result: CommandResult },
    /// The autopilot never answered, for all repetitions. It may have obeyed.
    CommandTimedOut { command: Command },
    /// The flight mode changed, whoever asked for it.
    ModeChanged { from: FlightMode, to: FlightMode },
    /// The autopilot armed or disarmed, whoever asked for it.
    ArmedChanged { armed: bool },
    /// Heartbeats stopped for [`HEARTBEAT_TIMEOUT`](crate::HEARTBEAT_TIMEOUT).
    HeartbeatLost,
    /// Heartbeats came (again).
    HeartbeatRegained,
    /// A parameter has this value: it was read or written, by whomever.
    ParameterRead { name: String, value: ParameterValue },
    /// A parameter that was asked for never came: the autopilot does not have it, or the link is bad.
    ParameterMissing { name: String },
    /// The mission was downloaded.
    MissionReceived {
        /// Its items in order.
        items: Vec<MissionItem>,
    },
    /// The mission was uploaded, and the autopilot accepted it.
    MissionUploaded,
    /// A mission transfer failed.
    MissionFailed { error: MissionError },
    /// The autopilot wrote a line.
    Text(Text),
}
