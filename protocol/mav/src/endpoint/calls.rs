//! Commands as they arrive at an autopilot: what they mean, and which of them are repetitions.

use std::collections::VecDeque;
use std::time::Duration;

use mavlink::dialects::common::{COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame};
use nalgebra::Vector3;

use super::request::AutopilotCommand;
use crate::address::Address;
use crate::command::CommandResult;
use crate::dialects::px4;
use crate::geodesy::{Datum, Geodetic};
use crate::mode::FlightMode;

/// A repetition comes this soon after the original, or it is a new command.
const REPETITION: Duration = Duration::from_secs(5);
/// Number of commands remembered.
const MAX_REMEMBERED: usize = 16;
/// Parameter 2 of an arm or disarm command that overrides the checks.
const FORCE: f64 = 21196.0;

/// A command from a station, whichever of the two messages it came in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Call {
    pub(super) from: Address,
    pub(super) command: MavCmd,
    /// Parameters 1 to 7; a latitude and a longitude are in degrees.
    pub(super) params: [f64; 7],
    /// Whether parameter 7 counts from home rather than from the vertical reference.
    above_home: bool,
    confirmation: u8,
}

impl Call {
    pub(super) fn from_long(from: Address, message: &COMMAND_LONG_DATA) -> Self {
        let params = [
            message.param1,
            message.param2,
            message.param3,
            message.param4,
            message.param5,
            message.param6,
            message.param7,
        ];
        Self {
            from,
            command: message.command,
            params: params.map(f64::from),
            above_home: false,
            confirmation: message.confirmation,
        }
    }

    pub(super) fn from_int(from: Address, message: &COMMAND_INT_DATA) -> Self {
        let [p1, p2, p3, p4] =
            [message.param1, message.param2, message.param3, message.param4].map(f64::from);
        // i32::MAX stands for the NaN that an integer cannot be.
        let degrees = |e7: i32| if e7 == i32::MAX { f64::NAN } else { f64::from(e7) * 1e-7 };
        let above_home = matches!(
            message.frame,
            MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        );
        let [p5, p6, p7] = [degrees(message.x), degrees(message.y), f64::from(message.z)];
        Self {
            from,
            command: message.command,
            params: [p1, p2, p3, p4, p5, p6, p7],
            above_home,
            confirmation: 0,
        }
    }

    /// The wish of the station.
    ///
    /// # Errors
    /// The result to answer with when that is nothing it can do.
    pub(super) fn meaning(&self, datum: &Datum, home_z_m: f64) -> Result<AutopilotCommand, CommandResult> {
        let [p1, p2, p3, ..] = self.params;
        Ok(match self.command {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                let force = p2 == FORCE;
                match p1 {
                    1.0 => AutopilotCommand::Arm { force },
                    0.0 => AutopilotCommand::Disarm { force },
                    _ => return Err(CommandResult::Denied),
                }
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => AutopilotCommand::Takeoff { z_m: self.z(datum, home_z_m) },
            MavCmd::MAV_CMD_NAV_LAND => AutopilotCommand::SetMode(FlightMode::Land),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => AutopilotCommand::SetMode(FlightMode::Return),
            MavCmd::MAV_CMD_NAV_LOITER_UNLIM => AutopilotCommand::SetMode(FlightMode::Hold),
            MavCmd::MAV_CMD_MISSION_START => AutopilotCommand::SetMode(FlightMode::Mission),
            MavCmd::MAV_CMD_DO_PAUSE_CONTINUE if p1 == 0.0 => AutopilotCommand::SetMode(FlightMode::Hold),
            MavCmd::MAV_CMD_DO_PAUSE_CONTINUE => AutopilotCommand::SetMode(FlightMode::Mission),
            // Without MAV_MODE_FLAG_CUSTOM_MODE_ENABLED the numbers are not PX4's.
            MavCmd::MAV_CMD_DO_SET_MODE if (p1 as u8) & 1 == 0 => return Err(CommandResult::Denied),
            MavCmd::MAV_CMD_DO_SET_MODE => px4::mode_of(p2 as u8, p3 as u8)
                .map(AutopilotCommand::SetMode)
                .ok_or(CommandResult::Denied)?,
            MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT => AutopilotCommand::SetMissionItem(p1 as u16),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED if p2.is_finite() && p2 > 0.0 => {
                AutopilotCommand::SetSpeed { speed_m_s: p2 }
            }
            MavCmd::MAV_CMD_DO_SET_HOME if p1 == 1.0 => AutopilotCommand::SetHome { position: None },
            MavCmd::MAV_CMD_DO_SET_HOME => AutopilotCommand::SetHome {
                position: Some(self.place(datum, home_z_m).ok_or(CommandResult::Denied)?),
            },
            MavCmd::MAV_CMD_DO_REPOSITION => {
                AutopilotCommand::GoTo { position: self.place(datum, home_z_m).ok_or(CommandResult::Denied)? }
            }
            _ => return Err(CommandResult::Unsupported),
        })
    }

    /// Parameter 7 as a height in the world, if given.
    fn z(&self, datum: &Datum, home_z_m: f64) -> Option<f64> {
        let [.., height] = self.params;
        let base = if self.above_home { home_z_m } else { -datum.height_m };
        height.is_finite().then_some(base + height)
    }

    /// Parameters 5 to 7 as a world position, if given.
    fn place(&self, datum: &Datum, home_z_m: f64) -> Option<Vector3<f64>> {
        let [.., latitude_deg, longitude_deg, _] = self.params;
        let z = self.z(datum, home_z_m)?;
        let in_range = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0;
        in_range.then(|| {
            datum.to_enu(&Geodetic {
                latitude_rad: latitude_deg.to_radians(),
                longitude_rad: longitude_deg.to_radians(),
                height_m: datum.height_m + z,
            })
        })
    }

    /// Whether the two ask for the same. Bits are compared, because an unused parameter is a NaN.
    fn repeats(&self, other: &Self) -> bool {
        self.from == other.from
            && self.command == other.command
            && self.params.map(f64::to_bits) == other.params.map(f64::to_bits)
    }
}

/// The commands of late and their results, so that a repetition whose acknowledgement was lost is answered
/// again and not obeyed again.
#[derive(Debug, Clone, Default)]
pub(super) struct Remembered {
    calls: VecDeque<(Duration, Call, Option<CommandResult>)>,
}

/// A new call, or one heard before.
pub(super) enum Novelty {
    /// To be obeyed.
    New,
    /// Seen before; its result, once it has one, is to be told again.
    Repetition(Option<CommandResult>),
}

impl Remembered {
    pub(super) fn note(&mut self, now: Duration, call: &Call) -> Novelty {
        if call.confirmation > 0 {
            let known = self
                .calls
                .iter()
                .rev()
                .find(|(at, known, _)| now.saturating_sub(*at) < REPETITION && known.repeats(call));
            if let Some((_, _, result)) = known {
                return Novelty::Repetition(*result);
            }
        }
        if self.calls.len() == MAX_REMEMBERED {
            self.calls.pop_front();
        }
        self.calls.push_back((now, *call, None));
        Novelty::New
    }

    pub(super) fn settle(&mut self, from: Address, command: MavCmd, result: CommandResult) {
        let open = self
            .calls
            .iter_mut()
            .find(|(_, call, settled)| call.from == from && call.command == command && settled.is_none());
        if let Some((_, _, settled)) = open {
            *settled = Some(result);
        }
    }
}
