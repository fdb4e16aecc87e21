//! The list of dialects, from which an autopilot's heartbeat chooses.

mod ardupilot;
pub mod px4;

use mavlink::dialects::common::HEARTBEAT_DATA;

use crate::dialect::Dialect;
use crate::failsafe::Failsafe;

/// All makes of autopilot that can be commanded.
pub static DIALECTS: [&dyn Dialect; 2] = [&px4::Px4, &ardupilot::ArduPilot];

/// ArduPilot's dialect, for who starts one.
pub static ARDUPILOT: &dyn Dialect = &ardupilot::ArduPilot;

/// The dialect of an autopilot as long as none of [`DIALECTS`] is recognised.
pub(crate) static UNKNOWN: &dyn Dialect = &Unknown;

/// The dialect of the autopilot that sent this heartbeat.
pub(crate) fn of(heartbeat: &HEARTBEAT_DATA) -> &'static dyn Dialect {
    DIALECTS.into_iter().find(|dialect| dialect.is_spoken_by(heartbeat)).unwrap_or(UNKNOWN)
}

/// A make that is listened to, and put into no mode.
#[derive(Debug)]
struct Unknown;

impl Dialect for Unknown {
    fn name(&self) -> &'static str {
        "unknown"
    }

    fn is_spoken_by(&self, _: &HEARTBEAT_DATA) -> bool {
        true
    }

    fn failsafes(&self) -> &'static [Failsafe] {
        &px4::FAILSAFES_IF_PRESENT
    }
}
