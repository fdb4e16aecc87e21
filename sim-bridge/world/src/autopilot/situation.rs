//! What decisions are made from.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Datum, MissionItem};

use super::estimator::Estimate;
use super::parameters::Settings;
use crate::sensors::SensorReadings;

pub(super) struct Situation<'a> {
    pub(super) now: Duration,
    pub(super) estimate: &'a Estimate,
    /// Why the estimate cannot be flown by, if so.
    pub(super) readiness: Result<(), &'static str>,
    pub(super) readings: &'a SensorReadings,
    pub(super) settings: &'a Settings,
    pub(super) datum: &'a Datum,
    pub(super) mission: &'a [MissionItem],
    pub(super) home: Vector3<f64>,
}
