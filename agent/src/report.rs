//! Reports: what the control loop has found out about the vehicle, for whoever decides on board.

use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::Event;
use skein_dbp::NodeName;
use skein_mav::FlightMode;
use skein_wire::vocabulary::{
    AIRBORNE, ARRIVED, BATTERY_CRITICAL, BATTERY_LOW, CLEAR, COMMAND_FAILED, FENCE_BREACHED, FOUND_AIRBORNE,
    LANDED, LEAVE, PASSAGE, PATH_BLOCKED, PILOT, PLANNED, READY, SLEPT, STUCK, TOO_CLOSE, UNPLANNABLE,
    UNREADY,
};

use crate::me::Me;

/// A change of the vehicle, of what is around it, or of its path.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// The checks before take-off pass.
    Ready,
    /// They do not pass any more.
    Unready,
    /// The agent flies the vehicle, off the ground.
    Airborne,
    Landed,
    /// The vehicle was in the air before its agent, and nobody flies it.
    FoundAirborne,
    /// Somebody else has the vehicle, in this mode.
    Pilot(FlightMode),
    /// The agent has not run for so long that it let go of the vehicle.
    Slept(Duration),
    /// The autopilot does not do what it was told on the ground.
    CommandFailed(String),
    /// The battery holds what the way home needs.
    BatteryLow,
    /// The battery is nearly empty.
    BatteryCritical,
    /// The vehicle is outside its fence.
    FenceBreached,
    /// A neighbour is inside the emergency distance.
    TooClose(NodeName),
    /// No neighbour is any more.
    Clear,
    /// There is a path of this length.
    Planned {
        leg: i64,
        length_m: f64,
    },
    /// There is no path.
    Unplannable {
        leg: i64,
        why: String,
    },
    /// The waypoint of this leg is reached.
    Arrived {
        leg: i64,
    },
    /// The path runs into something.
    PathBlocked,
    /// The vehicle makes no progress in spite of leave to move.
    Stuck,
    /// A narrow passage lies ahead.
    Passage(Vector3<f64>),
    /// The passage lies behind, or the path no longer leads through it.
    PassageLeft,
}

impl Report {
    /// The report as an event of vehicle `me`.
    #[must_use]
    pub fn into_event(self, me: &Me) -> Event {
        match self {
            Self::Ready => me.event(READY),
            Self::Unready => me.event(UNREADY),
            Self::Airborne => me.event(AIRBORNE),
            Self::Landed => me.event(LANDED),
            Self::FoundAirborne => me.event(FOUND_AIRBORNE),
            Self::Pilot(mode) => me.event(PILOT).with("mode", mode.to_string()),
            Self::Slept(pause) => me.event(SLEPT).with("seconds", pause.as_secs_f64()),
            Self::CommandFailed(why) => me.because(COMMAND_FAILED, &why),
            Self::BatteryLow => me.event(BATTERY_LOW),
            Self::BatteryCritical => me.event(BATTERY_CRITICAL),
            Self::FenceBreached => me.event(FENCE_BREACHED),
            Self::TooClose(other) => me.event(TOO_CLOSE).with("other", other.as_str()),
            Self::Clear => me.event(CLEAR),
            Self::Planned { leg, length_m } => me.event(PLANNED).with("leg", leg).with("length_m", length_m),
            Self::Unplannable { leg, why } => me.because(UNPLANNABLE, &why).with("leg", leg),
            Self::Arrived { leg } => me.event(ARRIVED).with("leg", leg),
            Self::PathBlocked => me.event(PATH_BLOCKED),
            Self::Stuck => me.event(STUCK),
            Self::Passage(at) => me.event(PASSAGE).with("x", at.x).with("y", at.y).with("z", at.z),
            Self::PassageLeft => me.event(LEAVE),
        }
    }
}
