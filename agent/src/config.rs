//! The configuration of one vehicle's agent. The parts that a user writes are read and written as they stand here, by
//! `agent.toml` and by whatever else configures a vehicle.

use std::time::Duration;

use serde::{Deserialize, Deserializer, Serialize};
use skein_bp::behaviour::{Chosen, Host};
use skein_bp::script::Assignment;
use skein_dbp::{Authority, Kept};
use skein_mav::{Datum, Signing};
use skein_planning::airspace::Airspace;
use skein_wire::event::Catalogue;

use crate::bthreads::LinkLossPolicy;
use crate::errand::Errand;
use crate::field::{number, optional_positive, positive, within};

/// An axis-aligned box, metres ENU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fence {
    pub min: [f64; 3],
    pub max: [f64; 3],
}

impl Fence {
    /// Whether a place is inside.
    pub fn holds(&self, place: &[f64; 3]) -> bool {
        let bounds = self.min.iter().zip(&self.max);
        place.iter().zip(bounds).all(|(metres, (min, max))| (min..=max).contains(&metres))
    }
}

/// The vehicle's abilities, and the distances it keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Envelope {
    /// Horizontal speed flown when nothing is near, m/s.
    #[serde(deserialize_with = "positive")]
    pub cruise_m_s: f64,
    /// Greatest vertical speed, m/s.
    #[serde(deserialize_with = "positive")]
    pub climb_m_s: f64,
    /// Greatest speed through the air, m/s: less the wind, it is what is left over the ground.
    #[serde(deserialize_with = "positive")]
    pub airspeed_m_s: f64,
    /// Tilt of the vehicle when it flies that fast, rad.
    #[serde(deserialize_with = "lean_rad")]
    pub tilt_rad: f64,
    /// Time in hover on a full battery, s; 0 if that is not known.
    #[serde(deserialize_with = "not_negative")]
    pub endurance_s: f64,
    /// Acceleration the vehicle can brake with, m/s².
    #[serde(deserialize_with = "positive")]
    pub brake_m_s2: f64,
    /// Time from a set-point to the velocity it asks for, s.
    #[serde(deserialize_with = "positive")]
    pub latency_s: f64,
    /// The most by which its acceleration changes, m/s³; none if it changes at once.
    #[serde(deserialize_with = "optional_positive", skip_serializing_if = "Option::is_none")]
    pub jerk_m_s3: Option<f64>,
    /// Radius of the sphere around the vehicle, m.
    #[serde(deserialize_with = "positive")]
    pub hull_m: f64,
    /// Clearance kept between hull and obstacles when a path is planned, m.
    #[serde(deserialize_with = "positive")]
    pub margin_m: f64,
    /// Centre-to-centre distance the safety filter keeps between vehicles, m.
    #[serde(deserialize_with = "positive")]
    pub separation_m: f64,
}

impl Envelope {
    pub const DEFAULT: Self = Self {
        cruise_m_s: 3.0,
        climb_m_s: 1.5,
        airspeed_m_s: 12.0,
        tilt_rad: 0.52,
        endurance_s: 0.0,
        brake_m_s2: 2.5,
        latency_s: 0.3,
        jerk_m_s3: None,
        hull_m: 0.25,
        margin_m: 0.25,
        separation_m: 1.4,
    };
}

impl Default for Envelope {
    fn default() -> Self {
        Self::DEFAULT
    }
}

fn lean_rad<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    within(deserializer, "a number from 0.01 to 1.5", 0.01..=1.5)
}

fn not_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    number(deserializer, "0 or more", |value| value >= 0.0)
}

/// The planner that finds a path through the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GlobalPlanner {
    /// Searches anew for every path: [`astar`](skein_planning::global::astar).
    #[default]
    Astar,
    /// Repairs the last path: [`dstar`](skein_planning::global::dstar). A* where it finds none.
    DstarLite,
}

/// The planner that turns a path into the velocity to fly now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LocalPlanner {
    /// Pulled along the path, pushed away by what is near: [`apf`](skein_planning::local::apf).
    #[default]
    Apf,
    /// Through openings, gently: [`vfh`](skein_planning::local::vfh).
    Vfh,
}

/// Where the vehicle's nose points while it flies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Nose {
    /// Where it pointed after take-off.
    #[default]
    Held,
    /// Along the way.
    Along,
}

/// The obstacles whose potential makes paths near them dearer in A* (Wang 2023).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Repellers {
    Nobody,
    /// Vehicles that stand.
    #[default]
    Vehicles,
    /// And what moves, and what the map knows.
    Everything,
}

/// Which planners the pipeline is made of, and where they point the nose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Planners {
    pub global: GlobalPlanner,
    pub local: LocalPlanner,
    pub nose: Nose,
    pub potential: Repellers,
}

/// See [`AgentConfig::sigma_limit_m`].
pub const DEFAULT_SIGMA_LIMIT_M: f64 = 2.0;

/// The sources of the vehicle's position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PositionSource {
    /// The autopilot's own estimate, by satellites.
    #[default]
    Autopilot,
    /// Markers that a camera sees.
    Markers,
    /// Scans that are matched to one another.
    Lidar,
}

impl PositionSource {
    pub const ALL: [Self; 3] = [Self::Autopilot, Self::Markers, Self::Lidar];

    /// Its name in files and events.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Autopilot => "autopilot",
            Self::Markers => "markers",
            Self::Lidar => "lidar",
        }
    }

    /// The source of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|source| source.name() == name)
    }
}

/// One source, or several: the first is preferred.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"autopilot\", \"markers\", \"lidar\", or a list of them, the preferred one first"
)]
enum OneOrMore {
    One(PositionSource),
    More(Vec<PositionSource>),
}

/// The sources of a vehicle's position, as a file states them.
pub fn position_sources<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<PositionSource>, D::Error> {
    let sources = match OneOrMore::deserialize(deserializer)? {
        OneOrMore::One(source) => vec![source],
        OneOrMore::More(sources) => sources,
    };
    let is_twice =
        |(index, source): (usize, &PositionSource)| sources.iter().take(index).any(|it| it == source);
    if sources.is_empty() || sources.iter().enumerate().any(is_twice) {
        return Err(serde::de::Error::custom("expected at least one source of position, and none twice"));
    }
    Ok(sources)
}

/// The configuration of one vehicle's agent.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentConfig {
    /// The fleet's name, the first part of every key.
    pub fleet: String,
    /// The vehicle's node name, such as `uav/3`.
    pub node: String,
    /// The ground station's node name.
    pub ground: String,
    /// Every node of the mission, this one included.
    pub roster: Vec<String>,
    /// A number that grows with every start of this node.
    pub incarnation: u64,
    /// MAVLink system id of the autopilot.
    pub system_id: u8,
    /// The signatures of the autopilot's link, if its frames are signed.
    pub signing: Option<Signing>,
    /// Where the world's origin lies on the earth.
    pub datum: Datum,
    /// Where the vehicle takes off, metres ENU.
    pub home: [f64; 3],
    /// Waypoints, metres ENU; the vehicle lands at the last.
    pub waypoints: Vec<[f64; 3]>,
    /// Stays, speeds and commands to what it carries, on the way.
    pub errands: Vec<Errand>,
    /// Where it may land instead of at home when it returns, metres ENU, at the height of the way there.
    pub rally: Vec<[f64; 3]>,
    /// The vehicles together with which it arrives at its last waypoint; itself may be among them.
    pub arrives_with: Vec<String>,
    /// Height above home to climb to before the mission begins, m.
    pub takeoff_height_m: f64,
    /// Height in the world at which this vehicle returns, m; different for every vehicle.
    pub return_altitude_m: f64,
    /// Its sources of position, the preferred one first: never empty.
    pub position: Vec<PositionSource>,
    /// A position of a greater standard deviation is none to fly by, m.
    pub sigma_limit_m: f64,
    /// Whether the vehicle has a lidar: without scans younger than 200 ms it then stands still.
    pub lidar: bool,
    pub fence: Fence,
    /// The time since 1970 at this agent's time zero, by its computer's clock: zones that are drawn may have hours.
    pub epoch: Duration,
    /// Terrain, threats and no-fly zones that are known; its box counts for nothing, the fence does.
    pub airspace: Airspace,
    pub envelope: Envelope,
    pub planners: Planners,
    /// The policy without the ground station.
    pub link_loss: LinkLossPolicy,
    /// The scripts that run from the start.
    pub scripts: Vec<Assignment>,
    /// The behaviours that are switched on; those for other nodes count for nothing.
    pub behaviours: Chosen,
    /// Lease of the bids this node sends.
    pub lease: Duration,
    /// The distance within which vehicles are sure to hear one another, m; everywhere where there is none.
    pub radio_range_m: Option<f64>,
    /// The rights of other nodes to request and block events here.
    pub authority: Authority,
    /// The promises of a former life of this node; see [`AgentCore::durable`](crate::AgentCore::durable).
    pub kept: Kept,
    /// Seed of the program's tie-breaks.
    pub seed: u64,
}

impl AgentConfig {
    /// The vehicle as its behaviours see it.
    pub fn host(&self) -> Host<'_> {
        Host { node: &self.node, roster: self.roster.iter().map(String::as_str).collect() }
    }

    /// The events that the vehicle knows.
    pub fn events(&self) -> Catalogue {
        self.behaviours.declarations(&self.node).fold(Catalogue::standard(), Catalogue::with)
    }
}
