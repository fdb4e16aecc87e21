//! A rehearsal: a flight in simulation before anything is sent, and its outcome.
//!
//! The station asks a program of its own for it, `skein-sim rehearse`, in JSON: it does not know the simulator.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use skein_bp::script::Assignment;
use skein_dbp::NodeName;
use skein_planning::airspace::AirspaceTable;
use skein_wire::Zone;

use crate::obstacle::Obstacle;

/// The present state that a rehearsal begins with. World frame ENU, metres, seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rehearsal {
    /// Those that fly, or are to take off, in the order in which they take off.
    pub vehicles: Vec<Actor>,
    /// The box of the air: whoever leaves it has failed.
    pub min_m: [f64; 3],
    pub max_m: [f64; 3],
    /// Terrain, threats and zones that the vehicles are configured with.
    #[serde(default)]
    pub airspace: AirspaceTable,
    /// The zones that are drawn.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zones: Vec<Zone>,
    /// The known map.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<Obstacle>,
    /// A world file beside them: SDF, CSV of boxes, mesh or point cloud.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world: Option<String>,
    #[serde(default)]
    pub wind: Wind,
    #[serde(default = "cruise_m_s")]
    pub cruise_m_s: f64,
    #[serde(default = "takeoff_height_m")]
    pub takeoff_height_m: f64,
    /// The model of vehicles, where they do not name their own.
    #[serde(default = "model")]
    pub model: String,
    /// Vehicles adjust their pace to arrive at the same time.
    #[serde(default)]
    pub arrive_together: bool,
    /// The wall's clock at the beginning, seconds since 1970: zones have hours.
    #[serde(default)]
    pub began_s: f64,
    /// It is flown once with each.
    #[serde(default = "seeds")]
    pub seeds: Vec<u64>,
    /// After so long it is broken off.
    #[serde(default = "time_limit_s")]
    pub time_limit_s: f64,
}

impl Default for Rehearsal {
    /// Nobody in no air: a start to fill in.
    fn default() -> Self {
        Self {
            vehicles: Vec::new(),
            min_m: [0.0; 3],
            max_m: [0.0; 3],
            airspace: AirspaceTable::default(),
            zones: Vec::new(),
            obstacles: Vec::new(),
            world: None,
            wind: Wind::default(),
            cruise_m_s: cruise_m_s(),
            takeoff_height_m: takeoff_height_m(),
            model: model(),
            arrive_together: false,
            began_s: 0.0,
            seeds: seeds(),
            time_limit_s: time_limit_s(),
        }
    }
}

/// A vehicle at the beginning of a rehearsal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actor {
    pub node: NodeName,
    /// Where it is.
    pub position_m: [f64; 3],
    /// Radians, counter-clockwise from east.
    #[serde(default)]
    pub yaw_rad: f64,
    /// It is in the air.
    #[serde(default)]
    pub airborne: bool,
    /// In the air it stays where it is, and so it has no end.
    #[serde(default)]
    pub held: bool,
    /// Where it took off; none: under where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home_m: Option<[f64; 3]>,
    /// Share of its battery's energy that is left, 0 to 1.
    #[serde(default = "full")]
    pub battery: f64,
    /// The points that it still has to fly, under the last of which it lands.
    pub route_m: Vec<[f64; 3]>,
    /// The scripts that run on it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scripts: Vec<Assignment>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
}

/// Air that moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    #[serde(default)]
    pub mean_m_s: [f64; 3],
    /// Standard deviation of gusts in each axis.
    #[serde(default)]
    pub gust_m_s: f64,
}

fn cruise_m_s() -> f64 {
    3.0
}

fn takeoff_height_m() -> f64 {
    3.0
}

fn model() -> String {
    "x500".to_owned()
}

fn seeds() -> Vec<u64> {
    (1..=5).collect()
}

fn time_limit_s() -> f64 {
    600.0
}

fn full() -> f64 {
    1.0
}

/// So many vehicles are rehearsed at once, and so often.
const MOST_VEHICLES: usize = 254;
const MOST_SEEDS: usize = 32;
const LONGEST_S: f64 = 7200.0;
/// The fastest that any vehicle cruises, and the strongest wind, m/s.
const FASTEST_M_S: f64 = 100.0;
/// No vehicle flies further than this from the world's origin, m.
const FURTHEST_M: f64 = 1e5;

/// Why nothing is rehearsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("rehearsal: `{field}` is {found}: expected {expected}")]
pub struct UnfitRehearsal {
    field: String,
    found: String,
    expected: String,
}

impl UnfitRehearsal {
    pub fn new(field: impl Into<String>, found: impl std::fmt::Debug, expected: impl Into<String>) -> Self {
        Self { field: field.into(), found: format!("{found:?}"), expected: expected.into() }
    }
}

impl Rehearsal {
    /// Checks what can be checked without a simulator.
    ///
    /// # Errors
    /// [`UnfitRehearsal`]: the first field that is not what it may be.
    pub fn check(&self) -> Result<(), UnfitRehearsal> {
        if !(1..=MOST_VEHICLES).contains(&self.vehicles.len()) {
            let expected = format!("1 to {MOST_VEHICLES} vehicles");
            return Err(UnfitRehearsal::new("vehicles", self.vehicles.len(), expected));
        }
        if !(1..=MOST_SEEDS).contains(&self.seeds.len()) {
            return Err(UnfitRehearsal::new("seeds", self.seeds.len(), format!("1 to {MOST_SEEDS} seeds")));
        }
        for (field, place) in [("min_m", &self.min_m), ("max_m", &self.max_m)] {
            require_place(field, place)?;
        }
        if (0..3).any(|axis| self.min_m[axis] >= self.max_m[axis]) {
            return Err(UnfitRehearsal::new("max_m", self.max_m, "each number above that of `min_m`"));
        }
        require_within("cruise_m_s", self.cruise_m_s, 0.1..=FASTEST_M_S)?;
        require_within("takeoff_height_m", self.takeoff_height_m, 0.5..=1000.0)?;
        require_within("time_limit_s", self.time_limit_s, 1.0..=LONGEST_S)?;
        require_within("began_s", self.began_s, 0.0..=1e11)?;
        for speed in self.wind.mean_m_s {
            require_within("wind.mean_m_s", speed, -FASTEST_M_S..=FASTEST_M_S)?;
        }
        require_within("wind.gust_m_s", self.wind.gust_m_s, 0.0..=FASTEST_M_S)?;
        for (index, vehicle) in self.vehicles.iter().enumerate() {
            let field = |name: &str| format!("vehicles[{index}].{name}");
            require_place(field("position_m"), &vehicle.position_m)?;
            vehicle.home_m.iter().try_for_each(|home| require_place(field("home_m"), home))?;
            require_within(field("yaw_rad"), vehicle.yaw_rad, -10.0..=10.0)?;
            require_within(field("battery"), vehicle.battery, 0.0..=1.0)?;
            if vehicle.route_m.is_empty() {
                return Err(UnfitRehearsal::new(field("route_m"), "[]", "at least one point"));
            }
            for (number, point) in vehicle.route_m.iter().enumerate() {
                require_place(field(&format!("route_m[{number}]")), point)?;
            }
            if self.vehicles[..index].iter().any(|other| other.node == vehicle.node) {
                return Err(UnfitRehearsal::new(
                    field("node"),
                    vehicle.node.as_str(),
                    "a name that no other vehicle has",
                ));
            }
            if vehicle.held && !vehicle.airborne {
                return Err(UnfitRehearsal::new(field("held"), true, "false for a vehicle on the ground"));
            }
        }
        Ok(())
    }
}

fn require_within(
    field: impl Into<String>,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<(), UnfitRehearsal> {
    let expected = || format!("a number from {} to {}", range.start(), range.end());
    if range.contains(&value) { Ok(()) } else { Err(UnfitRehearsal::new(field, value, expected())) }
}

fn require_place(field: impl Into<String>, place: &[f64; 3]) -> Result<(), UnfitRehearsal> {
    let is_sound = place.iter().all(|metres| metres.abs() <= FURTHEST_M);
    let expected = "three numbers of at most 100 km: metres east, north and up";
    if is_sound { Ok(()) } else { Err(UnfitRehearsal::new(field, place, expected)) }
}

/// The least and the greatest of some numbers, and their mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Range {
    pub least: f64,
    pub mean: f64,
    pub most: f64,
}

impl Range {
    /// Of these numbers; none of none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let (mut count, mut sum, mut range) = (0.0, 0.0, (f64::INFINITY, f64::NEG_INFINITY));
        for value in values {
            (count, sum, range) = (count + 1.0, sum + value, (range.0.min(value), range.1.max(value)));
        }
        (count > 0.0).then(|| Self { least: range.0, mean: sum / count, most: range.1 })
    }
}

/// The outcome of a rehearsal. Times are seconds since the vehicles in the air set out, or since the beginning if none is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Rehearsed {
    /// The seeds that it was flown with.
    #[cfg_attr(test, ts(type = "number[]"))]
    pub seeds: Vec<u64>,
    /// With every seed every vehicle arrives that is not held, and nothing collides.
    pub succeeded: bool,
    pub vehicles: Vec<Played>,
    /// When the last has landed, of those seeds with which all ended in time.
    #[cfg_attr(test, ts(optional))]
    pub ends_s: Option<Range>,
    /// The pairs of vehicles that come nearest to one another in the air, the nearest first; of each pair one moment.
    pub nearest: Vec<Nearness>,
    /// The least distance from a hull to an obstacle; none where there are none.
    #[cfg_attr(test, ts(optional))]
    pub clearance_m: Option<f64>,
    /// Collisions with obstacles and between vehicles, with all seeds.
    pub collisions: [u32; 2],
    /// Simulated time of all flights over the time that it took.
    pub realtime_factor: f64,
    /// Notes on what was left out.
    pub notes: Vec<String>,
}

/// The end of a vehicle's flights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Played {
    pub vehicle: String,
    /// With how many seeds it arrives.
    pub arrives: usize,
    /// When it has landed, wherever.
    #[cfg_attr(test, ts(optional))]
    pub lands_s: Option<Range>,
    /// Share of its battery's energy that is left then, 0 to 1.
    #[cfg_attr(test, ts(optional))]
    pub battery: Option<Range>,
    /// Its waits, and how long they last with each seed on average, the longest first.
    pub waits: Vec<Wait>,
    /// Why it does not arrive, and with how many seeds.
    pub fails: Vec<Failure>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Wait {
    /// As the vehicle says it.
    pub waits_for: String,
    pub mean_s: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Failure {
    pub why: String,
    pub seeds: usize,
}

/// Two vehicles at the moment at which they are nearest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Nearness {
    pub who: [String; 2],
    /// Centre to centre.
    pub distance_m: f64,
    pub at_s: f64,
    #[cfg_attr(test, ts(type = "number"))]
    pub seed: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rehearsal() -> Rehearsal {
        Rehearsal {
            vehicles: vec![Actor {
                node: NodeName::new("uav/1").unwrap(),
                position_m: [0.0, 0.0, 5.0],
                yaw_rad: 0.0,
                airborne: true,
                held: false,
                home_m: None,
                battery: 0.5,
                route_m: vec![[9.0, 0.0, 5.0]],
                scripts: Vec::new(),
                model: None,
            }],
            min_m: [-10.0, -10.0, -1.0],
            max_m: [20.0, 20.0, 20.0],
            ..Rehearsal::default()
        }
    }

    #[test]
    fn each_field_that_is_not_what_it_may_be_is_named() {
        assert_eq!(rehearsal().check(), Ok(()));
        type Spoils = fn(&mut Rehearsal);
        let cases: [(&str, Spoils); 12] = [
            ("vehicles", |it| it.vehicles.clear()),
            ("seeds", |it| it.seeds.clear()),
            ("max_m", |it| it.max_m[2] = it.min_m[2]),
            ("min_m", |it| it.min_m[0] = f64::NAN),
            ("cruise_m_s", |it| it.cruise_m_s = 0.0),
            ("time_limit_s", |it| it.time_limit_s = 1e9),
            ("wind.gust_m_s", |it| it.wind.gust_m_s = -1.0),
            ("vehicles[0].position_m", |it| it.vehicles[0].position_m[1] = 1e9),
            ("vehicles[0].battery", |it| it.vehicles[0].battery = 1.1),
            ("vehicles[0].route_m", |it| it.vehicles[0].route_m.clear()),
            ("vehicles[0].route_m[0]", |it| it.vehicles[0].route_m[0][0] = f64::INFINITY),
            ("vehicles[1].node", |it| it.vehicles.push(it.vehicles[0].clone())),
        ];
        for (field, break_it) in cases {
            let mut broken = rehearsal();
            break_it(&mut broken);
            let error = broken.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("rehearsal: `{field}` is ")), "{field}: {error}");
        }
    }
}
