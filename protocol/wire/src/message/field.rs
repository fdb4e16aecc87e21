//! Checks of single fields, each naming the field at fault.

use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::Bound;
use skein_dbp::{NodeName, shortened};

use crate::decode_error::DecodeError;
use crate::proto;

pub type Result<T> = std::result::Result<T, DecodeError>;

pub fn node(field: &'static str, name: &str) -> Result<NodeName> {
    NodeName::new(name).map_err(|cause| DecodeError::Name { field, cause })
}

pub fn text(name: &NodeName) -> String {
    name.as_str().into()
}

pub fn ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

pub fn required<T>(field: &'static str, value: Option<T>) -> Result<T> {
    value.ok_or(DecodeError::Missing { field })
}

pub fn out_of_range(field: &'static str, given: impl ToString, expected: &'static str) -> DecodeError {
    DecodeError::Range { field, given: given.to_string(), expected }
}

/// Numbers of epochs, occurrences and synchronisation points start at 1 and stay below 2^63.
pub fn number(field: &'static str, given: u64, least: u64) -> Result<u64> {
    if given >= least && i64::try_from(given).is_ok() {
        Ok(given)
    } else {
        let expected = if least == 0 { "a number below 2^63" } else { "a number from 1 to 2^63 - 1" };
        Err(out_of_range(field, given, expected))
    }
}

pub fn finite(field: &'static str, given: f64) -> Result<f64> {
    if given.is_finite() { Ok(given) } else { Err(out_of_range(field, given, "a finite number")) }
}

pub fn not_negative(field: &'static str, given: f64) -> Result<f64> {
    if given.is_finite() && given >= 0.0 {
        Ok(given)
    } else {
        Err(out_of_range(field, given, "a finite number of at least 0"))
    }
}

pub fn vector(field: &'static str, v: &proto::Vec3) -> Result<Vector3<f64>> {
    Ok(Vector3::new(finite(field, v.x)?, finite(field, v.y)?, finite(field, v.z)?))
}

pub fn at_most(field: &'static str, given: usize, most: usize, expected: &'static str) -> Result<()> {
    if given <= most { Ok(()) } else { Err(out_of_range(field, given, expected)) }
}

/// Lets through so many of something as there may be.
pub fn bounded(field: &'static str, bound: Bound, given: usize) -> Result<()> {
    bound.check(given).map_err(|cause| DecodeError::Bound { field, cause })
}

/// A place in the world, metres ENU.
pub fn place(field: &'static str, v: &proto::Vec3) -> Result<Vector3<f64>> {
    let place = vector(field, v)?;
    let most = Bound::PlaceMetres.most_real();
    match place.iter().find(|coordinate| coordinate.abs() > most) {
        Some(far) => {
            Err(out_of_range(field, far, "at most 1 000 000 m from the world's origin (bound `place_m`)"))
        }
        None => Ok(place),
    }
}

/// A text for people, cut where it is too long: what it says beside matters more.
pub fn words(text: impl Into<String>) -> String {
    let text = text.into();
    let most = Bound::TextBytes.most();
    if text.len() <= most { text } else { shortened(&text, most) }
}

impl From<[f64; 3]> for proto::Vec3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<&Vector3<f64>> for proto::Vec3 {
    fn from(v: &Vector3<f64>) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

/// Turns two enumerations with the same variants into one another.
macro_rules! same_variants {
    ($ours:ident, $theirs:path: $($variant:ident),+) => {
        impl From<$ours> for $theirs {
            fn from(ours: $ours) -> Self {
                match ours {
                    $($ours::$variant => Self::$variant),+
                }
            }
        }

        impl From<$theirs> for $ours {
            fn from(theirs: $theirs) -> Self {
                use $theirs as Theirs;
                match theirs {
                    $(Theirs::$variant => Self::$variant),+
                }
            }
        }
    };
}
pub(super) use same_variants;
