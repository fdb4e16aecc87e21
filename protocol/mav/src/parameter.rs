//! Parameter values, and the two ways of writing them into the one field that MAVLink has for them.

use mavlink::dialects::common::MavParamType;
use mavlink::types::CharArray;

/// Longest parameter name, in bytes.
pub const MAX_NAME_LEN: usize = 16;

/// The way of writing an integer into the field, which is a float.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterEncoding {
    /// Its bytes are copied.
    Bytewise,
    /// Its value is cast.
    Cast,
}

/// A parameter's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterValue {
    /// A whole number (any of MAVLink's integer types).
    Int(i32),
    /// A real number.
    Real(f32),
}

impl ParameterValue {
    /// The value as a number.
    pub fn as_f64(self) -> f64 {
        match self {
            Self::Int(value) => f64::from(value),
            Self::Real(value) => f64::from(value),
        }
    }

    /// The `param_value` and `param_type` of a message.
    pub(crate) fn encode(self, encoding: ParameterEncoding) -> (f32, MavParamType) {
        match self {
            Self::Real(value) => (value, MavParamType::MAV_PARAM_TYPE_REAL32),
            Self::Int(value) => {
                let param_value = match encoding {
                    ParameterEncoding::Bytewise => f32::from_bits(value.cast_unsigned()),
                    ParameterEncoding::Cast => value as f32,
                };
                (param_value, MavParamType::MAV_PARAM_TYPE_INT32)
            }
        }
    }

    /// The value behind `param_value` and `param_type`.
    pub(crate) fn decode(value: f32, param_type: MavParamType, encoding: ParameterEncoding) -> Self {
        if matches!(param_type, MavParamType::MAV_PARAM_TYPE_REAL32 | MavParamType::MAV_PARAM_TYPE_REAL64) {
            return Self::Real(value);
        }
        if encoding == ParameterEncoding::Cast {
            return Self::Int(value as i32);
        }
        let bits = value.to_bits();
        let [low, second, ..] = bits.to_le_bytes();
        Self::Int(match param_type {
            MavParamType::MAV_PARAM_TYPE_UINT8 => i32::from(low),
            MavParamType::MAV_PARAM_TYPE_INT8 => i32::from(low.cast_signed()),
            MavParamType::MAV_PARAM_TYPE_UINT16 => i32::from(u16::from_le_bytes([low, second])),
            MavParamType::MAV_PARAM_TYPE_INT16 => i32::from(i16::from_le_bytes([low, second])),
            _ => bits.cast_signed(),
        })
    }
}

impl std::fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Int(value) => value.fmt(f),
            Self::Real(value) => value.fmt(f),
        }
    }
}

/// A name as MAVLink sends it, zero-padded and cut at [`MAX_NAME_LEN`].
pub(crate) fn wire_name(name: &str) -> CharArray<MAX_NAME_LEN> {
    CharArray::from(name)
}

/// A name as MAVLink sent it; empty if it is not text.
pub(crate) fn name_from_wire(name: &CharArray<MAX_NAME_LEN>) -> &str {
    name.to_str().unwrap_or_default()
}
