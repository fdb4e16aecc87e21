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

/// The deceleration with which stock PX4 and ArduCopter surely stop: ArduCopter's WPNAV_ACCEL.
const STOCK_BRAKE_M_S2: f64 = 2.5;
/// PX4 follows a velocity like a first-order lag of this time: it stops from 3 m/s in 2.1 m.
const PX4_LATENCY_S: f64 = 0.7;
/// ArduCopter needs half a second to build that deceleration up, and longer while it accelerates: PSC_JERK_XY.
const ARDUPILOT_LATENCY_S: f64 = 0.5;
const ARDUPILOT_JERK_M_S3: f64 = 5.0;

impl Make {
    /// An envelope as far as this autopilot can fly it.
    #[must_use]
    pub fn handles(self, envelope: Envelope) -> Envelope {
        let (latency_s, jerk_m_s3) = match self {
            Self::BuiltIn => return envelope,
            Self::Px4 => (PX4_LATENCY_S, None),
            Self::Ardupilot => (ARDUPILOT_LATENCY_S, Some(ARDUPILOT_JERK_M_S3)),
        };
        Envelope {
            brake_m_s2: envelope.brake_m_s2.min(STOCK_BRAKE_M_S2),
            latency_s: envelope.latency_s.max(latency_s),
            jerk_m_s3: jerk_m_s3.or(envelope.jerk_m_s3),
            ..envelope
        }
    }
}
