//! Telemetry: the state of a vehicle by its autopilot's word, in the world's terms.

use std::collections::VecDeque;
use std::time::Duration;

use mavlink::dialects::common::MavSeverity;
use nalgebra::{UnitQuaternion, Vector3};

use crate::geodesy::Geodetic;
use crate::mode::FlightMode;
use crate::signing::Refused;

/// An autopilot whose heartbeat (1 Hz) stays away this long is lost.
pub const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(3);

/// A value and when it arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamped<T> {
    /// Time since the run began.
    pub stamp: Duration,
    pub value: T,
}

impl<T> Stamped<T> {
    pub fn age(&self, now: Duration) -> Duration {
        now.saturating_sub(self.stamp)
    }
}

/// Ground, air, or between, as the autopilot believes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Landed {
    /// Not said yet.
    #[default]
    Unknown,
    OnGround,
    /// Leaving the ground.
    TakingOff,
    InAir,
    /// Coming down to the ground.
    Landing,
}

/// State of the battery.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Battery {
    /// Energy left, 0..1, in the autopilot's steps of one percent.
    pub fraction: f64,
    /// Voltage, V.
    pub voltage_v: f64,
}

/// Severity of a text, most serious first (RFC 5424).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The system is unusable.
    Emergency,
    /// Act at once.
    Alert,
    /// A primary system fails.
    Critical,
    /// A secondary system fails.
    Error,
    /// Possible trouble ahead.
    Warning,
    /// Unusual, not an error.
    Notice,
    Info,
    Debug,
}

const SEVERITIES: [(Severity, MavSeverity); 8] = [
    (Severity::Emergency, MavSeverity::MAV_SEVERITY_EMERGENCY),
    (Severity::Alert, MavSeverity::MAV_SEVERITY_ALERT),
    (Severity::Critical, MavSeverity::MAV_SEVERITY_CRITICAL),
    (Severity::Error, MavSeverity::MAV_SEVERITY_ERROR),
    (Severity::Warning, MavSeverity::MAV_SEVERITY_WARNING),
    (Severity::Notice, MavSeverity::MAV_SEVERITY_NOTICE),
    (Severity::Info, MavSeverity::MAV_SEVERITY_INFO),
    (Severity::Debug, MavSeverity::MAV_SEVERITY_DEBUG),
];

impl Severity {
    /// By its number, from 0 for the most serious.
    pub(crate) fn of_level(level: u8) -> Self {
        SEVERITIES.get(usize::from(level)).map_or(Self::Debug, |(own, _)| *own)
    }
}

impl From<MavSeverity> for Severity {
    fn from(severity: MavSeverity) -> Self {
        SEVERITIES.into_iter().find(|(_, known)| *known == severity).map_or(Self::Debug, |(own, _)| own)
    }
}

impl From<Severity> for MavSeverity {
    fn from(severity: Severity) -> Self {
        SEVERITIES.into_iter().find(|(own, _)| *own == severity).map(|(_, known)| known).unwrap_or_default()
    }
}

/// A line the autopilot wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Text {
    pub severity: Severity,
    pub text: String,
}

/// The newest of everything heard from the autopilot. Vectors are in the world's ENU frame unless they say
/// body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Telemetry {
    /// When its last heartbeat came.
    pub last_heartbeat: Option<Duration>,
    /// Whether heartbeats come. False before the first and after a pause of [`crate::HEARTBEAT_TIMEOUT`].
    pub connected: bool,
    /// The motors may turn.
    pub armed: bool,
    pub mode: FlightMode,
    pub landed: Landed,
    /// Position, m.
    pub position: Option<Stamped<Vector3<f64>>>,
    /// When that was measured, on the autopilot's clock.
    pub position_time: Option<Duration>,
    /// Its age when it arrived; `None` while it is not known where the autopilot's clock stands.
    pub position_age: Option<Duration>,
    /// Standard deviations of the position by its word, horizontal and vertical, m; `None` while it tells none.
    pub position_sigma_m: Option<Stamped<[f64; 2]>>,
    /// Number of times that its clock has begun anew while it was listened to.
    pub restarts: u32,
    /// Whether satellites tell its position; `None` while it has not said.
    pub has_gps_fix: Option<bool>,
    /// Velocity, m/s.
    pub velocity: Option<Stamped<Vector3<f64>>>,
    /// Attitude, body FLU to world ENU.
    pub attitude: Option<Stamped<UnitQuaternion<f64>>>,
    /// Angular rate, body FLU, rad/s.
    pub angular_rate: Option<Stamped<Vector3<f64>>>,
    /// The battery with the least charge, and since when that is not told anew of each that ever told it; `None` before
    /// the first.
    pub battery: Option<Stamped<Battery>>,
    /// Home, m: where *return* lands and above which take-off heights are measured.
    pub home: Option<Vector3<f64>>,
    /// Height of home in the vertical reference of the datum, m.
    pub home_height_m: Option<f64>,
    /// Origin of the autopilot's local frame. Without it there is no position and positions cannot be asked
    /// for.
    pub local_origin: Option<Geodetic>,
    /// Whether one of its own failsafes acts.
    pub failsafe: bool,
    /// Whether it writes MAVLink 1 although it is written to in 2: it is then answered in 1.
    pub knows_mavlink_1_only: bool,
    /// Frames on its link that were refused by their signature.
    pub refused: Refused,
    /// Whether every sensor the autopilot uses is healthy.
    pub sensors_ok: bool,
    /// Whether the autopilot's own checks would let it arm now.
    pub ready_to_arm: bool,
    /// The last [`Telemetry::MAX_TEXTS`] lines it wrote, oldest first.
    pub texts: VecDeque<Stamped<Text>>,
}

impl Telemetry {
    pub const MAX_TEXTS: usize = 16;

    /// The newest line about a failsafe, if it wrote one within `limit`.
    pub fn failsafe_text(&self, now: Duration, limit: Duration) -> Option<&str> {
        let newest = self.texts.iter().rev().take_while(|text| text.age(now) <= limit);
        let mut lines = newest.map(|text| text.value.text.as_str());
        lines.find(|line| line.to_ascii_lowercase().contains("failsafe"))
    }

    /// Whether position, velocity and attitude are all younger than `limit`.
    pub fn is_fresh(&self, now: Duration, limit: Duration) -> bool {
        let ages = [
            self.position.map(|position| position.age(now)),
            self.velocity.map(|velocity| velocity.age(now)),
            self.attitude.map(|attitude| attitude.age(now)),
        ];
        ages.iter().all(|age| age.is_some_and(|age| age < limit))
    }
}
