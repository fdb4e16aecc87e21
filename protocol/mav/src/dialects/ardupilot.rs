//! ArduPilot's copters.

use std::time::Duration;

use mavlink::dialects::common::{COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd};
use nalgebra::Vector3;

use crate::axes;
use crate::command::{Command, CommandResult};
use crate::dialect::Dialect;
use crate::ekf_status;
use crate::external::External;
use crate::failsafe::Failsafe;
use crate::frame::FrameWriter;
use crate::geodesy::LocalFrame;
use crate::handling::Handling;
use crate::mode::FlightMode;
use crate::parameter::ParameterEncoding;
use crate::set_point::SetPoint;
use crate::telemetry::Telemetry;

/// The modes that a number leads to. Take-off is a command given in GUIDED, not a mode.
const MODES: [(FlightMode, u8); 6] = [
    (FlightMode::Mission, 3),
    // GUIDED
    (FlightMode::Offboard, 4),
    (FlightMode::Return, 6),
    (FlightMode::Land, 9),
    // POSHOLD
    (FlightMode::Manual, 16),
    // BRAKE. LOITER would read the absent throttle stick as "descend".
    (FlightMode::Hold, 17),
];

/// Set-points that stop, and then heartbeats that stop: GUIDED alone would hold the vehicle for ever.
const FAILSAFES: [Failsafe; 5] = [
    Failsafe {
        parameters: &["GUID_TIMEOUT"],
        expected: "at most 1 s without set-points",
        setting: |_| 0.5,
        is_safe: |seconds, _| (0.0..=1.0).contains(&seconds),
        required: false,
    },
    Failsafe {
        parameters: &["FS_GCS_ENABLE"],
        expected: "return or land when heartbeats stop (1, 3, 4, 5)",
        setting: |_| 5.0,
        is_safe: |action, _| [1.0, 3.0, 4.0, 5.0].contains(&action),
        required: true,
    },
    Failsafe {
        parameters: &["SYSID_MYGCS", "MAV_GCS_SYSID"],
        expected: "the agent's own heartbeats count (`autopilot.system_id`)",
        setting: |own| own.into(),
        is_safe: |counts, own| counts == f64::from(own),
        required: true,
    },
    Failsafe {
        parameters: &["FS_GCS_TIMEOUT"],
        expected: "at most 5 s without heartbeats",
        setting: |_| 5.0,
        is_safe: |seconds, _| (0.0..=5.0).contains(&seconds),
        required: false,
    },
    Failsafe {
        parameters: &["BATT_MONITOR"],
        expected: "a battery monitor (4: voltage and current)",
        setting: |_| 4.0,
        is_safe: |monitor, _| monitor >= 1.0,
        required: true,
    },
];

/// Parameter: horizontal acceleration, cm/s².
const ACCELERATION: &str = "WPNAV_ACCEL";
const STOCK_ACCELERATION_M_S2: f64 = 2.5;
/// Parameter: change of horizontal acceleration, m/s³.
const JERK: &str = "PSC_JERK_XY";
const STOCK_JERK_M_S3: f64 = 5.0;
/// Time in which it builds a deceleration up, s. With a tenth less it passed a trunk at 3 cm, so at 30 (five forests).
const LATENCY_S: f64 = 0.6;

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

    fn external(
        &self,
        time: Duration,
        external: &External,
        local: &LocalFrame,
        output: &mut FrameWriter,
    ) -> bool {
        let Some((place, speed)) = external.vision(time, local) else { return false };
        output.write(&place);
        output.write(&speed);
        true
    }

    fn estimator_message(&self) -> u32 {
        ekf_status::ID
    }

    fn mode(&self, custom_mode: u32) -> FlightMode {
        match custom_mode {
            // STABILIZE, ACRO, ALT_HOLD, LOITER, DRIFT, SPORT: all follow the sticks.
            0..=2 | 5 | 11 | 13 => FlightMode::Manual,
            // SMART_RTL
            21 => FlightMode::Return,
            _ => MODES
                .into_iter()
                .find(|(_, number)| u32::from(*number) == custom_mode)
                .map_or(FlightMode::Other(custom_mode), |(mode, _)| mode),
        }
    }

    fn mode_numbers(&self, mode: FlightMode) -> Option<(u8, u8)> {
        MODES.into_iter().find(|(known, _)| *known == mode).map(|(_, number)| (number, 0))
    }

    /// The height counts from home. The other parameters stay 0: NaN is not understood.
    fn take_off(&self, height_m: f64, _: Option<f64>) -> Result<COMMAND_LONG_DATA, CommandResult> {
        Ok(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_NAV_TAKEOFF,
            param7: height_m as f32,
            ..Default::default()
        })
    }

    /// GUIDED first: NAV_TAKEOFF is refused in every other mode, and the vehicle then stands armed. Set-points alone
    /// do not lift it.
    fn launch(&self, height_m: f64) -> Vec<Command> {
        vec![Command::Offboard, Command::Arm, Command::Takeoff { height_m }]
    }

    /// No set-points are needed before GUIDED.
    fn set_points_before_offboard(&self) -> Duration {
        Duration::ZERO
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

    fn handling_parameters(&self) -> &'static [&'static str] {
        &[ACCELERATION, JERK]
    }

    /// It needs time to build a deceleration up, and longer while it accelerates. One that lacks a parameter counts as stock.
    fn handling(&self, parameter: &dyn Fn(&str) -> Option<f64>) -> Option<Handling> {
        let accel_m_s2 = parameter(ACCELERATION).filter(|accel| *accel > 0.0).map(|accel| accel / 100.0);
        Some(Handling {
            brake_m_s2: accel_m_s2.unwrap_or(STOCK_ACCELERATION_M_S2).min(STOCK_ACCELERATION_M_S2),
            latency_s: LATENCY_S,
            jerk_m_s3: parameter(JERK).filter(|jerk| *jerk > 0.0).or(Some(STOCK_JERK_M_S3)),
        })
    }

    fn parameter_encoding(&self) -> ParameterEncoding {
        ParameterEncoding::Cast
    }

    fn failsafes(&self) -> &'static [Failsafe] {
        &FAILSAFES
    }
}
