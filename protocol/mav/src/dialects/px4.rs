//! PX4, and Skein's built-in autopilot, which speaks as PX4 does.

use mavlink::dialects::common::{COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd};

use crate::command::CommandResult;
use crate::dialect::Dialect;
use crate::failsafe::Failsafe;
use crate::handling::Handling;
use crate::mode::FlightMode;
use crate::set_point::SetPoint;
use crate::telemetry::Telemetry;

/// Release whose dialect is spoken, as `flight_sw_version` encodes it: 1.13.0, official.
pub(crate) const RELEASE: u32 = 0x010d_00ff;

/// Parameter: how many seconds without set-points count as the loss of the companion.
pub const OFFBOARD_LOSS_TIMEOUT: &str = "COM_OF_LOSS_T";
/// Parameter: what the vehicle then does, by the numbers of [`OffboardLoss`].
pub const OFFBOARD_LOSS_ACTION: &str = "COM_OBL_RC_ACT";

/// Parameter: what acceleration an error of velocity asks for, 1/s.
const VELOCITY_GAIN: &str = "MPC_XY_VEL_P_ACC";
/// Parameter: horizontal acceleration, m/s².
const ACCELERATION: &str = "MPC_ACC_HOR";
/// From an acceleration that is asked for to the tilt that gives it, s: stock, it stops from 3 m/s in 2.1 m.
const TILT_LAG_S: f64 = 0.15;
/// Deceleration that crossings in simulation were sure of, m/s².
const SURE_BRAKE_M_S2: f64 = 2.5;

/// Main and sub-mode of each mode.
const MODES: [(FlightMode, (u8, u8)); 7] = [
    (FlightMode::Manual, (POSITION_CONTROL, 0)),
    (FlightMode::Takeoff, (AUTO, 2)),
    (FlightMode::Hold, (AUTO, 3)),
    (FlightMode::Mission, (AUTO, 4)),
    (FlightMode::Return, (AUTO, 5)),
    (FlightMode::Land, (AUTO, 6)),
    (FlightMode::Offboard, (OFFBOARD, 0)),
];
const POSITION_CONTROL: u8 = 3;
const AUTO: u8 = 4;
const OFFBOARD: u8 = 6;

const FAILSAFES: [Failsafe; 4] = [
    Failsafe {
        parameters: &[OFFBOARD_LOSS_TIMEOUT],
        expected: "at most 2 s without set-points",
        setting: |_| 1.0,
        is_safe: |seconds, _| (0.0..=2.0).contains(&seconds),
        required: true,
    },
    Failsafe {
        parameters: &[OFFBOARD_LOSS_ACTION],
        expected: "position, altitude, return, land or hold (0, 1, 3, 4, 5)",
        setting: |_| 4.0,
        is_safe: |action, _| OffboardLoss::from_number(action).is_some_and(|it| !it.drops_vehicle()),
        required: true,
    },
    // The same without a remote control, up to PX4 1.13: 3 ends the flight, 4 stops the motors.
    Failsafe {
        parameters: &["COM_OBL_ACT"],
        expected: "land, hold or return (0, 1, 2)",
        setting: |_| 0.0,
        is_safe: |action, _| [0.0, 1.0, 2.0].contains(&action),
        required: false,
    },
    Failsafe {
        parameters: &["BAT1_SOURCE", "BAT_SOURCE"],
        expected: "a battery monitor: a power module, another one, or the motor controllers (0, 1, 2)",
        setting: |_| 0.0,
        is_safe: |source, _| [0.0, 1.0, 2.0].contains(&source),
        required: false,
    },
];

/// The same for autopilots of which nothing is known: they probably lack these parameters.
pub(super) const FAILSAFES_IF_PRESENT: [Failsafe; 4] = {
    let [timeout, action, without_remote, battery] = FAILSAFES;
    [timeout.optional(), action.optional(), without_remote, battery]
};

/// The reaction of a vehicle to set-points that stop, in the order of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OffboardLoss {
    /// A pilot flies: position control.
    Position,
    /// A pilot flies: altitude control.
    Altitude,
    /// A pilot flies, without help. Without a pilot the vehicle falls.
    Manual,
    Return,
    Land,
    Hold,
    Terminate,
    Disarm,
}

impl OffboardLoss {
    /// The action with this number of the parameter.
    pub fn from_number(number: f64) -> Option<Self> {
        use OffboardLoss::{Altitude, Disarm, Hold, Land, Manual, Position, Return, Terminate};
        let by_number = [Position, Altitude, Manual, Return, Land, Hold, Terminate, Disarm];
        by_number.into_iter().find(|action| f64::from(*action as u8) == number)
    }

    /// Whether a vehicle without a pilot falls.
    fn drops_vehicle(self) -> bool {
        matches!(self, Self::Manual | Self::Terminate | Self::Disarm)
    }
}

/// PX4's dialect.
#[derive(Debug)]
pub(super) struct Px4;

impl Dialect for Px4 {
    fn name(&self) -> &'static str {
        "PX4"
    }

    fn is_spoken_by(&self, heartbeat: &HEARTBEAT_DATA) -> bool {
        heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_PX4
    }

    fn mode(&self, custom_mode: u32) -> FlightMode {
        mode(custom_mode)
    }

    fn mode_numbers(&self, mode: FlightMode) -> Option<(u8, u8)> {
        MODES.into_iter().find(|(known, _)| *known == mode).map(|(_, numbers)| numbers)
    }

    /// The height is absolute. NaN stands for "here" and "this heading".
    fn take_off(
        &self,
        height_m: f64,
        home_height_m: Option<f64>,
    ) -> Result<COMMAND_LONG_DATA, CommandResult> {
        let home_height_m = home_height_m.ok_or(CommandResult::NoHome)?;
        Ok(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_NAV_TAKEOFF,
            param4: f32::NAN,
            param5: f32::NAN,
            param6: f32::NAN,
            param7: (home_height_m + height_m) as f32,
            ..Default::default()
        })
    }

    fn set_point(&self, wish: SetPoint, _: &Telemetry, _: &mut Option<f64>) -> Option<SetPoint> {
        Some(wish)
    }

    fn handling_parameters(&self) -> &'static [&'static str] {
        &[VELOCITY_GAIN, ACCELERATION]
    }

    /// It follows a velocity like a first-order lag. Skein's built-in autopilot has no such gain, and is as quick as
    /// configured.
    fn handling(&self, parameter: &dyn Fn(&str) -> Option<f64>) -> Option<Handling> {
        let gain = parameter(VELOCITY_GAIN).filter(|gain| *gain > 0.0)?;
        let brake_m_s2 = parameter(ACCELERATION).filter(|accel| *accel > 0.0).unwrap_or(SURE_BRAKE_M_S2);
        Some(Handling {
            brake_m_s2: brake_m_s2.min(SURE_BRAKE_M_S2),
            latency_s: TILT_LAG_S + 1.0 / gain,
            jerk_m_s3: None,
        })
    }

    fn failsafes(&self) -> &'static [Failsafe] {
        &FAILSAFES
    }
}

/// The mode behind a `custom_mode`, which has the main mode in bits 16-23 and the sub-mode in bits 24-31.
pub(crate) fn mode(custom_mode: u32) -> FlightMode {
    let [_, _, main, sub] = custom_mode.to_le_bytes();
    mode_of(main, sub).unwrap_or(FlightMode::Other(custom_mode))
}

/// The mode with this main and sub-mode.
pub(crate) fn mode_of(main: u8, sub: u8) -> Option<FlightMode> {
    match main {
        OFFBOARD => Some(FlightMode::Offboard),
        // MANUAL, ALTCTL, POSCTL, ACRO, STABILIZED, RATTITUDE: a pilot's stick modes.
        1 | 2 | POSITION_CONTROL | 5 | 7 | 8 => Some(FlightMode::Manual),
        _ => MODES.into_iter().find(|(_, numbers)| *numbers == (main, sub)).map(|(mode, _)| mode),
    }
}

/// The `custom_mode` of a heartbeat in this mode.
pub(crate) fn custom_mode(mode: FlightMode) -> u32 {
    match (mode, Px4.mode_numbers(mode)) {
        (FlightMode::Other(number), _) => number,
        (_, Some((main, sub))) => u32::from(main) << 16 | u32::from(sub) << 24,
        (_, None) => 0,
    }
}
