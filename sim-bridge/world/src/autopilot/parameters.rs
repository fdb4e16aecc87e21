//! The built-in autopilot's parameters: PX4's names and meanings, and the settings the code reads from them.

use std::time::Duration;

use skein_mav::px4::{OFFBOARD_LOSS_ACTION, OFFBOARD_LOSS_TIMEOUT, OffboardLoss};
use skein_mav::{Parameter, ParameterTable, ParameterValue};

use crate::vehicle::VehicleModel;

/// All parameters with their defaults; speeds and accelerations are those of the vehicle.
pub fn default_parameters(model: &VehicleModel) -> ParameterTable {
    let real =
        |name, value: f64, min, max| Parameter { name, value: ParameterValue::Real(value as f32), min, max };
    let whole = |name, value, min, max| Parameter { name, value: ParameterValue::Int(value), min, max };
    ParameterTable::new(vec![
        // Set-points lost: after how many seconds, and then what.
        real(OFFBOARD_LOSS_TIMEOUT, 0.5, 0.1, 60.0),
        whole(OFFBOARD_LOSS_ACTION, 4, 0.0, 7.0),
        // Sticks lost: after how many seconds, and then what (1 hold, 2 return, 3 land).
        real("COM_RC_LOSS_T", 0.5, 0.1, 35.0),
        whole("NAV_RCL_ACT", 2, 1.0, 3.0),
        // Disarm so many seconds after landing, and after arming without a take-off. 0: never.
        real("COM_DISARM_LAND", 1.0, 0.0, 20.0),
        real("COM_DISARM_PRFLT", 10.0, 0.0, 120.0),
        // Battery: warn at LOW; at CRIT do (0 only warn, 2 land, 3 return and land at EMERGEN).
        real("BAT_LOW_THR", 0.15, 0.0, 0.5),
        real("BAT_CRIT_THR", 0.07, 0.0, 0.3),
        real("BAT_EMERGEN_THR", 0.05, 0.0, 0.2),
        whole("COM_LOW_BAT_ACT", 3, 0.0, 3.0),
        // Fence, a cylinder about home in metres, 0: none; when left, do (0 nothing, 1 warn, 2 hold, 3
        // return, 5 land).
        whole("GF_ACTION", 2, 0.0, 5.0),
        real("GF_MAX_HOR_DIST", 0.0, 0.0, 10_000.0),
        real("GF_MAX_VER_DIST", 0.0, 0.0, 10_000.0),
        // Heights above home, m.
        real("MIS_TAKEOFF_ALT", 2.5, 0.5, 80.0),
        real("RTL_RETURN_ALT", 10.0, 0.0, 150.0),
        // Speeds, m/s; acceleration, m/s^2; jerk, m/s^3; tilt, degrees.
        real("MPC_XY_VEL_MAX", model.max_speed_m_s, 0.1, 20.0),
        real("MPC_XY_CRUISE", (0.6 * model.max_speed_m_s).min(5.0), 0.1, 20.0),
        real("MPC_Z_VEL_MAX_UP", model.max_climb_m_s, 0.1, 8.0),
        real("MPC_Z_VEL_MAX_DN", model.max_descent_m_s, 0.1, 8.0),
        real("MPC_TKO_SPEED", model.max_climb_m_s.min(1.5), 0.1, 5.0),
        real("MPC_LAND_SPEED", model.max_descent_m_s.min(0.6), 0.1, 2.0),
        real("MPC_ACC_HOR", model.max_accel_m_s2, 0.5, 15.0),
        real("MPC_JERK_MAX", 40.0, 1.0, 500.0),
        real("MPC_TILTMAX_AIR", model.max_tilt_rad.to_degrees(), 5.0, 60.0),
        // A waypoint counts as reached within so many metres.
        real("NAV_ACC_RAD", 0.5, 0.05, 200.0),
    ])
}

/// The reaction to lost set-points or sticks, a fence that was left, or a low battery.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FailsafeAction {
    Warn,
    Hold,
    Return,
    Land,
    /// The motors stop, wherever the vehicle is.
    Disarm,
}

/// The parameters in the form the code uses.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Settings {
    pub(super) set_point_timeout: Duration,
    pub(super) set_point_loss_action: FailsafeAction,
    pub(super) stick_timeout: Duration,
    pub(super) stick_loss_action: FailsafeAction,
    /// `None`: never.
    pub(super) disarm_after_landing: Option<Duration>,
    /// `None`: never.
    pub(super) disarm_before_takeoff: Option<Duration>,
    pub(super) battery_low: f64,
    pub(super) battery_critical: f64,
    pub(super) battery_emergency: f64,
    pub(super) battery_critical_action: FailsafeAction,
    /// `None`: the fence is off.
    pub(super) fence_action: Option<FailsafeAction>,
    pub(super) fence_radius_m: f64,
    pub(super) fence_height_m: f64,
    pub(super) takeoff_height_m: f64,
    pub(super) return_height_m: f64,
    pub(super) max_speed_m_s: f64,
    pub(super) cruise_speed_m_s: f64,
    pub(super) max_climb_m_s: f64,
    pub(super) max_descent_m_s: f64,
    pub(super) takeoff_speed_m_s: f64,
    pub(super) landing_speed_m_s: f64,
    pub(super) max_accel_m_s2: f64,
    pub(super) max_jerk_m_s3: f64,
    pub(super) max_tilt_rad: f64,
    pub(super) waypoint_radius_m: f64,
}

impl Settings {
    /// Reads the table. A name it does not have, as in a table made by hand, reads as 0, and an action as a
    /// warning.
    pub(super) fn read(table: &ParameterTable) -> Self {
        let real = |name| table.get(name).unwrap_or(0.0);
        let whole = |name| real(name) as i32;
        let time = |name| Duration::from_secs_f64(real(name).clamp(0.0, 1e6));
        let some_time = |name| Some(time(name)).filter(|time| !time.is_zero());
        Self {
            set_point_timeout: time(OFFBOARD_LOSS_TIMEOUT),
            set_point_loss_action: set_point_loss_action(OffboardLoss::from_number(real(
                OFFBOARD_LOSS_ACTION,
            ))),
            stick_timeout: time("COM_RC_LOSS_T"),
            stick_loss_action: match whole("NAV_RCL_ACT") {
                1 => FailsafeAction::Hold,
                3 => FailsafeAction::Land,
                _ => FailsafeAction::Return,
            },
            disarm_after_landing: some_time("COM_DISARM_LAND"),
            disarm_before_takeoff: some_time("COM_DISARM_PRFLT"),
            battery_low: real("BAT_LOW_THR"),
            battery_critical: real("BAT_CRIT_THR"),
            battery_emergency: real("BAT_EMERGEN_THR"),
            battery_critical_action: match whole("COM_LOW_BAT_ACT") {
                2 => FailsafeAction::Land,
                3 => FailsafeAction::Return,
                _ => FailsafeAction::Warn,
            },
            fence_action: match whole("GF_ACTION") {
                0 => None,
                1 => Some(FailsafeAction::Warn),
                3 => Some(FailsafeAction::Return),
                4 | 5 => Some(FailsafeAction::Land),
                _ => Some(FailsafeAction::Hold),
            },
            fence_radius_m: real("GF_MAX_HOR_DIST"),
            fence_height_m: real("GF_MAX_VER_DIST"),
            takeoff_height_m: real("MIS_TAKEOFF_ALT"),
            return_height_m: real("RTL_RETURN_ALT"),
            max_speed_m_s: real("MPC_XY_VEL_MAX"),
            cruise_speed_m_s: real("MPC_XY_CRUISE"),
            max_climb_m_s: real("MPC_Z_VEL_MAX_UP"),
            max_descent_m_s: real("MPC_Z_VEL_MAX_DN"),
            takeoff_speed_m_s: real("MPC_TKO_SPEED"),
            landing_speed_m_s: real("MPC_LAND_SPEED"),
            max_accel_m_s2: real("MPC_ACC_HOR"),
            max_jerk_m_s3: real("MPC_JERK_MAX"),
            max_tilt_rad: real("MPC_TILTMAX_AIR").to_radians(),
            waypoint_radius_m: real("NAV_ACC_RAD"),
        }
    }
}

/// In a pilot's mode the vehicle holds until sticks come.
fn set_point_loss_action(configured: Option<OffboardLoss>) -> FailsafeAction {
    use OffboardLoss::{Altitude, Disarm, Hold, Land, Manual, Position, Return, Terminate};
    match configured {
        Some(Position | Altitude | Manual | Hold) => FailsafeAction::Hold,
        Some(Return) => FailsafeAction::Return,
        Some(Terminate | Disarm) => FailsafeAction::Disarm,
        Some(Land) | None => FailsafeAction::Land,
    }
}
