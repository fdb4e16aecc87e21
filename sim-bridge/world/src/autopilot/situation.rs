//! The situation of the vehicle, from which modes and missions decide.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Datum, MissionItem};

use super::estimator::Estimate;
use super::parameters::Settings;
use crate::sensors::SensorReadings;

pub(super) struct Situation<'a> {
    pub(super) now: Duration,
    pub(super) estimate: &'a Estimate,
    /// The error is the reason why the estimate cannot be flown by.
    pub(super) readiness: Result<(), &'static str>,
    pub(super) readings: &'a SensorReadings,
    pub(super) settings: &'a Settings,
    pub(super) datum: &'a Datum,
    pub(super) mission: &'a [MissionItem],
    pub(super) home: Vector3<f64>,
}
