//! The seam between who knows where the vehicle is and who needs to know.

use std::time::Duration;

use skein_mav::{External, Measured, Stamped, Telemetry};
use skein_positioning::PoseFix;
use skein_wire::Scan;

use super::estimate::Estimate;
use crate::config::PositionSource;

/// Measurements of sensors, beside the autopilot's telemetry.
#[allow(clippy::large_enum_variant)] // A handful are passed on in each tick, and none is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sensed {
    /// An instrument of the autopilot.
    Instrument(Stamped<Measured>),
    /// A pose by markers.
    Markers(PoseFix),
}

/// A source of position can be flown by from now on, or cannot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceNews {
    pub source: PositionSource,
    /// Why it cannot; none if it can.
    pub lost: Option<String>,
}

/// A source of position.
pub trait Positioning: std::fmt::Debug + Send {
    /// The newest estimate, given the newest telemetry of the autopilot.
    fn estimate(&mut self, now: Duration, telemetry: &Telemetry) -> Estimate;

    /// Takes in what a sensor has told.
    fn sense(&mut self, _now: Duration, _sensed: &Sensed) {}

    /// Takes in a lidar scan.
    fn scan(&mut self, _scan: &Scan) {}

    /// Whether it lives on what the autopilot's instruments measure.
    fn wants_measured(&self) -> bool {
        false
    }

    /// From now on the vehicle flies by this source; by none but inertia and flow without one.
    fn fly_by(&mut self, _source: Option<PositionSource>) {}

    /// News of the sources since the last call.
    fn take_news(&mut self) -> Vec<SourceNews> {
        Vec::new()
    }

    /// The estimate as the autopilot should hear it, if it is to fly by it.
    fn external(&self, _now: Duration) -> Option<External> {
        None
    }
}
