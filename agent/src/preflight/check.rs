//! Checks, from what was found.

use skein_wire::{Check, CheckState};

pub fn passes(name: &str, value: impl Into<String>) -> Check {
    Check { name: name.into(), state: CheckState::Passes, value: value.into(), advice: String::new() }
}

pub fn fails(name: &str, value: impl Into<String>, advice: impl Into<String>) -> Check {
    Check { name: name.into(), state: CheckState::Fails, value: value.into(), advice: advice.into() }
}

pub fn waits(name: &str, value: impl Into<String>, advice: impl Into<String>) -> Check {
    Check { name: name.into(), state: CheckState::Waits, value: value.into(), advice: advice.into() }
}

/// A value that passes, or does not, and then what to do.
pub fn judged(name: &str, value: &str, judgement: Result<(), String>) -> Check {
    match judgement {
        Ok(()) => passes(name, value),
        Err(advice) => fails(name, value, advice),
    }
}
