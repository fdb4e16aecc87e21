//! Flight modes by name. Their numbers are a matter of the [`Dialect`](crate::dialect::Dialect).

/// A flight mode, named for what the autopilot does in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlightMode {
    /// A companion computer's set-points are flown (PX4 OFFBOARD, ArduPilot GUIDED).
    Offboard,
    /// Climbing to the take-off height by itself.
    Takeoff,
    /// Staying where it is.
    Hold,
    /// Landing where it is.
    Land,
    /// Flying home to land.
    Return,
    /// Flying the uploaded mission by itself.
    Mission,
    /// A pilot flies, in whatever assisted mode.
    Manual,
    /// Anything else, by the autopilot's own number; `Other(0)` before its first heartbeat.
    Other(u32),
}

impl std::fmt::Display for FlightMode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Offboard => "offboard",
            Self::Takeoff => "takeoff",
            Self::Hold => "hold",
            Self::Land => "land",
            Self::Return => "return",
            Self::Mission => "mission",
            Self::Manual => "manual",
            Self::Other(number) => return write!(f, "mode {number}"),
        })
    }
}

impl Default for FlightMode {
    fn default() -> Self {
        Self::Other(0)
    }
}
