//! What a companion can tell an autopilot to do, and what it answers.

use mavlink::dialects::common::{COMMAND_LONG_DATA, MavCmd, MavResult};

use crate::mode::{AutopilotKind, FlightMode};

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

/// What became of a command.
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

impl Command {
    /// The message that gives this command to an autopilot of this kind. `home_height_m` is the height of
    /// home above the vertical reference.
    ///
    /// # Errors
    /// The reason why it cannot be sent yet.
    pub(crate) fn encode(
        self,
        kind: AutopilotKind,
        home_height_m: Option<f64>,
    ) -> Result<COMMAND_LONG_DATA, CommandResult> {
        let mode = |mode: FlightMode| set_mode(kind, mode).ok_or(CommandResult::NoAutopilot);
        match self {
            Self::Arm => Ok(arm(1.0)),
            Self::Disarm => Ok(arm(0.0)),
            Self::Takeoff { height_m } if !height_m.is_finite() => Err(CommandResult::NotFinite),
            Self::Takeoff { height_m } => match kind {
                AutopilotKind::Px4 => {
                    let home = home_height_m.ok_or(CommandResult::NoHome)?;
                    Ok(take_off(f32::NAN, home + height_m))
                }
                AutopilotKind::ArduPilot => Ok(take_off(0.0, height_m)),
                AutopilotKind::Other => Err(CommandResult::NoAutopilot),
            },
            Self::Offboard => mode(FlightMode::Offboard),
            Self::Land => mode(FlightMode::Land),
            Self::Return => mode(FlightMode::Return),
            Self::Hold => mode(FlightMode::Hold),
            Self::StartMission => mode(FlightMode::Mission),
        }
    }
}

fn arm(param1: f32) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA { command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, param1, ..Default::default() }
}

/// `here` is what the autopilot reads as "at this place, with this heading": NaN for PX4, 0 for ArduPilot.
fn take_off(here: f32, height_m: f64) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_NAV_TAKEOFF,
        param4: here,
        param5: here,
        param6: here,
        param7: height_m as f32,
        ..Default::default()
    }
}

fn set_mode(kind: AutopilotKind, mode: FlightMode) -> Option<COMMAND_LONG_DATA> {
    let (main, sub) = mode.set_mode_params(kind)?;
    Some(COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_DO_SET_MODE,
        // MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        param1: 1.0,
        param2: f32::from(main),
        param3: f32::from(sub),
        ..Default::default()
    })
}
