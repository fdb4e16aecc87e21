//! Parameters of an autopilot on which hangs what becomes of a vehicle that loses its companion or its
//! energy.

use crate::parameter::ParameterValue;

/// A parameter, and the values with which a vehicle may fly. Each dialect lists its own.
#[derive(Debug, Clone, Copy)]
pub struct Failsafe {
    /// Its names: a release of the autopilot has one of them.
    pub parameters: &'static [&'static str],
    /// The safe values, in words.
    pub expected: &'static str,
    /// A safe value for the companion of this system id.
    pub setting: fn(u8) -> f64,
    pub(crate) is_safe: fn(f64, u8) -> bool,
    /// Whether an autopilot that tells none of these names is unsafe. Most parameters come and go with
    /// releases.
    pub(crate) required: bool,
}

impl Failsafe {
    /// The same, for autopilots that may lack the parameter.
    pub(crate) const fn optional(self) -> Self {
        Self { required: false, ..self }
    }

    /// Judges what the autopilot told a companion of this system id; `None` if it has none of these names.
    ///
    /// # Errors
    /// The remedy, in words.
    pub fn judge(&self, told: Option<ParameterValue>, system_id: u8) -> Result<(), String> {
        let Self { expected, setting, .. } = self;
        match told.map(ParameterValue::as_f64) {
            Some(value) if (self.is_safe)(value, system_id) => Ok(()),
            None if !self.required => Ok(()),
            _ => Err(format!("set it to {}: {expected}", setting(system_id))),
        }
    }
}
