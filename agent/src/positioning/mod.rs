//! Positioning: where the vehicle is, how it lies and moves, and how sure that is.
//!
//! Whoever needs a position asks a [`Positioning`] and nobody else. A vehicle with no other source than its autopilot
//! takes that at its word ([`Autopilot`]); one with more runs them side by side ([`Fused`]), and b-thread `choosing`
//! decides which it flies by.

mod autopilot;
mod dead_reckoning;
mod estimate;
mod fused;
mod plausibility;
mod smooth;
mod source;

pub use self::autopilot::Autopilot;
pub use self::estimate::{Attitude, Estimate, Motion, excess_m};
pub use self::fused::Fused;
pub use self::plausibility::Doubt;
pub use self::source::{Positioning, Sensed, SourceNews};

use crate::config::{AgentConfig, PositionSource};

/// The source of position of a vehicle of this configuration.
#[must_use]
pub fn source(config: &AgentConfig) -> Box<dyn Positioning> {
    match config.position[..] {
        [] | [PositionSource::Autopilot] => Box::new(Autopilot::default()),
        _ => Box::new(Fused::new(&config.position, config.home.into())),
    }
}
