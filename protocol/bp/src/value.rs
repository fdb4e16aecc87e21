//! The values an event's data may hold.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// A 64-bit float that can be compared and hashed.
///
/// Numbers compare as numbers, so `-0.0` is `0.0`. A NaN equals itself; NaNs stand at the ends, as in
/// [`f64::total_cmp`].
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Real(f64);

impl Real {
    /// The number as a plain float.
    pub const fn get(self) -> f64 {
        self.0
    }

    /// The same number as an integer, if it is one.
    fn as_whole(self) -> Option<i64> {
        // 2^63, which is no `i64` any more.
        const END: f64 = 9_223_372_036_854_775_808.0;
        (self.0.trunc() == self.0 && (-END..END).contains(&self.0)).then_some(self.0 as i64)
    }
}

impl From<f64> for Real {
    fn from(value: f64) -> Self {
        Self(value)
    }
}

impl PartialEq for Real {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0 || self.0.to_bits() == other.0.to_bits()
    }
}

impl Eq for Real {}

impl PartialOrd for Real {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Real {
    fn cmp(&self, other: &Self) -> Ordering {
        if self.0 == other.0 { Ordering::Equal } else { self.0.total_cmp(&other.0) }
    }
}

impl Hash for Real {
    fn hash<H: Hasher>(&self, state: &mut H) {
        match self.as_whole() {
            Some(whole) => whole.hash(state),
            None => self.0.to_bits().hash(state),
        }
    }
}

impl fmt::Debug for Real {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for Real {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Debug keeps the point of `3.0`, which tells a real from an integer.
        write!(f, "{:?}", self.0)
    }
}

/// One value in an event's data. Numbers compare as numbers: `Int(2)` is `Real(2.0)`, for TOML, JSON and Python write a
/// number as they please. Values of other kinds are never equal.
#[derive(Clone, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// A truth value.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A real number, in the unit its key names.
    Real(Real),
    Text(Arc<str>),
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Bool(a), Self::Bool(b)) => a == b,
            (Self::Int(a), Self::Int(b)) => a == b,
            (Self::Real(a), Self::Real(b)) => a == b,
            (Self::Text(a), Self::Text(b)) => a == b,
            (Self::Int(whole), Self::Real(real)) | (Self::Real(real), Self::Int(whole)) => {
                real.as_whole() == Some(*whole)
            }
            _ => false,
        }
    }
}

impl Eq for Value {}

impl PartialOrd for Value {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Value {
    fn cmp(&self, other: &Self) -> Ordering {
        match (self, other) {
            (Self::Bool(a), Self::Bool(b)) => a.cmp(b),
            (Self::Int(a), Self::Int(b)) => a.cmp(b),
            (Self::Real(a), Self::Real(b)) => a.cmp(b),
            (Self::Text(a), Self::Text(b)) => a.cmp(b),
            (Self::Int(whole), Self::Real(real)) => compare(*whole, *real),
            (Self::Real(real), Self::Int(whole)) => compare(*whole, *real).reverse(),
            _ => self.rank().cmp(&other.rank()),
        }
    }
}

/// A whole number against a real one, without rounding.
fn compare(whole: i64, real: Real) -> Ordering {
    match real.as_whole() {
        Some(other) => whole.cmp(&other),
        // It has a fraction, so it is small, or it is beyond all whole numbers: rounding does not carry past it.
        None => (whole as f64).total_cmp(&real.0),
    }
}

impl Hash for Value {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.rank().hash(state);
        match self {
            Self::Bool(flag) => flag.hash(state),
            Self::Int(whole) => whole.hash(state),
            Self::Real(real) => real.hash(state),
            Self::Text(text) => text.hash(state),
        }
    }
}

impl Value {
    /// The place of its kind among the kinds.
    const fn rank(&self) -> u8 {
        match self {
            Self::Bool(_) => 0,
            Self::Int(_) | Self::Real(_) => 1,
            Self::Text(_) => 2,
        }
    }

    pub fn as_flag(&self) -> Option<bool> {
        if let Self::Bool(flag) = self { Some(*flag) } else { None }
    }

    pub fn as_text(&self) -> Option<&Arc<str>> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// The whole number held, `2.0` included; `None` for others.
    pub fn as_whole(&self) -> Option<i64> {
        match self {
            Self::Int(whole) => Some(*whole),
            Self::Real(real) => real.as_whole(),
            Self::Bool(_) | Self::Text(_) => None,
        }
    }

    /// The number held, whole or real; `None` for the other kinds.
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Self::Int(n) => Some(*n as f64),
            Self::Real(x) => Some(x.get()),
            Self::Bool(_) | Self::Text(_) => None,
        }
    }
}

macro_rules! from_plain {
    ($($plain:ty => $kind:ident),+) => {
        $(impl From<$plain> for Value {
            fn from(value: $plain) -> Self {
                Self::$kind(value.into())
            }
        })+
    };
}

from_plain!(bool => Bool, i64 => Int, i32 => Int, u32 => Int, f64 => Real);
from_plain!(&str => Text, String => Text, Arc<str> => Text);

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(b) => b.fmt(f),
            Self::Int(n) => n.fmt(f),
            Self::Real(x) if f.alternate() => Real((x.get() * 100.0).round() / 100.0).fmt(f),
            Self::Real(x) => x.fmt(f),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use std::hash::BuildHasher as _;

    use proptest::prelude::*;

    use super::*;

    fn value() -> impl Strategy<Value = Value> {
        prop_oneof![
            any::<bool>().prop_map(Value::from),
            (-3_i64..3).prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            (-6_i64..6).prop_map(|half| Value::from(half as f64 / 2.0)),
            any::<i64>().prop_map(|whole| Value::from(whole as f64)),
            any::<f64>().prop_map(Value::from),
            Just(Value::from(-0.0)),
            Just(Value::from(f64::NAN)),
            Just(Value::from("2")),
        ]
    }

    #[test]
    fn people_read_two_decimals_and_nobody_else_loses_any() {
        let length = Value::from(64.925_829_609_037_45);
        assert_eq!(format!("{length:#} {:#} {:#}", Value::from(3.0), Value::from(7)), "64.93 3.0 7");
        assert_eq!(length.to_string(), "64.92582960903745");
        let event = crate::Event::new("uav/1/planned").with("length_m", 64.925_829_609_037_45);
        assert_eq!(format!("{event:#}"), "uav/1/planned{length_m: 64.93}");
    }

    #[test]
    fn two_is_two_however_it_is_written() {
        assert_eq!(Value::from(2), Value::from(2.0));
        assert_eq!(Value::from(0), Value::from(-0.0));
        assert_ne!(Value::from(2), Value::from("2"));
        assert_ne!(Value::from(1), Value::from(true));
        // Beyond 2^53 floats have gaps.
        assert_ne!(Value::from((1_i64 << 53) + 1), Value::from((1_i64 << 53) as f64));
        assert_ne!(Value::from(i64::MAX), Value::from(i64::MAX as f64));
    }

    proptest! {
        #[test]
        fn order_equality_and_hash_agree(a in value(), b in value(), c in value()) {
            prop_assert_eq!(a.cmp(&b), b.cmp(&a).reverse());
            prop_assert_eq!(a == b, a.cmp(&b) == Ordering::Equal);
            if a <= b && b <= c {
                prop_assert!(a <= c);
            }
            if a == b {
                let hasher = rustc_hash::FxBuildHasher;
                prop_assert_eq!(hasher.hash_one(&a), hasher.hash_one(&b));
            }
        }
    }
}
