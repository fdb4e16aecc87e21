//! Checks of single fields while a configuration is read, so that an error points at the value in the file.

use std::ops::RangeInclusive;

use serde::Deserialize;
use serde::de::{Deserializer, Error, Unexpected};

/// A finite number above zero.
pub fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    number(deserializer, "a number above 0", |v| v > 0.0)
}

/// The same, where a number stands at all.
pub fn optional_positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    positive(deserializer).map(Some)
}

pub fn finite<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    number(deserializer, "a number", |_| true)
}

/// A lease, in milliseconds.
pub fn lease_ms<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    within(deserializer, "a number from 100 to 10000", 100.0..=10_000.0)
}

/// A finite number in a range that `expected` puts in words.
pub fn within<'de, D: Deserializer<'de>>(
    deserializer: D,
    expected: &'static str,
    range: RangeInclusive<f64>,
) -> Result<f64, D::Error> {
    number(deserializer, expected, |v| range.contains(&v))
}

/// A finite number that `accept` takes; `expected` says which those are.
pub fn number<'de, D: Deserializer<'de>>(
    deserializer: D,
    expected: &'static str,
    accept: impl Fn(f64) -> bool,
) -> Result<f64, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if value.is_finite() && accept(value) {
        return Ok(value);
    }
    Err(D::Error::invalid_value(Unexpected::Float(value), &expected))
}
