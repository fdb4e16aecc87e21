//! Checks of single scenario fields while they are read, so that an error points at the value in the file.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::{Deserializer, Error, Unexpected};
pub use skein_agent::field::{lease_ms, positive};
use skein_agent::field::{number, within};

/// A finite number of at least zero.
pub fn non_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    number(deserializer, "a number of at least 0", |v| v >= 0.0)
}

/// A number from 0 to below 1.
pub fn share<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    number(deserializer, "a number from 0 to below 1", |v| (0.0..1.0).contains(&v))
}

/// A number from 0 to 1.
pub fn reflectivity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    within(deserializer, "a number from 0 to 1", 0.0..=1.0)
}

/// The time that a message takes, in milliseconds.
pub fn latency_ms<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    within(deserializer, "a number from 0 to 60000", 0.0..=60_000.0)
}

/// A finite number above zero, where the field is given.
pub fn optional_positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    positive(deserializer).map(Some)
}

/// Three finite coordinates: east, north, up.
pub fn point<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vector3<f64>, D::Error> {
    let values = <[f64; 3]>::deserialize(deserializer)?;
    finite::<D::Error>(values).map(Vector3::from)
}

/// The same, where the field is given.
pub fn optional_point<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vector3<f64>>, D::Error> {
    point(deserializer).map(Some)
}

/// Two finite coordinates, east and north: a place on the ground.
pub fn ground_point<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vector3<f64>, D::Error> {
    let [x, y] = <[f64; 2]>::deserialize(deserializer)?;
    finite::<D::Error>([x, y, 0.0]).map(Vector3::from)
}

/// A list of places on the ground.
pub fn ground_points<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Vector3<f64>>, D::Error> {
    let values = Vec::<[f64; 2]>::deserialize(deserializer)?;
    values.into_iter().map(|[x, y]| finite::<D::Error>([x, y, 0.0]).map(Vector3::from)).collect()
}

/// A list of points, each of three finite coordinates.
pub fn points<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Vector3<f64>>, D::Error> {
    let values = Vec::<[f64; 3]>::deserialize(deserializer)?;
    values.into_iter().map(|v| finite::<D::Error>(v).map(Vector3::from)).collect()
}

/// Passes on coordinates of which each is finite.
fn finite<E: Error>(values: [f64; 3]) -> Result<[f64; 3], E> {
    match values.iter().find(|v| !v.is_finite()) {
        None => Ok(values),
        Some(&v) => Err(E::invalid_value(Unexpected::Float(v), &"finite coordinates in metres")),
    }
}

/// Three extents above zero, where the field is given.
pub fn optional_extent<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vector3<f64>>, D::Error> {
    let size = point(deserializer)?;
    match size.iter().find(|v| **v <= 0.0) {
        None => Ok(Some(size)),
        Some(&v) => Err(D::Error::invalid_value(Unexpected::Float(v), &"three extents above 0 metres")),
    }
}
