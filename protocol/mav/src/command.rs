//! Commands of a companion to its autopilot, and the answers.

use mavlink::dialects::common::MavResult;

/// A command to the autopilot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Let the motors turn.
    Arm,
    /// Stop the motors. Refused in the air.
    Disarm,
    /// Climb straight up.
    Takeoff {
        /// Height above home, m.
        height_m: f64,
    },
    /// Fly the companion's set-points. PX4 accepts it only while they already arrive; ArduPilot needs it
    /// before arming and take-off.
    Offboard,
    Land,
    /// Fly home and land.
    Return,
    Hold,
    /// Fly the uploaded mission.
    StartMission,
}

/// The outcome of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CommandResult {
    /// It is being done.
    #[error("accepted")]
    Accepted,
    /// Not now; the autopilot's texts say why.
    #[error("rejected for now: its texts say why, repeat when that is mended")]
    TemporarilyRejected,
    #[error("denied")]
    Denied,
    /// The autopilot does not know it.
    #[error("not supported by this autopilot")]
    Unsupported,
    /// Tried without success.
    #[error("failed")]
    Failed,
    /// Replaced or cancelled before it was done.
    #[error("cancelled")]
    Cancelled,
    /// Another station is in control.
    #[error("another station is in control")]
    NotInControl,
    /// Not sent: no heartbeat of a PX4 or ArduPilot has been heard, so its numbers are not known.
    #[error("not sent: no heartbeat of a known autopilot yet")]
    NoAutopilot,
    /// Not sent: the height of home, which a PX4 take-off needs, is not known yet.
    #[error("not sent: the autopilot has not told where home is yet")]
    NoHome,
    /// Not sent: a number in it is not finite.
    #[error("not sent: a number in it is not finite")]
    NotFinite,
}

impl CommandResult {
    /// Whether the command is being done.
    pub fn is_accepted(self) -> bool {
        self == Self::Accepted
    }

    /// The result of an acknowledgement; `None` for "in progress", which is not one yet.
    pub(crate) fn from_ack(result: MavResult) -> Option<Self> {
        Some(match result {
            MavResult::MAV_RESULT_IN_PROGRESS => return None,
            MavResult::MAV_RESULT_ACCEPTED => Self::Accepted,
            MavResult::MAV_RESULT_TEMPORARILY_REJECTED => Self::TemporarilyRejected,
            MavResult::MAV_RESULT_DENIED => Self::Denied,
            MavResult::MAV_RESULT_FAILED => Self::Failed,
            MavResult::MAV_RESULT_CANCELLED => Self::Cancelled,
            MavResult::MAV_RESULT_NOT_IN_CONTROL => Self::NotInControl,
            _ => Self::Unsupported,
        })
    }

    /// The number an autopilot acknowledges with.
    pub(crate) fn to_ack(self) -> MavResult {
        match self {
            Self::Accepted => MavResult::MAV_RESULT_ACCEPTED,
            Self::TemporarilyRejected | Self::NoHome | Self::NoAutopilot => {
                MavResult::MAV_RESULT_TEMPORARILY_REJECTED
            }
            Self::Denied | Self::NotFinite => MavResult::MAV_RESULT_DENIED,
            Self::Unsupported => MavResult::MAV_RESULT_UNSUPPORTED,
            Self::Failed => MavResult::MAV_RESULT_FAILED,
            Self::Cancelled => MavResult::MAV_RESULT_CANCELLED,
            Self::NotInControl => MavResult::MAV_RESULT_NOT_IN_CONTROL,
        }
    }
}
