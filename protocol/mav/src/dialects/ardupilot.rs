//! ArduPilot's copters.

use mavlink::dialects::common::{COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd};
use nalgebra::Vector3;

use super::px4;
use crate::axes;
use crate::command::CommandResult;
use crate::dialect::{Dialect, Failsafe};
use crate::mode::FlightMode;
use crate::parameter::ParameterEncoding;
use crate::set_point::SetPoint;
use crate::telemetry::Telemetry;

// Modes.
const AUTO: u8 = 3;
const GUIDED: u8 = 4;
const LOITER: u8 = 5;
const RTL: u8 = 6;
const LAND: u8 = 9;
const POSHOLD: u8 = 16;
const BRAKE: u8 = 17;
const SMART_RTL: u8 = 21;

/// Gain from height error to climb where planar set-points become velocities, 1/s.
const PLANAR_CLIMB_GAIN: f64 = 1.0;
/// Fastest climb or descent then, m/s.
const PLANAR_MAX_CLIMB_M_S: f64 = 1.5;

/// ArduPilot's dialect. It cuts a mode's number to 8 bits: PX4's offboard would be STABILIZE to it.
#[derive(Debug)]
pub(super) struct ArduPilot;

impl Dialect for ArduPilot {
    fn name(&self) -> &'static str {
        "ArduPilot"
    }

    fn is_spoken_by(&self, heartbeat: &HEARTBEAT_DATA) -> bool {
        heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA
    }

    fn mode(&self, custom_mode: u32) -> FlightMode {
        match u8::try_from(custom_mode) {
            Ok(GUIDED) => FlightMode::Offboard,
            Ok(BRAKE) => FlightMode::Hold,
            Ok(LAND) => FlightMode::Land,
            Ok(RTL | SMART_RTL) => FlightMode::Return,
            Ok(AUTO) => FlightMode::Mission,
            // STABILIZE, ACRO, ALT_HOLD, LOITER, DRIFT, SPORT, POSHOLD: all follow the sticks.
            Ok(0..=2 | LOITER | 11 | 13 | POSHOLD) => FlightMode::Manual,
            _ => FlightMode::Other(custom_mode),
        }
    }

    fn mode_numbers(&self, mode: FlightMode) -> Option<(u8, u8)> {
        let number = match mode {
            FlightMode::Offboard => GUIDED,
            // LOITER would read the absent throttle stick as "descend".
            FlightMode::Hold => BRAKE,
            FlightMode::Land => LAND,
            FlightMode::Return => RTL,
            FlightMode::Mission => AUTO,
            FlightMode::Manual => POSHOLD,
            // Take-off is a command given in GUIDED, not a mode.
            FlightMode::Takeoff | FlightMode::Other(_) => return None,
        };
        Some((number, 0))
    }

    /// The height counts from home. The other parameters stay 0: NaN is not understood.
    fn take_off(&self, height_m: f64, _: Option<f64>) -> Result<COMMAND_LONG_DATA, CommandResult> {
        Ok(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_NAV_TAKEOFF,
            param7: height_m as f32,
            ..Default::default()
        })
    }

    /// A set-point with partial axes stops the vehicle, and one without heading turns the nose: planar ones
    /// become full velocities, and an open heading the one the vehicle had.
    fn set_point(
        &self,
        wish: SetPoint,
        telemetry: &Telemetry,
        kept_yaw: &mut Option<f64>,
    ) -> Option<SetPoint> {
        let nose = || telemetry.attitude.map(|attitude| axes::yaw(&attitude.value));
        *kept_yaw = wish.yaw().or(*kept_yaw).or_else(nose);
        let yaw = *kept_yaw;
        Some(match wish {
            SetPoint::Planar { vx, vy, z, .. } => {
                let climb = PLANAR_CLIMB_GAIN * (z - telemetry.position?.value.z);
                let vz = climb.clamp(-PLANAR_MAX_CLIMB_M_S, PLANAR_MAX_CLIMB_M_S);
                SetPoint::Velocity { velocity: Vector3::new(vx, vy, vz), yaw }
            }
            SetPoint::Velocity { velocity, .. } => SetPoint::Velocity { velocity, yaw },
            SetPoint::Position { position, .. } => SetPoint::Position { position, yaw },
        })
    }

    fn parameter_encoding(&self) -> ParameterEncoding {
        ParameterEncoding::Cast
    }

    /// None of its own are read so far.
    fn failsafes(&self) -> &'static [Failsafe] {
        &px4::FAILSAFES_IF_PRESENT
    }
}
