//! What an autopilot says about its vehicle, in the world's terms.

use std::collections::VecDeque;
use std::time::Duration;

use mavlink::dialects::common::MavSeverity;
use nalgebra::{UnitQuaternion, Vector3};

use crate::geodesy::Geodetic;
use crate::mode::{AutopilotKind, FlightMode};

/// A value and when it arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamped<T> {
    /// Time since the run began.
    pub stamp: Duration,
    pub value: T,
}

impl<T> Stamped<T> {
    /// How old the value is.
    pub fn age(&self, now: Duration) -> Duration {
        now.saturating_sub(self.stamp)
    }
}

/// Where the autopilot believes the vehicle to be between ground and air.
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

/// How serious a text is, most serious first (RFC 5424).
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

impl From<MavSeverity> for Severity {
    fn from(severity: MavSeverity) -> Self {
        match severity {
            MavSeverity::MAV_SEVERITY_EMERGENCY => Self::Emergency,
            MavSeverity::MAV_SEVERITY_ALERT => Self::Alert,
            MavSeverity::MAV_SEVERITY_CRITICAL => Self::Critical,
            MavSeverity::MAV_SEVERITY_ERROR => Self::Error,
            MavSeverity::MAV_SEVERITY_WARNING => Self::Warning,
            MavSeverity::MAV_SEVERITY_NOTICE => Self::Notice,
            MavSeverity::MAV_SEVERITY_INFO => Self::Info,
            MavSeverity::MAV_SEVERITY_DEBUG => Self::Debug,
        }
    }
}

impl From<Severity> for MavSeverity {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Emergency => Self::MAV_SEVERITY_EMERGENCY,
            Severity::Alert => Self::MAV_SEVERITY_ALERT,
            Severity::Critical => Self::MAV_SEVERITY_CRITICAL,
            Severity::Error => Self::MAV_SEVERITY_ERROR,
            Severity::Warning => Self::MAV_SEVERITY_WARNING,
            Severity::Notice => Self::MAV_SEVERITY_NOTICE,
            Severity::Info => Self::MAV_SEVERITY_INFO,
            Severity::Debug => Self::MAV_SEVERITY_DEBUG,
        }
    }
}

/// A line the autopilot wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Text {
    /// How serious it is.
    pub severity: Severity,
    /// What it says.
    pub text: String,
}

/// The newest of everything heard from the autopilot. Vectors are in the world's ENU frame unless they say
/// body.
#[derive(Debug, Clone, PartialEq)]
pub struct Telemetry {
    /// Make of the autopilot; `None` before its first heartbeat.
    pub autopilot: Option<AutopilotKind>,
    /// When its last heartbeat came.
    pub last_heartbeat: Option<Duration>,
    /// Whether heartbeats come. False before the first and after a pause of [`crate::HEARTBEAT_TIMEOUT`].
    pub connected: bool,
    /// Whether the motors may turn.
    pub armed: bool,
    /// What the autopilot is doing.
    pub mode: FlightMode,
    /// Ground or air.
    pub landed: Landed,
    /// Position, m.
    pub position: Option<Stamped<Vector3<f64>>>,
    /// Velocity, m/s.
    pub velocity: Option<Stamped<Vector3<f64>>>,
    /// Attitude, body FLU to world ENU.
    pub attitude: Option<Stamped<UnitQuaternion<f64>>>,
    /// Angular rate, body FLU, rad/s.
    pub angular_rate: Option<Stamped<Vector3<f64>>>,
    /// Battery; `None` while the autopilot does not know it.
    pub battery: Option<Stamped<Battery>>,
    /// Home, m: where *return* lands and above which take-off heights are measured.
    pub home: Option<Vector3<f64>>,
    /// Height of home in the vertical reference of the datum, m.
    pub home_height_m: Option<f64>,
    /// Origin of the autopilot's local frame. Without it there is no position and positions cannot be asked
    /// for.
    pub local_origin: Option<Geodetic>,
    /// Whether every sensor the autopilot uses is healthy.
    pub sensors_ok: bool,
    /// Whether the autopilot's own checks would let it arm now.
    pub ready_to_arm: bool,
    /// The last [`Telemetry::MAX_TEXTS`] lines it wrote, oldest first.
    pub texts: VecDeque<Stamped<Text>>,
}

impl Telemetry {
    /// How many texts are kept.
    pub const MAX_TEXTS: usize = 16;

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

impl Default for Telemetry {
    fn default() -> Self {
        Self {
            autopilot: None,
            last_heartbeat: None,
            connected: false,
            armed: false,
            mode: FlightMode::Other(0),
            landed: Landed::Unknown,
            position: None,
            velocity: None,
            attitude: None,
            angular_rate: None,
            battery: None,
            home: None,
            home_height_m: None,
            local_origin: None,
            sensors_ok: false,
            ready_to_arm: false,
            texts: VecDeque::new(),
        }
    }
}
