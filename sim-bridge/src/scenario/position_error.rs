//! `[position_error]` and `[[position_fault]]`: how far vehicles are from where they believe to be.

use std::time::Duration;

use nalgebra::Vector3;
use serde::Deserialize;
use skein_world::{Drift, PositionFault, PositionFaultKind};

use super::field;

/// The longest that estimates may be late, s.
const LATEST_S: f64 = 10.0;

/// The drift of a vehicle's position.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionErrorTable {
    /// Standard deviation east and north, m.
    #[serde(deserialize_with = "field::non_negative")]
    sigma_m: f64,
    #[serde(default = "correlation_s", deserialize_with = "field::positive")]
    correlation_s: f64,
    /// Standard deviation of height as a share of `sigma_m`.
    #[serde(default = "vertical", deserialize_with = "field::non_negative")]
    vertical: f64,
    /// The horizontal standard deviation that the autopilot tells, m, and of height as much less; the truth if left
    /// out.
    #[serde(default, deserialize_with = "field::optional_positive")]
    told_m: Option<f64>,
}

fn correlation_s() -> f64 {
    60.0
}

fn vertical() -> f64 {
    0.5
}

impl From<PositionErrorTable> for Drift {
    fn from(table: PositionErrorTable) -> Self {
        let PositionErrorTable { sigma_m, correlation_s, vertical, told_m } = table;
        Self {
            sigma_m,
            sigma_vertical_m: vertical * sigma_m,
            correlation_s,
            told_m: told_m.map(|told_m| [told_m, vertical * told_m]),
        }
    }
}

/// One fault of one vehicle, or of all.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionFaultTable {
    #[serde(deserialize_with = "field::non_negative")]
    at_s: f64,
    #[serde(default, deserialize_with = "field::optional_positive")]
    for_s: Option<f64>,
    /// The vehicle's number, from 1; all if left out.
    pub vehicle: Option<usize>,
    #[serde(default, deserialize_with = "optional_point")]
    jump_m: Option<Vector3<f64>>,
    #[serde(default, deserialize_with = "optional_point")]
    origin_moves_m: Option<Vector3<f64>>,
    #[serde(default, deserialize_with = "late_s")]
    late_s: Option<f64>,
    #[serde(default)]
    freezes: bool,
    #[serde(default)]
    gps_lost: bool,
    /// East, north and radius of where there are no satellites.
    #[serde(default, deserialize_with = "optional_point")]
    jammed_m: Option<Vector3<f64>>,
    #[serde(default)]
    markers_missed: bool,
    #[serde(default)]
    flow_lost: bool,
    #[serde(default)]
    resets: bool,
}

fn optional_point<'de, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Vector3<f64>>, D::Error> {
    field::point(deserializer).map(Some)
}

fn late_s<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    skein_agent::field::within(deserializer, "a number of seconds from 0 to 10", 0.0..=LATEST_S).map(Some)
}

impl PositionFaultTable {
    /// The fault; `None` if the table names none, or more than one.
    pub fn fault(&self) -> Option<PositionFault> {
        let kinds = [
            self.jump_m.map(PositionFaultKind::Jump),
            self.origin_moves_m.map(PositionFaultKind::OriginMoves),
            self.late_s.map(|late_s| PositionFaultKind::Late(Duration::from_secs_f64(late_s))),
            self.freezes.then_some(PositionFaultKind::Freezes),
            self.gps_lost.then_some(PositionFaultKind::GpsLost),
            self.jammed_m.map(|at| PositionFaultKind::Jammed { centre: at.xy(), radius_m: at.z }),
            self.markers_missed.then_some(PositionFaultKind::MarkersMissed),
            self.flow_lost.then_some(PositionFaultKind::FlowLost),
            self.resets.then_some(PositionFaultKind::Resets),
        ];
        let mut kinds = kinds.into_iter().flatten();
        let (kind, None) = (kinds.next()?, kinds.next()) else { return None };
        // Later than any run.
        let time =
            |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::from_secs(1 << 32));
        Some(PositionFault { at: time(self.at_s), lasts: self.for_s.map(time), kind })
    }
}
