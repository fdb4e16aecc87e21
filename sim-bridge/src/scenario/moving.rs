//! How an obstacle of a scenario file moves.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::{Deserializer, Error, Unexpected};
use skein_world::{Stop, Way};

/// Speed between way points where none is given, m/s.
const DEFAULT_SPEED_M_S: f64 = 1.0;

/// One number for all legs, or one for each.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
enum OneOrEach {
    One(f64),
    Each(Vec<f64>),
}

/// A way as a scenario file states it.
#[derive(Debug, Clone, Default)]
pub struct Moves {
    pub velocity_m_s: Option<Vector3<f64>>,
    pub waypoints_m: Vec<Vector3<f64>>,
    pub speed_m_s: Option<Vec<f64>>,
    pub waits_s: Option<Vec<f64>>,
    pub loops: bool,
}

impl Moves {
    /// The way from a place; `None` of what stands.
    ///
    /// # Errors
    /// The field at fault, and what was expected of it.
    pub fn way(&self, from: Vector3<f64>) -> Result<Option<Way>, (&'static str, String)> {
        if let Some(velocity) = self.velocity_m_s {
            let alone = "expected either velocity_m_s or waypoints_m, and speed_m_s, waits_s and loops beside the latter";
            let stands_alone = self.waypoints_m.is_empty() && !self.has_more();
            return if stands_alone {
                Ok(Some(Way::straight(from, velocity)))
            } else {
                Err(("velocity_m_s", alone.to_owned()))
            };
        }
        if self.waypoints_m.is_empty() {
            let unused = "expected waypoints_m beside speed_m_s, waits_s and loops: it goes nowhere";
            return if self.has_more() { Err(("waypoints_m", unused.to_owned())) } else { Ok(None) };
        }
        let speeds = self.of_each("speed_m_s", self.speed_m_s.as_deref(), DEFAULT_SPEED_M_S)?;
        let waits = self.of_each("waits_s", self.waits_s.as_deref(), 0.0)?;
        let stops = self.waypoints_m.iter().zip(speeds).zip(waits);
        let stops: Vec<_> =
            stops.map(|((at, speed_m_s), waits_s)| Stop { at: *at, speed_m_s, waits_s }).collect();
        Ok(Some(Way::through(from, &stops, self.loops)))
    }

    fn has_more(&self) -> bool {
        self.speed_m_s.is_some() || self.waits_s.is_some() || self.loops
    }

    /// The number of each way point: the one that is given for all, or its own.
    fn of_each(
        &self,
        field: &'static str,
        given: Option<&[f64]>,
        default: f64,
    ) -> Result<Vec<f64>, (&'static str, String)> {
        let count = self.waypoints_m.len();
        match given {
            None => Ok(vec![default; count]),
            Some([one]) => Ok(vec![*one; count]),
            Some(each) if each.len() == count => Ok(each.to_vec()),
            Some(each) => {
                let message =
                    format!("{} numbers: expected one, or one for each of {count} waypoints_m", each.len());
                Err((field, message))
            }
        }
    }
}

/// One number above zero or a list of such, where the field is given.
pub fn speeds<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
    numbers(deserializer, "speeds above 0 m/s", |value| value > 0.0)
}

/// One number of at least zero or a list of such, where the field is given.
pub fn waits<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
    numbers(deserializer, "times of at least 0 s", |value| value >= 0.0)
}

fn numbers<'de, D: Deserializer<'de>>(
    deserializer: D,
    expected: &'static str,
    is_right: fn(f64) -> bool,
) -> Result<Option<Vec<f64>>, D::Error> {
    let values = match OneOrEach::deserialize(deserializer)? {
        OneOrEach::One(value) => vec![value],
        OneOrEach::Each(values) => values,
    };
    match values.iter().find(|value| !(value.is_finite() && is_right(**value))) {
        None => Ok(Some(values)),
        Some(value) => Err(D::Error::invalid_value(Unexpected::Float(*value), &expected)),
    }
}
