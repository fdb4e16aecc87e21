//! Reports: what the control loop has found out about the vehicle, for whoever decides on board.

use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::Event;
use skein_dbp::NodeName;
use skein_mav::{FlightMode, Severity, Text};
use skein_wire::event::{
    self, Airborne, Arrived, AutopilotSays, BatteryChanged, BatteryCritical, BatteryLow, Clear,
    CommandFailed, Cornered, FenceBreached, FoundAirborne, InTheWay, Landed, Leave, OrderTaken, OutOfTheWay,
    PathBlocked, PilotTook, PlaceFree, PlaceTaken, Planned, PositionDoubted, PositionTrusted, Ready, Refuge,
    Right, Slept, SourceFound, SourceLost, Stuck, TooClose, Unplannable, Unready, WayBack, What, ZoneNews,
    ZoneState,
};

use crate::energy::Changed;
use crate::me::Me;
use crate::positioning::SourceNews;
use crate::stretch::Stretch;

/// A change of the vehicle, of what is around it, or of its path.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// The checks before take-off pass.
    Ready,
    /// They do not pass, and this is why; told anew when others do not.
    Unready(String),
    /// The agent flies the vehicle, off the ground.
    Airborne,
    Landed,
    /// The vehicle was in the air before its agent, and nobody flies it.
    FoundAirborne,
    /// Somebody else has the vehicle, in this mode: see [`PilotTook`].
    Taken {
        mode: FlightMode,
        by: String,
    },
    /// The agent has not run for so long that it let go of the vehicle.
    Slept(Duration),
    /// Control lands the vehicle of its own accord, and this is why; the mission is to see to it that it
    /// stays so.
    Lands(String),
    /// The autopilot does not do what it was told on the ground.
    CommandFailed(String),
    /// The battery holds what the way home needs, or nobody knows what it holds.
    BatteryLow(String),
    /// On the ground the battery was changed, or charged.
    BatteryChanged(Changed),
    /// The battery is nearly empty.
    BatteryCritical,
    /// The vehicle is outside its fence.
    FenceBreached,
    /// The vehicle does not know where it is, in the air; the standard deviation of its position, m.
    PositionDoubted {
        why: String,
        sigma_m: f64,
    },
    /// It does again.
    PositionTrusted,
    /// A source of position can be flown by, or cannot any more.
    PositionSource(SourceNews),
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
        /// The zone in the way, if one is.
        zone: Option<String>,
    },
    /// The vehicle is in a zone of this name, that was drawn about it or that it was carried into.
    InZone(String),
    /// It is in that no more.
    OutOfZone(String),
    /// The waypoint of this leg is reached.
    Arrived {
        leg: i64,
    },
    /// Another vehicle stays where the way of this leg ends.
    PlaceTaken {
        leg: i64,
        by: NodeName,
        /// Whether that is on its way elsewhere.
        leaves: bool,
    },
    /// Nobody does any more.
    PlaceFree,
    /// A return would end here, in world ENU, m.
    Refuge(Vector3<f64>),
    /// The path runs into something.
    PathBlocked,
    /// A line of the autopilot, and how often it came since it was told last.
    AutopilotSays {
        text: Text,
        times: i64,
    },
    /// It is outside the space that paths lead through, and goes straight back to this place of it (m ENU).
    WayBack {
        to: Vector3<f64>,
        why: String,
    },
    /// The vehicle makes no progress in spite of leave to move.
    Stuck,
    /// A narrow stretch lies ahead, with that part of it in which the vehicle is.
    Passage(Stretch),
    /// It lies behind, or the path no longer leads through it.
    PassageLeft,
    /// The vehicle stands in the way of another that has this right, and there is no room to pass.
    InTheWay {
        of: NodeName,
        right: Right,
    },
    OutOfTheWay,
    /// There is no place where it could make way for another.
    Cornered {
        by: NodeName,
    },
}

impl Report {
    pub fn into_event(self, me: &Me) -> Event {
        match self {
            Self::Ready => me.event(Ready),
            Self::Unready(why) => me.event(Unready { why: why.into() }),
            Self::Airborne => me.event(Airborne),
            Self::Landed => me.event(Landed),
            Self::FoundAirborne => me.event(FoundAirborne),
            Self::Taken { mode, by } => me.event(PilotTook { mode: mode.to_string().into(), by: by.into() }),
            Self::Slept(pause) => me.event(Slept { seconds: pause.as_secs_f64() }),
            Self::Lands(why) => me.event(OrderTaken::plain(What::Land, &why)),
            Self::CommandFailed(why) => me.event(CommandFailed { why: why.into() }),
            Self::BatteryLow(why) => me.event(BatteryLow { why: why.into() }),
            Self::BatteryChanged(Changed { from, to }) => {
                me.event(BatteryChanged { from_percent: percent(from), to_percent: percent(to) })
            }
            Self::BatteryCritical => me.event(BatteryCritical),
            Self::FenceBreached => me.event(FenceBreached),
            Self::PositionDoubted { why, sigma_m } => me.event(PositionDoubted { why: why.into(), sigma_m }),
            Self::PositionTrusted => me.event(PositionTrusted),
            Self::PositionSource(SourceNews { source, lost: None }) => {
                me.event(SourceFound { source: source.name().into() })
            }
            Self::PositionSource(SourceNews { source, lost: Some(why) }) => {
                me.event(SourceLost { source: source.name().into(), why: why.into() })
            }
            Self::TooClose(other) => me.event(TooClose { other: other.as_str().into() }),
            Self::Clear => me.event(Clear),
            Self::Planned { leg, length_m } => me.event(Planned { leg, length_m }),
            Self::Unplannable { leg, why, zone } => {
                me.event(Unplannable { leg, why: why.into(), zone: zone.map(Into::into) })
            }
            Self::InZone(name) => {
                me.event(ZoneNews { name: name.into(), state: ZoneState::Inside, of: None })
            }
            Self::OutOfZone(name) => {
                me.event(ZoneNews { name: name.into(), state: ZoneState::Outside, of: None })
            }
            Self::Arrived { leg } => me.event(Arrived { leg }),
            Self::PlaceTaken { leg, by, leaves } => {
                me.event(PlaceTaken { leg, by: by.as_str().into(), leaves })
            }
            Self::PlaceFree => me.event(PlaceFree),
            Self::Refuge(at) => me.event(Refuge { x: at.x, y: at.y, z: at.z }),
            Self::PathBlocked => me.event(PathBlocked),
            Self::AutopilotSays { text: Text { severity, text }, times } => {
                me.event(AutopilotSays { severity: in_words(severity), text: text.into(), times })
            }
            Self::WayBack { to, why } => me.event(WayBack { x: to.x, y: to.y, z: to.z, why: why.into() }),
            Self::Stuck => me.event(Stuck),
            Self::Passage(stretch) => match stretch.passage() {
                Some(passage) => me.event(passage),
                None => me.event(Leave),
            },
            Self::PassageLeft => me.event(Leave),
            Self::InTheWay { of, right } => me.event(InTheWay { of: of.as_str().into(), right }),
            Self::OutOfTheWay => me.event(OutOfTheWay),
            Self::Cornered { by } => me.event(Cornered { by: by.as_str().into() }),
        }
    }
}

/// A share of 0 to 1 in whole per cents.
fn percent(share: f64) -> i64 {
    (share * 100.0).round() as i64
}

/// A severity in the words of events.
fn in_words(severity: Severity) -> event::Severity {
    match severity {
        Severity::Emergency => event::Severity::Emergency,
        Severity::Alert => event::Severity::Alert,
        Severity::Critical => event::Severity::Critical,
        Severity::Error => event::Severity::Error,
        Severity::Warning => event::Severity::Warning,
        Severity::Notice => event::Severity::Notice,
        Severity::Info | Severity::Debug => event::Severity::Info,
    }
}
