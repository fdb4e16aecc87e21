//! The makes of autopilot that fly in the simulated world.

use clap::ValueEnum;
use serde::Deserialize;

/// A make of autopilot.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Make {
    /// Skein's own autopilot, which replays bit for bit.
    #[default]
    BuiltIn,
    /// PX4, software in the loop.
    Px4,
    /// ArduPilot's copter, software in the loop.
    Ardupilot,
}
