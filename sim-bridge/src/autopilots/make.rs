//! The makes of autopilot that fly in the simulated world.

use clap::ValueEnum;
use serde::Deserialize;
use skein_agent::Envelope;

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

/// The deceleration and the delay with which stock PX4 and ArduCopter surely stop: from 3 m/s in 3.3 m, where 2.1 and
/// 3.1 m were measured.
const STOCK_BRAKE_M_S2: f64 = 2.5;
const STOCK_LATENCY_S: f64 = 0.5;

impl Make {
    /// An envelope as far as this autopilot can fly it.
    #[must_use]
    pub fn handles(self, envelope: Envelope) -> Envelope {
        match self {
            Self::BuiltIn => envelope,
            Self::Px4 | Self::Ardupilot => Envelope {
                brake_m_s2: envelope.brake_m_s2.min(STOCK_BRAKE_M_S2),
                latency_s: envelope.latency_s.max(STOCK_LATENCY_S),
                ..envelope
            },
        }
    }
}
