//! An autopilot's parameters.

use crate::parameter::ParameterValue;

#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, at most 16 bytes; PX4's where PX4 has it.
    pub name: &'static str,
    /// Value now. Its kind (whole or real) never changes.
    pub value: ParameterValue,
    /// Least value taken.
    pub min: f64,
    /// Greatest value taken.
    pub max: f64,
}

/// Why a parameter was not set.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// No such parameter.
    #[error("no parameter {name}: list the parameters for the known names")]
    Unknown {
        /// The name asked for.
        name: String,
    },
    /// A fraction for a whole-number parameter.
    #[error("{name} takes whole numbers, not {value}")]
    NotWhole {
        name: &'static str,
        /// The value offered.
        value: f64,
    },
    /// Outside its range.
    #[error("{name} takes {min} to {max}, not {value}")]
    OutOfRange {
        name: &'static str,
        /// The value offered.
        value: f64,
        /// Least value taken.
        min: f64,
        /// Greatest value taken.
        max: f64,
    },
}

/// All parameters of an autopilot, in the order of their names, which is also the order of their indices.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterTable {
    entries: Vec<Parameter>,
}

impl ParameterTable {
    /// A table of these parameters.
    pub fn new(mut entries: Vec<Parameter>) -> Self {
        entries.sort_by_key(|entry| entry.name);
        Self { entries }
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub fn at(&self, index: usize) -> Option<&Parameter> {
        self.entries.get(index)
    }

    /// A parameter and its index, by name.
    pub fn find(&self, name: &str) -> Option<(usize, &Parameter)> {
        let index = self.entries.binary_search_by_key(&name, |entry| entry.name).ok()?;
        Some((index, self.entries.get(index)?))
    }

    /// The value of a parameter as a number.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.find(name).map(|(_, entry)| entry.value.as_f64())
    }

    /// Sets a parameter and returns its name. A real value for a whole-number parameter is taken if it is
    /// whole.
    ///
    /// # Errors
    /// When there is no such parameter, or the value is not one it takes; it then keeps its value.
    pub fn set(&mut self, name: &str, value: ParameterValue) -> Result<&'static str, ParameterError> {
        let found = self.entries.binary_search_by_key(&name, |entry| entry.name);
        let Some(entry) = found.ok().and_then(|index| self.entries.get_mut(index)) else {
            return Err(ParameterError::Unknown { name: name.to_owned() });
        };
        let (name, number) = (entry.name, value.as_f64());
        if !(entry.min..=entry.max).contains(&number) {
            let (min, max) = (entry.min, entry.max);
            return Err(ParameterError::OutOfRange { name, value: number, min, max });
        }
        entry.value = match entry.value {
            ParameterValue::Real(_) => ParameterValue::Real(number as f32),
            ParameterValue::Int(_) if number.fract() == 0.0 => ParameterValue::Int(number as i32),
            ParameterValue::Int(_) => return Err(ParameterError::NotWhole { name, value: number }),
        };
        Ok(name)
    }
}
