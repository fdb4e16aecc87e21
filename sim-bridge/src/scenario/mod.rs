//! Scenarios: a world, a swarm in it, and what is asked of the swarm.
//!
//! A scenario is a TOML file. The built-in ones are the files of `scenarios/`, read as a user's own would be;
//! those whose `generator` makes world and routes make them from the seed, so that one seed is one world. Others name a
//! task for the whole swarm, from which the vehicles' routes are planned: an area, a formation, targets.

mod antipodal;
mod coverage;
mod error;
mod field;
mod file;
mod forest;
mod formation;
mod layout;
mod missions;
mod mountain;
mod moving;
mod open;
mod placement;
mod position_error;
mod share;
mod targets;
mod thin_solids;
mod walker;
mod window;
mod world;

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::value::{Error as WordError, StrDeserializer};
use skein_agent::bthreads::LinkLossPolicy;
use skein_agent::{Errand, Planners, PositionSource};
use skein_bp::behaviour::{Behaviours, Chosen};
use skein_bp::script::Assignment;
use skein_mav::Datum;
use skein_planning::airspace::{Airspace, KeepOut};
use skein_planning::separation::{FilterConfig, Neighbour, distance_kept_m};
use skein_wire::Order;
use skein_wire::event::What;
use skein_world::{Aabb, PositionErrors, Scene, VehicleModel, WindConfig};

pub use error::ScenarioError;
pub use layout::SPACING_M;
pub use missions::apply_missions;
pub use world::{ReadWorld, read_world};

use self::walker::Walker;
use crate::autopilots::make::Make;
use crate::mission::{self, Allowances, MissionSet};

/// Largest swarm: MAVLink numbers systems from 1 to 255, and the ground takes the last.
pub const MAX_VEHICLES: usize = 254;

/// Seconds after which a mission counts as failed, unless the scenario says otherwise.
pub const DEFAULT_TIME_LIMIT_S: f64 = 300.0;

/// From a route to bounds that grow with it, in metres.
const ROUTE_MARGIN: Vector3<f64> = Vector3::new(5.0, 5.0, 5.0);

/// Room that a vehicle needs above the height to which it climbs, in metres, and how finely the climb is looked at.
const CLIMB_ROOM_M: f64 = 0.25;
const CLIMB_STEP_M: f64 = 0.05;

/// Room between two hulls on the ground, in metres, below which a scenario is refused.
const HULL_ROOM_M: f64 = 0.2;
/// Distance that vehicles keep from centre to centre, in hull radii: 1.4 m for a vehicle of 0.25 m.
pub(crate) const SEPARATION_HULLS: f64 = 5.6;
/// Nearer to another's start than this, in metres, a goal is that very place, which its owner leaves first.
const SAME_PLACE_M: f64 = 0.1;
/// Distances that differ by no more than this are equal, in metres.
const ROUNDING_M: f64 = 1e-9;

const BUILT_IN: [(&str, &str); 10] = [
    ("forest", include_str!("../../scenarios/forest.toml")),
    ("antipodal", include_str!("../../scenarios/antipodal.toml")),
    ("window", include_str!("../../scenarios/window.toml")),
    ("open", include_str!("../../scenarios/open.toml")),
    ("survey", include_str!("../../scenarios/survey.toml")),
    ("geese", include_str!("../../scenarios/geese.toml")),
    ("valley", include_str!("../../scenarios/valley.toml")),
    ("indoor", include_str!("../../scenarios/indoor.toml")),
    ("warehouse", include_str!("../../scenarios/warehouse.toml")),
    ("canyon", include_str!("../../scenarios/canyon.toml")),
];

/// A world, a swarm in it, and what is asked of the swarm. World frame ENU, metres, seconds.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Short name, for the summary.
    pub name: String,
    /// One line for people.
    pub about: String,
    /// The source of every random number of the run.
    pub seed: u64,
    /// Obstacles and bounds.
    pub scene: Scene,
    /// Terrain, threats and no-fly zones that every vehicle knows; its box counts for nothing.
    pub airspace: Airspace,
    /// The bounds are part of the scenario; otherwise they grow to hold a mission.
    pub fixed_bounds: bool,
    /// The vehicles; vehicle `i` is `uav/{i + 1}`.
    pub vehicles: Vec<VehiclePlan>,
    /// Nobody takes off before an operator orders it.
    pub launch_on_order: bool,
    /// Nobody sets out before everybody is in the air.
    pub muster: bool,
    /// All arrive at their goals at the same time.
    pub arrive_together: bool,
    /// Speed the vehicles aim for between waypoints.
    pub cruise_speed_m_s: f64,
    /// The planners on board.
    pub planners: Planners,
    /// Distance that vehicles keep from centre to centre, in hull radii.
    pub separation_hulls: f64,
    /// Clearance kept between hull and obstacles when a path is planned, in metres; the agent's own if `None`.
    pub margin_m: Option<f64>,
    /// What tells vehicles where they are, the preferred one first; what each has, if empty.
    pub position: Vec<PositionSource>,
    /// Height above the ground at which a take-off ends.
    pub takeoff_height_m: f64,
    /// The policy of a vehicle that has been without the ground station for long.
    pub without_ground: LinkLossPolicy,
    /// Simulated seconds after which the mission has failed.
    pub time_limit_s: f64,
    /// Air that moves.
    pub wind: WindConfig,
    /// The operator's orders, each at so many simulated seconds, by time.
    pub orders: Vec<(f64, Order)>,
    /// Scripts that run on vehicles from the start.
    pub scripts: Vec<VehicleScript>,
    /// The behaviours that are switched on, each on the nodes that it is for.
    pub behaviours: Chosen,
    /// The treatment of messages by the network in memory.
    pub network: Network,
    /// Places where a vehicle that returns may land instead of at home, at the height of the way there.
    pub rally: Vec<Vector3<f64>>,
    /// Notes for the user: parameters that gave way, parts of files that were not understood.
    pub notes: Vec<String>,
}

/// A vehicle and its task.
#[derive(Debug, Clone, PartialEq)]
pub struct VehiclePlan {
    /// Its place before take-off: ENU, metres, on the ground.
    pub start: Vector3<f64>,
    /// Heading at the start: radians counter-clockwise from east.
    pub yaw: f64,
    /// ENU, metres. It lands under the last.
    pub waypoints: Vec<Vector3<f64>>,
    /// Stays, speeds and commands to what it carries, on the way.
    pub errands: Vec<Errand>,
    pub model: VehicleModel,
    /// Its autopilot; none for the one that the command line names.
    pub autopilot: Option<Make>,
    /// The errors of its position.
    pub position_errors: PositionErrors,
}

impl VehiclePlan {
    /// Its autopilot.
    pub fn make(&self) -> Make {
        self.autopilot.unwrap_or_default()
    }

    /// The last waypoint; the start where there is none.
    pub fn goal(&self) -> Vector3<f64> {
        self.waypoints.last().copied().unwrap_or(self.start)
    }
}

/// The in-memory network's treatment of messages, and the nodes' lease for it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Network {
    /// Mean one-way delay, in milliseconds.
    #[serde(deserialize_with = "field::latency_ms")]
    pub latency_ms: f64,
    /// Share of messages that are lost, 0 to below 1.
    #[serde(deserialize_with = "field::share")]
    pub loss: f64,
    /// How long a node's bids hold elsewhere without being renewed, in milliseconds, 100 to 10000: several times as
    /// long as a message takes there and back.
    #[serde(deserialize_with = "field::lease_ms")]
    pub lease_ms: f64,
    /// Vehicles hear one another within so many metres; everywhere, if it is left out. The ground station hears and is
    /// heard by all.
    #[serde(deserialize_with = "field::optional_positive")]
    pub radio_range_m: Option<f64>,
}

impl Default for Network {
    fn default() -> Self {
        Self { latency_ms: 5.0, loss: 0.0, lease_ms: 1000.0, radio_range_m: None }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct VehicleScript {
    /// The vehicle's number, from 1.
    pub vehicle: usize,
    /// The script, with values for its parameters.
    pub assignment: Assignment,
}

/// The options of a command line that go over a scenario.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct Overrides {
    /// Size of the swarm; the scenario's own if not given.
    #[arg(long, value_name = "N")]
    pub vehicles: Option<usize>,
    /// A Gazebo world (SDF), list of boxes (.csv), mesh (.obj) or point cloud (.pcd, .ply) in place of the scenario's world.
    #[arg(long, value_name = "FILE")]
    pub world: Option<PathBuf>,
    /// A QGroundControl plan, `QGC WPL 110` file, KML, GeoJSON or LSC mission; one that all fly in trail, or one for
    /// each vehicle.
    #[arg(long = "mission", value_name = "FILE")]
    pub missions: Vec<PathBuf>,
    #[command(flatten)]
    pub allowances: Allowances,
    /// Fly though there are solids on the way that are thinner than 0.2 m in height, which a planar lidar
    /// does not see.
    #[arg(long)]
    pub thin_solids: bool,
    /// Fly though parts of the world are missing or cannot be read: they are left out.
    #[arg(long)]
    pub without_missing: bool,
    /// What a vehicle does once the ground station has been silent for 5 s: continue, return or land; the scenario's own
    /// if not given.
    #[arg(long, value_name = "POLICY", value_parser = policy)]
    pub without_ground: Option<LinkLossPolicy>,
}

fn policy(word: &str) -> Result<LinkLossPolicy, WordError> {
    LinkLossPolicy::deserialize(StrDeserializer::new(word))
}

impl Scenario {
    /// Names of the built-in scenarios, each with a line that says what it is.
    pub fn names() -> Vec<(&'static str, String)> {
        let about = |(name, text): &(&'static str, &str)| {
            file::ScenarioFile::parse(text, name).ok().map(|file| (*name, file.about()))
        };
        BUILT_IN.iter().filter_map(about).collect()
    }

    /// A built-in scenario; `vehicles` is the scenario's own number where `None`.
    pub fn built_in(name: &str, vehicles: Option<usize>, seed: u64) -> Result<Self, ScenarioError> {
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Self::from_toml(text, &format!("{name}.toml"), vehicles, seed),
            None => Err(ScenarioError::Unknown {
                name: name.to_owned(),
                known: BUILT_IN.map(|(known, _)| known).join(", "),
            }),
        }
    }

    /// A scenario from the text of its file; `file` names it in errors, and paths inside are relative to it.
    pub fn from_toml(
        text: &str,
        file: &str,
        vehicles: Option<usize>,
        seed: u64,
    ) -> Result<Self, ScenarioError> {
        Self::of_program(text, file, vehicles, seed, &Behaviours::default(), &Overrides::default())
    }

    /// The same for a program with these behaviours.
    fn of_program(
        text: &str,
        file: &str,
        vehicles: Option<usize>,
        seed: u64,
        known: &Behaviours,
        allowed: &Overrides,
    ) -> Result<Self, ScenarioError> {
        let scenario = file::ScenarioFile::parse(text, file)?.build(vehicles, seed, known, allowed)?;
        scenario.validate()?;
        Ok(scenario)
    }

    /// The scenario that a command line names: built in, or the path of a file; with its overrides.
    pub fn open(name: &str, overrides: &Overrides, seed: u64) -> Result<Self, ScenarioError> {
        Self::open_with(name, overrides, seed, &Behaviours::default())
    }

    /// The same for a program with these behaviours.
    pub fn open_with(
        name: &str,
        overrides: &Overrides,
        seed: u64,
        known: &Behaviours,
    ) -> Result<Self, ScenarioError> {
        let world = overrides.world.as_deref().map(|path| read_world(path, overrides.without_missing));
        let world = world.transpose()?;
        let datum = world.as_ref().and_then(|world| stated_datum(&world.scene));
        let set = mission::read_files(&overrides.missions, datum, overrides.allowances)?;
        let own_number = || (set.missions.len() > 1).then_some(set.missions.len());
        let vehicles = overrides.vehicles.or_else(own_number);
        let mut scenario = match text_of(name)? {
            Some(text) => Self::of_program(&text, name, vehicles, seed, known, overrides)?,
            None => Self::built_in(name, vehicles, seed)?,
        };
        if let Some(world) = world {
            scenario.notes.extend(world.notes());
            scenario.replace_world(world.scene);
            if set.missions.is_empty() {
                scenario.settle()?;
            }
        }
        scenario.without_ground = overrides.without_ground.unwrap_or(scenario.without_ground);
        scenario.fly(set)?;
        scenario.validate()?;
        if !overrides.thin_solids {
            scenario.check_thin_solids_on_the_way()?;
        }
        Ok(scenario)
    }

    /// Puts another world in place of the scenario's own; the routes stay until [`Scenario::settle`] or a mission.
    pub fn replace_world(&mut self, scene: Scene) {
        if scene.wind() != Vector3::zeros() {
            self.wind.mean = scene.wind();
        }
        self.scene = scene;
        self.fixed_bounds = false;
        self.include_routes();
    }

    /// Applies missions, if there are any, puts the world where on earth they are, and notes their warnings.
    fn fly(&mut self, set: MissionSet) -> Result<(), ScenarioError> {
        self.notes.extend(set.warnings.iter().map(ToString::to_string));
        if let Some(datum) = set.datum {
            self.scene = self.scene.clone().with_datum(datum);
        }
        self.airspace.include(set.airspace);
        if let Some(place) = set.above_terrain
            && (self.airspace.heights.is_some() || !self.airspace.mountains.is_empty())
        {
            return Err(ScenarioError::AboveTerrain { place });
        }
        self.rally.extend(set.rally);
        if set.missions.is_empty() { Ok(()) } else { apply_missions(self, set.missions) }
    }

    /// Lets people walk through the world.
    fn walk(&mut self, walkers: &[Walker]) {
        let pads: Vec<_> = self.vehicles.iter().flat_map(|vehicle| [vehicle.start, vehicle.goal()]).collect();
        let mut people = Vec::new();
        for walker in walkers {
            people.extend(walker.people(people.len(), &self.scene, &pads, self.seed));
        }
        let wanted: usize = walkers.iter().map(|walker| walker.number).sum();
        if people.len() < wanted {
            self.notes.push(format!("{} of {wanted} walkers have room to walk", people.len()));
        }
        self.scene = self.scene.clone().with_more(people);
    }

    /// Moves each start and goal that stands too near an obstacle to the nearest clear place, and notes it.
    pub fn settle(&mut self) -> Result<(), ScenarioError> {
        let mut starts = Vec::new();
        for i in 0..self.vehicles.len() {
            let Some(start) = self.vehicles.get(i).map(|v| v.start) else { continue };
            let start = self.clear_place(i, "start", start, &starts, |_| true)?;
            self.move_start(i, start);
            starts.push(start);
        }
        let mut goals = Vec::new();
        for i in 0..self.vehicles.len() {
            let Some(goal) = self.vehicles.get(i).map(VehiclePlan::goal) else { continue };
            let goal = self.clear_place(i, "goal", goal, &goals, |place| self.is_off_starts(i, place))?;
            self.move_goal(i, goal);
            goals.push(goal);
        }
        Ok(())
    }

    /// Whether the goal of a vehicle may be here for all that its peers need of the ground they start from.
    pub(crate) fn is_off_starts(&self, index: usize, place: &Vector3<f64>) -> bool {
        let Some(vehicle) = self.vehicles.get(index) else { return false };
        let mut others = self.vehicles.iter().enumerate().filter(|(other, _)| *other != index);
        others.all(|(_, other)| !self.is_beside_start(vehicle, place, other))
    }

    fn clear_place(
        &self,
        index: usize,
        what: &'static str,
        near: Vector3<f64>,
        taken: &[Vector3<f64>],
        accepts: impl Fn(&Vector3<f64>) -> bool,
    ) -> Result<Vector3<f64>, ScenarioError> {
        let clear = |place: &Vector3<f64>| {
            placement::is_clear(&self.scene, place, self.takeoff_height_m) && accepts(place)
        };
        let none = ScenarioError::NoRoom { vehicle: index + 1, what, near, reach_m: placement::REACH_M };
        placement::clear_place(&near, taken, clear).ok_or(none)
    }

    /// Puts a vehicle's start elsewhere, and notes it.
    pub(crate) fn move_start(&mut self, index: usize, to: Vector3<f64>) {
        let Some(vehicle) = self.vehicles.get_mut(index) else { return };
        note_move(&mut self.notes, index, "start", vehicle.start, to);
        vehicle.start = to;
    }

    /// Puts a vehicle's last waypoint elsewhere, and notes it.
    pub(crate) fn move_goal(&mut self, index: usize, to: Vector3<f64>) {
        let Some(goal) = self.vehicles.get_mut(index).and_then(|v| v.waypoints.last_mut()) else { return };
        note_move(&mut self.notes, index, "goal", *goal, to);
        *goal = to;
    }

    /// Distance that a vehicle keeps from those that are no larger, centre to centre, in metres.
    pub fn separation_m(&self, vehicle: &VehiclePlan) -> f64 {
        self.separation_hulls * vehicle.model.hull_radius_m
    }

    /// Distance that two vehicles keep where both know exactly where they are, centre to centre, in metres.
    pub fn kept_m(&self, one: &VehiclePlan, other: &VehiclePlan) -> f64 {
        self.kept_from_m(one, other).max(self.kept_from_m(other, one))
    }

    fn kept_from_m(&self, vehicle: &VehiclePlan, other: &VehiclePlan) -> f64 {
        let config = FilterConfig {
            separation_m: self.separation_m(vehicle),
            hull_radius_m: vehicle.model.hull_radius_m,
            ..FilterConfig::default()
        };
        let there = Neighbour {
            id: 0,
            position: other.start,
            velocity: Vector3::zeros(),
            sigma_m: 0.0,
            age_s: 0.0,
            radius_m: other.model.hull_radius_m,
            cooperative: true,
        };
        distance_kept_m(0.0, &there, &config)
    }

    /// Whether a place is beside the start of `other`, nearer than `vehicle` keeps, and not that start
    /// itself.
    fn is_beside_start(&self, vehicle: &VehiclePlan, place: &Vector3<f64>, other: &VehiclePlan) -> bool {
        let distance_m = (place - other.start).xy().norm();
        distance_m > SAME_PLACE_M && distance_m < self.kept_m(vehicle, other) - ROUNDING_M
    }

    /// Checks what a run relies on.
    ///
    /// Whether a goal can be reached is not looked at: the vehicles find that out and land.
    ///
    /// # Errors
    /// No vehicles or too many; a start inside an obstacle; a start or waypoint outside of the bounds or
    /// under the ground; a waypoint in a no-fly zone, in a threat or in known terrain; starts where vehicles
    /// would nearly touch; two goals, or a goal and another's start, nearer to one another than the vehicles
    /// keep.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        check_count(&self.name, self.vehicles.len())?;
        let zones = KeepOut::new(self.airspace.clone(), 0.0, 0.0);
        for (i, vehicle) in self.vehicles.iter().enumerate() {
            self.check_start(i + 1, vehicle)?;
            self.check_waypoints(i + 1, vehicle, &zones)?;
        }
        let bounds = self.scene.bounds();
        match self.rally.iter().find(|point| !bounds.contains(point)) {
            Some(&position) => {
                Err(ScenarioError::RallyOutside { position, min: bounds.min, max: bounds.max })
            }
            None => self.check_ends(),
        }
    }

    fn check_start(&self, number: usize, vehicle: &VehiclePlan) -> Result<(), ScenarioError> {
        self.check_bounds(number, "start", vehicle.start)?;
        let hull = vehicle.model.hull_radius_m;
        let centre = vehicle.start + Vector3::z() * hull;
        match self.scene.nearest(&centre) {
            Some(nearest) if nearest.distance_m < hull => Err(ScenarioError::StartInObstacle {
                vehicle: number,
                obstacle: nearest.obstacle.name.clone(),
                position: vehicle.start,
                overlap_m: hull - nearest.distance_m,
            }),
            _ => self.check_climb(number, vehicle),
        }
    }

    /// A vehicle takes off straight up, and looks at nothing on the way.
    fn check_climb(&self, number: usize, vehicle: &VehiclePlan) -> Result<(), ScenarioError> {
        let hull = vehicle.model.hull_radius_m;
        let steps = ((self.takeoff_height_m + CLIMB_ROOM_M) / CLIMB_STEP_M).ceil() as u32;
        let touched = (0..=steps).find_map(|step| {
            let centre = vehicle.start + Vector3::z() * (hull + f64::from(step) * CLIMB_STEP_M);
            self.scene.nearest(&centre).filter(|nearest| nearest.distance_m < hull).map(|it| (centre, it))
        });
        let Some((centre, nearest)) = touched else { return Ok(()) };
        let above = self.scene.cast_ray(&vehicle.start.into(), &Vector3::z(), centre.z + hull);
        Err(ScenarioError::Overhead {
            vehicle: number,
            obstacle: nearest.obstacle.name.clone(),
            position: vehicle.start,
            // What only sticks out into the column is as high as where it is touched.
            above_m: above.unwrap_or(centre.z - vehicle.start.z),
            climbs_m: self.takeoff_height_m,
        })
    }

    fn check_waypoints(
        &self,
        number: usize,
        vehicle: &VehiclePlan,
        zones: &KeepOut,
    ) -> Result<(), ScenarioError> {
        if vehicle.waypoints.is_empty() {
            return Err(ScenarioError::NoWaypoints { vehicle: number });
        }
        for (i, &waypoint) in vehicle.waypoints.iter().enumerate() {
            let last = i + 1 == vehicle.waypoints.len();
            let what = if last { "goal".to_owned() } else { format!("waypoint {}", i + 1) };
            self.check_bounds(number, &what, waypoint)?;
            if waypoint.z <= 0.0 {
                return Err(ScenarioError::BelowGround { vehicle: number, what, position: waypoint });
            }
            if zones.room_m(&waypoint) < 0.0 {
                return Err(ScenarioError::Closed { vehicle: number, what, position: waypoint });
            }
        }
        Ok(())
    }

    fn check_bounds(&self, number: usize, what: &str, position: Vector3<f64>) -> Result<(), ScenarioError> {
        let bounds = self.scene.bounds();
        if bounds.contains(&position) {
            return Ok(());
        }
        let (min, max) = (bounds.min, bounds.max);
        Err(ScenarioError::OutsideBounds { vehicle: number, what: what.to_owned(), position, min, max })
    }

    /// Checks that where vehicles stand, before and after the flight, they are as far apart as they keep in
    /// it.
    fn check_ends(&self) -> Result<(), ScenarioError> {
        let together =
            self.musters() || self.orders.iter().any(|(_, order)| order.what() == What::LaunchTogether);
        let starts_m = |a: &VehiclePlan, b: &VehiclePlan| match together {
            // All are in the air above their starts at once.
            true => self.kept_m(a, b),
            false => a.model.hull_radius_m + b.model.hull_radius_m + HULL_ROOM_M,
        };
        self.check_spacing("start", |v| v.start, starts_m)?;
        self.check_spacing("goal", VehiclePlan::goal, |a, b| self.kept_m(a, b))?;
        for (i, one) in self.vehicles.iter().enumerate() {
            let beside =
                |(j, other): &(usize, &VehiclePlan)| *j != i && self.is_beside_start(one, &one.goal(), other);
            if let Some((j, other)) = self.vehicles.iter().enumerate().find(beside) {
                return Err(ScenarioError::GoalBesideStart {
                    vehicle: i + 1,
                    other: j + 1,
                    distance_m: (one.goal() - other.start).xy().norm(),
                    least_m: self.kept_m(one, other),
                });
            }
        }
        Ok(())
    }

    fn check_spacing(
        &self,
        what: &'static str,
        place: impl Fn(&VehiclePlan) -> Vector3<f64>,
        least_m: impl Fn(&VehiclePlan, &VehiclePlan) -> f64,
    ) -> Result<(), ScenarioError> {
        for (i, a) in self.vehicles.iter().enumerate() {
            for (j, b) in self.vehicles.iter().enumerate().skip(i + 1) {
                let (distance_m, least_m) = ((place(a) - place(b)).xy().norm(), least_m(a, b));
                if distance_m < least_m - ROUNDING_M {
                    return Err(ScenarioError::TooClose {
                        what,
                        first: i + 1,
                        second: j + 1,
                        distance_m,
                        least_m,
                    });
                }
            }
        }
        Ok(())
    }

    /// Whether nobody sets out before everybody is in the air: the scenario says so, or the goal of one is
    /// where another stands.
    pub fn musters(&self) -> bool {
        let mut pairs = self.vehicles.iter().enumerate().flat_map(|(index, one)| {
            let others = self.vehicles.iter().enumerate().filter(move |(other, _)| *other != index);
            others.map(move |(_, other)| (one, other))
        });
        let takes_over = |(one, other): (&VehiclePlan, &VehiclePlan)| {
            (one.goal() - other.start).xy().norm() < self.kept_m(one, other)
        };
        self.muster || pairs.any(takes_over)
    }

    /// Widens bounds that nobody stated so that every route lies well inside.
    pub(crate) fn include_routes(&mut self) {
        if self.fixed_bounds {
            return;
        }
        let routes = self.vehicles.iter().flat_map(|v| v.waypoints.iter().chain([&v.start]));
        let places = routes.chain(&self.rally);
        let around = |place: &Vector3<f64>| Aabb { min: *place, max: *place }.grown(ROUTE_MARGIN);
        let mut bounds = *self.scene.bounds();
        let floor = bounds.min.z;
        for place in places {
            bounds = bounds.union(&around(place));
        }
        bounds.min.z = floor;
        self.scene = self.scene.clone().with_bounds(bounds);
    }
}

fn note_move(notes: &mut Vec<String>, index: usize, what: &str, from: Vector3<f64>, to: Vector3<f64>) {
    if from != to {
        let (from, to) = (error::place(&from), error::place(&to));
        notes.push(format!(
            "vehicle {}: {what} moved from {from} to {to}, clear of obstacles and other vehicles",
            index + 1
        ));
    }
}

/// The place on earth that a world states; `None` where it has the datum of worlds that state none.
fn stated_datum(scene: &Scene) -> Option<Datum> {
    let unsaid = *Scene::new("", Vec::new()).datum();
    Some(*scene.datum()).filter(|datum| *datum != unsaid)
}

fn check_count(scenario: &str, vehicles: usize) -> Result<(), ScenarioError> {
    match vehicles {
        0 => Err(ScenarioError::NoVehicles { scenario: scenario.to_owned() }),
        1..=MAX_VEHICLES => Ok(()),
        _ => Err(ScenarioError::TooManyVehicles { vehicles, limit: MAX_VEHICLES }),
    }
}

/// The text of a scenario file; `None` where the argument is a name and not a path.
/// The files of others that a scenario's file names.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Named {
    pub world: Option<PathBuf>,
    pub missions: Vec<PathBuf>,
}

impl Named {
    /// Those that the scenario file at `path` names; none if it cannot be read.
    pub fn by(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        file::ScenarioFile::parse(&text, &path.to_string_lossy()).map(|file| file.named()).unwrap_or_default()
    }
}

fn text_of(name: &str) -> Result<Option<String>, ScenarioError> {
    let path = Path::new(name);
    let names_a_file = path.extension().is_some() || path.components().count() > 1;
    if names_a_file { read(path).map(Some) } else { Ok(None) }
}

fn read(path: &Path) -> Result<String, ScenarioError> {
    std::fs::read_to_string(path).map_err(|cause| ScenarioError::Unreadable { path: path.to_owned(), cause })
}
