//! Any other make: it is listened to, and put into no mode, because its numbers are not known.

use mavlink::dialects::common::{COMMAND_LONG_DATA, HEARTBEAT_DATA};

use super::px4;
use crate::command::CommandResult;
use crate::dialect::{Dialect, Failsafe};
use crate::mode::FlightMode;
use crate::set_point::SetPoint;
use crate::telemetry::Telemetry;

#[derive(Debug)]
pub(super) struct Unknown;

impl Dialect for Unknown {
    fn name(&self) -> &'static str {
        "unknown"
    }

    fn is_spoken_by(&self, _: &HEARTBEAT_DATA) -> bool {
        true
    }

    fn mode(&self, custom_mode: u32) -> FlightMode {
        FlightMode::Other(custom_mode)
    }

    fn mode_numbers(&self, _: FlightMode) -> Option<(u8, u8)> {
        None
    }

    fn take_off(&self, _: f64, _: Option<f64>) -> Result<COMMAND_LONG_DATA, CommandResult> {
        Err(CommandResult::NoAutopilot)
    }

    fn set_point(&self, _: SetPoint, _: &Telemetry, _: &mut Option<f64>) -> Option<SetPoint> {
        None
    }

    fn failsafes(&self) -> &'static [Failsafe] {
        &px4::FAILSAFES_IF_PRESENT
    }
}
