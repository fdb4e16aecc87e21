//! A dialect is everything that the makes of autopilot do differently. Each make's is one file of
//! [`crate::dialects`]; no other file asks which make it talks to.

use std::time::Duration;

use mavlink::MessageData as _;
use mavlink::dialects::common::{COMMAND_LONG_DATA, ESTIMATOR_STATUS_DATA, HEARTBEAT_DATA, MavCmd};

use crate::command::{Command, CommandResult};
use crate::external::External;
use crate::failsafe::Failsafe;
use crate::frame::FrameWriter;
use crate::geodesy::LocalFrame;
use crate::handling::Handling;
use crate::mode::FlightMode;
use crate::parameter::ParameterEncoding;
use crate::set_point::SetPoint;
use crate::telemetry::Telemetry;

/// The language between a companion and one make of autopilot. It keeps no state: one value serves every
/// link. What a method does unless a dialect says otherwise is right for a make of which nothing is known.
pub trait Dialect: std::fmt::Debug + Send + Sync {
    /// Name of the make.
    fn name(&self) -> &'static str;

    /// Whether the sender of this heartbeat is of this make.
    fn is_spoken_by(&self, heartbeat: &HEARTBEAT_DATA) -> bool;

    /// The mode behind the `custom_mode` of a heartbeat.
    fn mode(&self, custom_mode: u32) -> FlightMode {
        FlightMode::Other(custom_mode)
    }

    /// Parameters 2 and 3 of `MAV_CMD_DO_SET_MODE`: main and sub-mode. `None` for a mode that the make does
    /// not have, or that no number leads to.
    fn mode_numbers(&self, _mode: FlightMode) -> Option<(u8, u8)> {
        None
    }

    /// The command to climb to `height_m` above home, where home is `home_height_m` above the vertical
    /// reference.
    ///
    /// # Errors
    /// The reason why it cannot be sent.
    fn take_off(
        &self,
        _height_m: f64,
        _home_height_m: Option<f64>,
    ) -> Result<COMMAND_LONG_DATA, CommandResult> {
        Err(CommandResult::NoAutopilot)
    }

    /// The commands that bring a vehicle from the ground to its climb in offboard mode, in order. Each is given once
    /// the one before is acknowledged. Where none is to take off, set-points lift the vehicle.
    fn launch(&self, _height_m: f64) -> Vec<Command> {
        vec![Command::Offboard, Command::Arm]
    }

    /// The time for which set-points must arrive before [`Command::Offboard`] is given.
    fn set_points_before_offboard(&self) -> Duration {
        Duration::from_millis(300)
    }

    /// A set-point with the axes that this make can fly. `kept_yaw` is the heading of the set-point before,
    /// for a make that turns the nose unless told where it belongs. `None` if nothing can be sent.
    fn set_point(
        &self,
        _wish: SetPoint,
        _telemetry: &Telemetry,
        _kept_yaw: &mut Option<f64>,
    ) -> Option<SetPoint> {
        None
    }

    /// Writes what tells the autopilot an estimate of its motion, at `time` on the companion's clock. Returns whether it
    /// did: not if a number is none.
    fn external(
        &self,
        time: Duration,
        external: &External,
        local: &LocalFrame,
        output: &mut FrameWriter,
    ) -> bool {
        external.odometry(time, local).map(|odometry| output.write(&odometry)).is_some()
    }

    /// The message that tells how good the estimate is.
    fn estimator_message(&self) -> u32 {
        ESTIMATOR_STATUS_DATA::ID
    }

    /// The parameters on which its handling hangs.
    fn handling_parameters(&self) -> &'static [&'static str] {
        &[]
    }

    /// Its handling, from its parameters, as far as it has them; `None` if nothing is known of that.
    fn handling(&self, _parameter: &dyn Fn(&str) -> Option<f64>) -> Option<Handling> {
        None
    }

    /// The way integers are written into parameter messages.
    fn parameter_encoding(&self) -> ParameterEncoding {
        ParameterEncoding::Bytewise
    }

    /// The parameters on which hangs what becomes of a vehicle that loses its companion or its energy.
    fn failsafes(&self) -> &'static [Failsafe];

    /// Safe values of all these parameters, for a companion of this system id.
    fn safe_settings(&self, system_id: u8) -> Vec<(&'static str, f64)> {
        let of_one = |failsafe: &Failsafe| {
            let value = (failsafe.setting)(system_id);
            failsafe.parameters.iter().map(move |name| (*name, value))
        };
        self.failsafes().iter().flat_map(of_one).collect()
    }

    /// The message that gives a command; see [`Dialect::take_off`] for `home_height_m`.
    ///
    /// # Errors
    /// The reason why it cannot be sent.
    fn encode(
        &self,
        command: Command,
        home_height_m: Option<f64>,
    ) -> Result<COMMAND_LONG_DATA, CommandResult> {
        let mode = match command {
            Command::Arm => return Ok(arm(1.0)),
            Command::Disarm => return Ok(arm(0.0)),
            Command::Takeoff { height_m } if !height_m.is_finite() => return Err(CommandResult::NotFinite),
            Command::Takeoff { height_m } => return self.take_off(height_m, home_height_m),
            Command::Offboard => FlightMode::Offboard,
            Command::Land => FlightMode::Land,
            Command::Return => FlightMode::Return,
            Command::Hold => FlightMode::Hold,
            Command::StartMission => FlightMode::Mission,
        };
        let (main, sub) = self.mode_numbers(mode).ok_or(CommandResult::NoAutopilot)?;
        Ok(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_DO_SET_MODE,
            // MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            param1: 1.0,
            param2: f32::from(main),
            param3: f32::from(sub),
            ..Default::default()
        })
    }
}

fn arm(param1: f32) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA { command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, param1, ..Default::default() }
}
