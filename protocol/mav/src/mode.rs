//! Flight modes by name, and the numbers each autopilot gives them.

use mavlink::dialects::common::MavAutopilot;

/// The make of an autopilot, as its heartbeat says. It decides every mode number, so that a number of one is
/// never sent to the other: ArduPilot cuts a custom mode to 8 bits and would take PX4's offboard for
/// STABILIZE.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AutopilotKind {
    /// PX4, or Skein's built-in autopilot, which speaks PX4's dialect.
    Px4,
    ArduPilot,
    /// Another make: it is listened to, never commanded.
    Other,
}

impl From<MavAutopilot> for AutopilotKind {
    fn from(autopilot: MavAutopilot) -> Self {
        match autopilot {
            MavAutopilot::MAV_AUTOPILOT_PX4 => Self::Px4,
            MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA => Self::ArduPilot,
            _ => Self::Other,
        }
    }
}

/// What the autopilot is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlightMode {
    /// A companion computer's set-points are flown (PX4 OFFBOARD, ArduPilot GUIDED).
    Offboard,
    /// Climbing to the take-off height by itself.
    Takeoff,
    /// Staying where it is.
    Hold,
    /// Landing where it is.
    Land,
    /// Flying home to land.
    Return,
    /// Flying the uploaded mission by itself.
    Mission,
    /// A pilot flies, in whatever assisted mode.
    Manual,
    /// Anything else, by the autopilot's own number; `Other(0)` before its first heartbeat.
    Other(u32),
}

impl std::fmt::Display for FlightMode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Offboard => "offboard",
            Self::Takeoff => "takeoff",
            Self::Hold => "hold",
            Self::Land => "land",
            Self::Return => "return",
            Self::Mission => "mission",
            Self::Manual => "manual",
            Self::Other(number) => return write!(f, "mode {number}"),
        })
    }
}

impl FlightMode {
    /// The mode behind the `custom_mode` of a heartbeat.
    pub fn from_custom(kind: AutopilotKind, custom_mode: u32) -> Self {
        match kind {
            AutopilotKind::Px4 => px4::mode(custom_mode),
            AutopilotKind::ArduPilot => ardupilot::mode(custom_mode),
            AutopilotKind::Other => Self::Other(custom_mode),
        }
    }

    /// Parameters 2 and 3 of `MAV_CMD_DO_SET_MODE` for this mode, if the autopilot has it and can be put in
    /// it by number.
    pub(crate) fn set_mode_params(self, kind: AutopilotKind) -> Option<(u8, u8)> {
        match kind {
            AutopilotKind::Px4 => px4::main_and_sub(self),
            AutopilotKind::ArduPilot => ardupilot::number(self).map(|number| (number, 0)),
            AutopilotKind::Other => None,
        }
    }

    /// The `custom_mode` of a PX4 heartbeat in this mode.
    pub fn to_px4_custom(self) -> u32 {
        match (self, px4::main_and_sub(self)) {
            (Self::Other(number), _) => number,
            (_, Some((main, sub))) => u32::from(main) << 16 | u32::from(sub) << 24,
            (_, None) => 0,
        }
    }
}

/// PX4: `custom_mode` has the main mode in bits 16-23 and the sub-mode in bits 24-31.
pub(crate) mod px4 {
    use super::FlightMode;

    /// Main mode AUTO; its sub-modes follow.
    const AUTO: u8 = 4;
    const OFFBOARD: u8 = 6;
    const POSITION_CONTROL: u8 = 3;
    const AUTO_TAKEOFF: u8 = 2;
    const AUTO_LOITER: u8 = 3;
    const AUTO_MISSION: u8 = 4;
    const AUTO_RETURN: u8 = 5;
    const AUTO_LAND: u8 = 6;

    pub(super) fn mode(custom_mode: u32) -> FlightMode {
        let [_, _, main, sub] = custom_mode.to_le_bytes();
        mode_of(main, sub).unwrap_or(FlightMode::Other(custom_mode))
    }

    /// The mode with this main and sub-mode number, as `MAV_CMD_DO_SET_MODE` gives them.
    pub(crate) fn mode_of(main: u8, sub: u8) -> Option<FlightMode> {
        match (main, sub) {
            (OFFBOARD, _) => Some(FlightMode::Offboard),
            (AUTO, AUTO_TAKEOFF) => Some(FlightMode::Takeoff),
            (AUTO, AUTO_LOITER) => Some(FlightMode::Hold),
            (AUTO, AUTO_MISSION) => Some(FlightMode::Mission),
            (AUTO, AUTO_RETURN) => Some(FlightMode::Return),
            (AUTO, AUTO_LAND) => Some(FlightMode::Land),
            // MANUAL, ALTCTL, POSCTL, ACRO, STABILIZED, RATTITUDE: a pilot's stick modes.
            (1 | 2 | POSITION_CONTROL | 5 | 7 | 8, _) => Some(FlightMode::Manual),
            _ => None,
        }
    }

    pub(super) fn main_and_sub(mode: FlightMode) -> Option<(u8, u8)> {
        match mode {
            FlightMode::Offboard => Some((OFFBOARD, 0)),
            FlightMode::Takeoff => Some((AUTO, AUTO_TAKEOFF)),
            FlightMode::Hold => Some((AUTO, AUTO_LOITER)),
            FlightMode::Land => Some((AUTO, AUTO_LAND)),
            FlightMode::Return => Some((AUTO, AUTO_RETURN)),
            FlightMode::Mission => Some((AUTO, AUTO_MISSION)),
            FlightMode::Manual => Some((POSITION_CONTROL, 0)),
            FlightMode::Other(_) => None,
        }
    }
}

/// ArduCopter: one small number each.
mod ardupilot {
    use super::FlightMode;

    const AUTO: u8 = 3;
    const GUIDED: u8 = 4;
    const LOITER: u8 = 5;
    const RTL: u8 = 6;
    const LAND: u8 = 9;
    const POSHOLD: u8 = 16;
    const BRAKE: u8 = 17;
    const SMART_RTL: u8 = 21;

    pub(super) fn mode(custom_mode: u32) -> FlightMode {
        let Ok(number) = u8::try_from(custom_mode) else {
            return FlightMode::Other(custom_mode);
        };
        match number {
            GUIDED => FlightMode::Offboard,
            BRAKE => FlightMode::Hold,
            LAND => FlightMode::Land,
            RTL | SMART_RTL => FlightMode::Return,
            AUTO => FlightMode::Mission,
            // STABILIZE, ACRO, ALT_HOLD, LOITER, DRIFT, SPORT, POSHOLD: all follow the sticks.
            0..=2 | LOITER | 11 | 13 | POSHOLD => FlightMode::Manual,
            _ => FlightMode::Other(custom_mode),
        }
    }

    pub(super) fn number(mode: FlightMode) -> Option<u8> {
        match mode {
            // Take-off is a command given in GUIDED, not a mode.
            FlightMode::Offboard => Some(GUIDED),
            // LOITER would read the absent throttle stick as "descend".
            FlightMode::Hold => Some(BRAKE),
            FlightMode::Land => Some(LAND),
            FlightMode::Return => Some(RTL),
            FlightMode::Mission => Some(AUTO),
            FlightMode::Manual => Some(POSHOLD),
            FlightMode::Takeoff | FlightMode::Other(_) => None,
        }
    }
}
