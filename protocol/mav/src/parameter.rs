//! Autopilot parameters: values, and the two ways autopilots press them into MAVLink's one `float` field.

use mavlink::dialects::common::MavParamType;
use mavlink::types::CharArray;

use crate::mode::AutopilotKind;

/// Longest parameter name, in bytes.
pub const MAX_NAME_LEN: usize = 16;

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

    /// The `param_value` and `param_type` of a message. PX4 copies an integer's bytes into the float,
    /// ArduPilot casts its value.
    pub(crate) fn encode(self, kind: AutopilotKind) -> (f32, MavParamType) {
        match self {
            Self::Real(value) => (value, MavParamType::MAV_PARAM_TYPE_REAL32),
            Self::Int(value) if kind == AutopilotKind::ArduPilot => {
                (value as f32, MavParamType::MAV_PARAM_TYPE_INT32)
            }
            Self::Int(value) => (f32::from_bits(value.cast_unsigned()), MavParamType::MAV_PARAM_TYPE_INT32),
        }
    }

    /// The value behind `param_value` and `param_type`.
    pub(crate) fn decode(value: f32, param_type: MavParamType, kind: AutopilotKind) -> Self {
        if matches!(param_type, MavParamType::MAV_PARAM_TYPE_REAL32 | MavParamType::MAV_PARAM_TYPE_REAL64) {
            return Self::Real(value);
        }
        if kind == AutopilotKind::ArduPilot {
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
