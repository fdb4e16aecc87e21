//! The error-state filter on flights of which the truth is known.

mod consistency;
mod known_answers;
mod truth;
