//! The scenario file: what its TOML may say, and how a scenario comes out of it.

use std::collections::BTreeMap;
use std::num::NonZeroU8;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use skein_agent::bthreads::LinkLossPolicy;
use skein_agent::{GlobalPlanner, LocalPlanner, Nose, Planners, PositionSource, Repellers, position_sources};
use skein_bp::behaviour::{Behaviours, Settings};
use skein_bp::configuration::{self, Malformed};
use skein_bp::script::{Argument, Assignment, ScriptFile};
use skein_planning::airspace::{Airspace, AirspaceTable};
use skein_wire::event::What;
use skein_wire::{Destination, Details, Order, Who};
use skein_world::{
    Aabb, Drift, MarkerFloor, Obstacle, PositionErrors, Scene, Shape, VehicleModel, WindConfig,
};

use super::antipodal::Antipodal;
use super::coverage::Coverage;
use super::field;
use super::forest::Forest;
use super::formation::Formation;
use super::layout::Layout;
use super::mountain;
use super::moving::{self, Moves};
use super::open::Open;
use super::position_error::{PositionErrorTable, PositionFaultTable};
use super::targets::Targets;
use super::walker::Walker;
use super::window::Window;
use super::{
    DEFAULT_TIME_LIMIT_S, Named, Network, Overrides, ReadWorld, SEPARATION_HULLS, Scenario, ScenarioError,
    VehiclePlan, VehicleScript, check_count, read, read_world, stated_datum,
};
use crate::autopilots::make::Make;
use crate::mission;
use crate::node_names::vehicle_name;

const DEFAULT_VEHICLES: usize = 4;
const DEFAULT_MODEL: &str = "x500";
/// Time between two take-offs, with a little to spare, in seconds.
const LAUNCH_S: f64 = 3.0;
const DEFAULT_CRUISE_SPEED_M_S: f64 = 3.0;
const DEFAULT_TAKEOFF_HEIGHT_M: f64 = 3.0;

/// A parsed scenario file with the place it came from.
pub struct ScenarioFile {
    /// Its name in errors.
    file: String,
    table: FileTable,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileTable {
    name: Option<String>,
    about: Option<String>,
    generator: Option<Generator>,
    vehicles: Option<usize>,
    model: Option<String>,
    autopilot: Option<Make>,
    #[serde(default, deserialize_with = "field::optional_positive")]
    cruise_speed_m_s: Option<f64>,
    #[serde(default)]
    global: GlobalPlanner,
    #[serde(default)]
    local: LocalPlanner,
    #[serde(default)]
    nose: Nose,
    #[serde(default)]
    potential: Repellers,
    #[serde(default, deserialize_with = "field::optional_positive")]
    takeoff_height_m: Option<f64>,
    #[serde(default, deserialize_with = "field::optional_positive")]
    time_limit_s: Option<f64>,
    #[serde(default)]
    without_ground: LinkLossPolicy,
    #[serde(default)]
    arrive_together: bool,
    world: Option<PathBuf>,
    #[serde(default)]
    mission: Vec<PathBuf>,
    forest: Option<Forest>,
    antipodal: Option<Antipodal>,
    window: Option<Window>,
    open: Option<Open>,
    coverage: Option<Coverage>,
    formation: Option<Formation>,
    targets: Option<Targets>,
    #[serde(default)]
    airspace: AirspaceTable,
    markers: Option<MarkersTable>,
    #[serde(default, deserialize_with = "field::optional_positive")]
    margin_m: Option<f64>,
    #[serde(default, deserialize_with = "position_sources")]
    position: Vec<PositionSource>,
    bounds: Option<BoundsTable>,
    wind: Option<WindTable>,
    #[serde(default)]
    network: Network,
    gps: Option<GpsTable>,
    position_error: Option<PositionErrorTable>,
    #[serde(default)]
    position_fault: Vec<PositionFaultTable>,
    #[serde(default)]
    order: Vec<OrderTable>,
    #[serde(default)]
    script: Vec<ScriptTable>,
    #[serde(default)]
    behaviours: Settings,
    #[serde(default)]
    vehicle: Vec<VehicleTable>,
    #[serde(default)]
    obstacle: Vec<ObstacleTable>,
    #[serde(default)]
    walker: Vec<Walker>,
}

/// Makes world and routes from the seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Generator {
    Forest,
    Antipodal,
    Window,
    Open,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct BoundsTable {
    #[serde(deserialize_with = "field::point")]
    min_m: Vector3<f64>,
    #[serde(deserialize_with = "field::point")]
    max_m: Vector3<f64>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct WindTable {
    #[serde(deserialize_with = "field::point")]
    mean_m_s: Vector3<f64>,
    #[serde(default, deserialize_with = "field::non_negative")]
    gust_m_s: f64,
}

impl From<WindTable> for WindConfig {
    fn from(table: WindTable) -> Self {
        Self { mean: table.mean_m_s, gust_sigma_m_s: table.gust_m_s, ..Self::default() }
    }
}

/// Markers on the floor, row by row from id 1, whose centre is the origin.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct MarkersTable {
    columns: NonZeroU8,
    rows: NonZeroU8,
    #[serde(deserialize_with = "field::positive")]
    side_m: f64,
    #[serde(deserialize_with = "field::positive")]
    pitch_m: f64,
}

impl From<MarkersTable> for MarkerFloor {
    fn from(table: MarkersTable) -> Self {
        let MarkersTable { columns, rows, side_m, pitch_m } = table;
        Self { columns: columns.get().into(), rows: rows.get().into(), side_m, pitch_m }
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct GpsTable {
    #[serde(deserialize_with = "field::non_negative")]
    sigma_m: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct OrderTable {
    #[serde(deserialize_with = "field::non_negative")]
    at_s: f64,
    order: What,
    vehicle: Option<usize>,
    /// Where to, for `goto`: east, north, and up if it is not to keep its height.
    point: Option<Vec<f64>>,
    /// The points of a `route`.
    points: Option<Vec<[f64; 3]>>,
    /// The script that `unload` names, or the person that `give` names.
    name: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptTable {
    file: PathBuf,
    vehicles: Option<Vec<usize>>,
    #[serde(default)]
    with: BTreeMap<String, Argument>,
    #[serde(rename = "as")]
    called: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct VehicleTable {
    #[serde(deserialize_with = "field::ground_point")]
    start_m: Vector3<f64>,
    yaw_rad: Option<f64>,
    #[serde(default, deserialize_with = "field::points")]
    waypoints_m: Vec<Vector3<f64>>,
    model: Option<String>,
    autopilot: Option<Make>,
    position_error: Option<PositionErrorTable>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleTable {
    name: Option<String>,
    #[serde(deserialize_with = "field::point")]
    centre_m: Vector3<f64>,
    #[serde(default)]
    yaw_rad: f64,
    #[serde(default, deserialize_with = "field::optional_extent")]
    box_m: Option<Vector3<f64>>,
    cylinder: Option<CylinderTable>,
    sphere: Option<SphereTable>,
    #[serde(default = "white", deserialize_with = "field::reflectivity")]
    reflectivity: f64,
    #[serde(default, deserialize_with = "field::optional_point")]
    velocity_m_s: Option<Vector3<f64>>,
    #[serde(default, deserialize_with = "field::points")]
    waypoints_m: Vec<Vector3<f64>>,
    #[serde(default, deserialize_with = "moving::speeds")]
    speed_m_s: Option<Vec<f64>>,
    #[serde(default, deserialize_with = "moving::waits")]
    waits_s: Option<Vec<f64>>,
    #[serde(default)]
    loops: bool,
}

impl ObstacleTable {
    fn moves(&self) -> Moves {
        Moves {
            velocity_m_s: self.velocity_m_s,
            waypoints_m: self.waypoints_m.clone(),
            speed_m_s: self.speed_m_s.clone(),
            waits_s: self.waits_s.clone(),
            loops: self.loops,
        }
    }
}

/// What sends back all light.
fn white() -> f64 {
    1.0
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct CylinderTable {
    #[serde(deserialize_with = "field::positive")]
    radius_m: f64,
    #[serde(deserialize_with = "field::positive")]
    height_m: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct SphereTable {
    #[serde(deserialize_with = "field::positive")]
    radius_m: f64,
}

impl ScenarioFile {
    /// Reads TOML; `file` is what errors call it.
    pub fn parse(text: &str, file: &str) -> Result<Self, ScenarioError> {
        let table = configuration::read(text).map_err(|malformed| {
            let Malformed { line, column, field, problem: message } = malformed;
            ScenarioError::Malformed { file: file.to_owned(), line, column, field, message }
        })?;
        Ok(Self { file: file.to_owned(), table })
    }

    /// One line that says what the scenario is.
    pub fn about(&self) -> String {
        self.table.about.clone().unwrap_or_default()
    }

    /// Makes the world and the vehicles' plans; see [`Scenario::validate`] for what is left to check.
    pub fn build(
        self,
        vehicles: Option<usize>,
        seed: u64,
        known: &Behaviours,
        allowed: &Overrides,
    ) -> Result<Scenario, ScenarioError> {
        self.check_tables()?;
        let name = self.name();
        let named = self.named();
        let world =
            named.world.as_deref().map(|path| read_world(path, allowed.without_missing)).transpose()?;
        let datum = world.as_ref().and_then(|world| stated_datum(&world.scene));
        let set = mission::read_files(&named.missions, datum, allowed.allowances)?;
        let count = self.count(vehicles, set.missions.len());
        check_count(&name, count)?;
        let layout = self.generate(count, seed);
        let mut plans = self.plans(count, layout.as_ref(), set.missions.is_empty(), seed)?;
        self.tune_gps(&mut plans);
        self.mislead(&mut plans)?;
        let replaced = world.is_some() && layout.is_some();
        let (scene, notes) = self.scene(&name, layout, world)?;
        let orders = self.orders(count)?;
        let scripts = self.scripts(count)?;
        let behaviours = known
            .choose(&self.table.behaviours)
            .map_err(|error| self.contradiction(error.field, error.problem))?;
        let airspace = self.airspace()?;
        let fixed_bounds = self.fixed_bounds();
        let time_limit_s = self.time_limit_s(count.saturating_sub(self.count(None, set.missions.len())));
        let wind = WindConfig { mean: scene.wind(), ..WindConfig::default() };
        let (cruise_speed_m_s, takeoff_height_m) = (self.cruise_speed_m_s(), self.takeoff_height_m());
        let table = self.table;
        let walkers = table.walker;
        let mut scenario = Scenario {
            name,
            about: table.about.unwrap_or_default(),
            seed,
            scene,
            airspace,
            fixed_bounds,
            vehicles: plans,
            launch_on_order: false,
            muster: table.formation.is_some() || table.targets.is_some(),
            arrive_together: table.arrive_together || table.targets.is_some(),
            cruise_speed_m_s,
            planners: Planners {
                global: table.global,
                local: table.local,
                nose: table.nose,
                potential: table.potential,
            },
            separation_hulls: SEPARATION_HULLS,
            margin_m: table.margin_m,
            position: table.position,
            takeoff_height_m,
            without_ground: table.without_ground,
            time_limit_s,
            wind: table.wind.map_or(wind, WindConfig::from),
            orders,
            scripts,
            behaviours,
            network: table.network,
            rally: Vec::new(),
            notes,
        };
        if set.missions.is_empty() {
            scenario.include_routes();
            if replaced {
                scenario.settle()?;
            }
        }
        scenario.fly(set)?;
        scenario.walk(&walkers);
        Ok(scenario)
    }

    /// Refuses keys that would be read and then have no effect.
    fn check_tables(&self) -> Result<(), ScenarioError> {
        let table = &self.table;
        let given = [
            ("forest", table.forest.is_some(), Generator::Forest),
            ("antipodal", table.antipodal.is_some(), Generator::Antipodal),
            ("window", table.window.is_some(), Generator::Window),
            ("open", table.open.is_some(), Generator::Open),
        ];
        for (name, given, generator) in given {
            if given && table.generator != Some(generator) {
                return Err(self.contradiction(name, format!("has no effect without generator = \"{name}\"")));
            }
        }
        if let Some(forest) = &table.forest
            && let Err((field, message)) = forest.check()
        {
            return Err(self.contradiction(format!("forest.{field}"), message));
        }
        if let Some(markers) = &table.markers
            && markers.side_m > markers.pitch_m
        {
            return Err(self.contradiction("markers.pitch_m", "expected at least side_m: they would overlap"));
        }
        let ways = [
            ("vehicle", !table.vehicle.is_empty()),
            ("coverage", table.coverage.is_some()),
            ("formation", table.formation.is_some()),
            ("targets", table.targets.is_some()),
            ("mission", !table.mission.is_empty() && self.has_task()),
        ];
        let mut stated = ways.iter().filter(|(_, given)| *given);
        if let (Some((one, _)), Some((other, _))) = (stated.next(), stated.next()) {
            return Err(self.contradiction(*other, format!("the vehicles' ways come from `{one}` already")));
        }
        if table.targets.is_some() && table.bounds.is_none() {
            return Err(self.contradiction("targets", "expected [bounds] beside it, to plan routes in"));
        }
        if let Some(bounds) = &table.bounds
            && (0..3).any(|axis| bounds.min_m[axis] >= bounds.max_m[axis])
        {
            return Err(self.contradiction("bounds", "expected min_m below max_m in every axis".to_owned()));
        }
        Ok(())
    }

    /// Routes are planned from a task for the whole swarm.
    fn has_task(&self) -> bool {
        let table = &self.table;
        table.coverage.is_some() || table.formation.is_some() || table.targets.is_some()
    }

    /// The limit for so many vehicles more than the file counts with, which take off one after another.
    fn time_limit_s(&self, more: usize) -> f64 {
        self.table.time_limit_s.unwrap_or(DEFAULT_TIME_LIMIT_S) + LAUNCH_S * more as f64
    }

    fn cruise_speed_m_s(&self) -> f64 {
        self.table.cruise_speed_m_s.unwrap_or(DEFAULT_CRUISE_SPEED_M_S)
    }

    fn takeoff_height_m(&self) -> f64 {
        self.table.takeoff_height_m.unwrap_or(DEFAULT_TAKEOFF_HEIGHT_M)
    }

    fn contradiction(&self, field: impl Into<String>, message: impl Into<String>) -> ScenarioError {
        ScenarioError::Contradiction { file: self.file.clone(), field: field.into(), message: message.into() }
    }

    /// The scenario's own name, or that of its file.
    fn name(&self) -> String {
        let stem = || Path::new(&self.file).file_stem().map(|s| s.to_string_lossy().into_owned());
        self.table.name.clone().or_else(stem).unwrap_or_default()
    }

    /// Paths in a scenario are relative to its file.
    /// The files of others that it names.
    pub fn named(&self) -> Named {
        let beside = |path: &PathBuf| self.beside(path);
        Named {
            world: self.table.world.as_ref().map(beside),
            missions: self.table.mission.iter().map(beside).collect(),
        }
    }

    fn beside(&self, path: &Path) -> PathBuf {
        Path::new(&self.file).parent().unwrap_or(Path::new("")).join(path)
    }

    fn count(&self, wanted: Option<usize>, missions: usize) -> usize {
        let described = match self.table.vehicle.len() {
            0 => None,
            described => Some(described),
        };
        let one_each = (missions > 1).then_some(missions);
        let has_work = self.table.generator.is_some() || self.has_task() || missions > 0;
        let default = || if has_work { DEFAULT_VEHICLES } else { 0 };
        wanted.or(self.table.vehicles).or(described).or(one_each).unwrap_or_else(default)
    }

    fn generate(&self, vehicles: usize, seed: u64) -> Option<Layout> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let table = &self.table;
        let layout = match table.generator? {
            Generator::Forest => table.forest.clone().unwrap_or_default().generate(vehicles, &mut rng),
            Generator::Antipodal => table.antipodal.clone().unwrap_or_default().generate(vehicles, &mut rng),
            Generator::Window => table.window.clone().unwrap_or_default().generate(vehicles, &mut rng),
            Generator::Open => table.open.clone().unwrap_or_default().generate(vehicles, &mut rng),
        };
        Some(layout)
    }

    /// `[[vehicle]]` tables where there are any, else the task's routes, else the generator's, else blanks for a
    /// mission to fill.
    fn plans(
        &self,
        count: usize,
        layout: Option<&Layout>,
        no_mission: bool,
        seed: u64,
    ) -> Result<Vec<VehiclePlan>, ScenarioError> {
        let model = self.model(self.table.model.as_deref().unwrap_or(DEFAULT_MODEL))?;
        if !self.table.vehicle.is_empty() {
            return self.described(count, &model);
        }
        if let Some(routes) = self.task(count, seed)? {
            return Ok(routes.into_iter().map(|route| from_under(route, &model)).collect());
        }
        if let Some(layout) = layout {
            let plan = |route: &super::layout::Route| VehiclePlan {
                start: route.start,
                yaw: route.yaw(),
                waypoints: vec![route.goal],
                errands: Vec::new(),
                model: model.clone(),
                autopilot: self.table.autopilot,
                position_errors: PositionErrors::default(),
            };
            return Ok(layout.routes.iter().map(plan).collect());
        }
        if no_mission {
            let message = "expected a generator, a task, a mission or [[vehicle]] tables: the vehicles have nowhere to go";
            return Err(self.contradiction("vehicles", message));
        }
        let blank = VehiclePlan {
            start: Vector3::zeros(),
            yaw: 0.0,
            waypoints: Vec::new(),
            errands: Vec::new(),
            model,
            autopilot: self.table.autopilot,
            position_errors: PositionErrors::default(),
        };
        Ok(vec![blank; count])
    }

    /// The routes that the task for the whole swarm gives, if there is one.
    fn task(&self, vehicles: usize, seed: u64) -> Result<Option<Vec<Vec<Vector3<f64>>>>, ScenarioError> {
        let table = &self.table;
        if let Some(coverage) = &table.coverage {
            let model = self.model(table.model.as_deref().unwrap_or(DEFAULT_MODEL))?;
            let cruise_m_s = self.cruise_speed_m_s().min(model.max_speed_m_s);
            let routes = coverage.routes(vehicles, &self.airspace()?, cruise_m_s, model.max_accel_m_s2);
            let routes = routes.map_err(|error| self.contradiction("coverage", error.to_string()))?;
            return Ok(Some(routes));
        }
        if let Some(formation) = &table.formation {
            return Ok(Some(formation.routes(vehicles)));
        }
        let (Some(targets), Some(bounds)) = (&table.targets, &table.bounds) else { return Ok(None) };
        let bounds = Aabb { min: bounds.min_m, max: bounds.max_m };
        let (height_m, cruise_m_s) = (self.takeoff_height_m(), self.cruise_speed_m_s());
        let routes = targets.routes(vehicles, &bounds, &self.airspace()?, height_m, cruise_m_s, seed);
        routes.map(Some).map_err(|error| self.contradiction("targets", error.to_string()))
    }

    fn described(&self, count: usize, model: &VehicleModel) -> Result<Vec<VehiclePlan>, ScenarioError> {
        let tables = &self.table.vehicle;
        if count > tables.len() {
            let scenario = self.name();
            return Err(ScenarioError::TooFewDescribed { scenario, wanted: count, described: tables.len() });
        }
        let plan = |table: &VehicleTable| {
            let start = table.start_m;
            let ahead = table.waypoints_m.first().map_or(Vector3::x(), |first| first - start);
            Ok(VehiclePlan {
                start,
                yaw: table.yaw_rad.unwrap_or_else(|| ahead.y.atan2(ahead.x)),
                waypoints: table.waypoints_m.clone(),
                errands: Vec::new(),
                model: table.model.as_deref().map_or_else(|| Ok(model.clone()), |name| self.model(name))?,
                autopilot: table.autopilot.or(self.table.autopilot),
                position_errors: PositionErrors::default(),
            })
        };
        tables.iter().take(count).map(plan).collect()
    }

    /// A built-in vehicle model by name, or one from a file beside the scenario.
    fn model(&self, name: &str) -> Result<VehicleModel, ScenarioError> {
        if !name.ends_with(".toml") {
            return Ok(VehicleModel::built_in(name)?);
        }
        let path = self.beside(Path::new(name));
        Ok(VehicleModel::from_toml(&read(&path)?, &path.display().to_string())?)
    }

    /// A `[gps]` table makes every receiver as good in all axes as it says.
    fn tune_gps(&self, plans: &mut [VehiclePlan]) {
        let Some(gps) = &self.table.gps else { return };
        for plan in plans {
            if let Some(own) = &mut plan.model.gps {
                (own.sigma_horizontal_m, own.sigma_vertical_m) = (gps.sigma_m, gps.sigma_m);
            }
        }
    }

    /// Gives the vehicles the errors of their positions.
    fn mislead(&self, plans: &mut [VehiclePlan]) -> Result<(), ScenarioError> {
        for (index, plan) in plans.iter_mut().enumerate() {
            let own = self.table.vehicle.get(index).and_then(|vehicle| vehicle.position_error);
            plan.position_errors.drift =
                own.or(self.table.position_error).map(Drift::from).unwrap_or_default();
        }
        for (i, table) in self.table.position_fault.iter().enumerate() {
            let Some(fault) = table.fault() else {
                let message = "expected exactly one of jump_m, origin_moves_m, late_s, freezes, gps_lost, jammed_m, markers_missed, flow_lost and resets";
                return Err(self.contradiction(format!("position_fault[{i}]"), message));
            };
            let count = plans.len();
            let vehicles = match table.vehicle {
                None => 0..count,
                Some(number) if (1..=count).contains(&number) => number - 1..number,
                Some(number) => {
                    let message = format!("there is no vehicle {number}: expected 1 to {count}");
                    return Err(self.contradiction(format!("position_fault[{i}].vehicle"), message));
                }
            };
            for plan in plans.iter_mut().take(vehicles.end).skip(vehicles.start) {
                plan.position_errors.faults.push(fault);
            }
        }
        Ok(())
    }

    /// The world of a file or of the generator, with the scenario's own obstacles and bounds; and notes on it.
    fn scene(
        &self,
        name: &str,
        layout: Option<Layout>,
        world: Option<ReadWorld>,
    ) -> Result<(Scene, Vec<String>), ScenarioError> {
        let own = self.obstacles()?;
        let (scene, notes) = match (world, layout) {
            (Some(world), _) => {
                let ReadWorld { scene, .. } = &world;
                let obstacles = scene.obstacles().iter().cloned().chain(own).collect();
                let own = Scene::new(name, obstacles).with_datum(*scene.datum()).with_wind(scene.wind());
                (own, world.notes())
            }
            (None, Some(layout)) => {
                let obstacles = layout.obstacles.into_iter().chain(own).collect();
                (Scene::new(name, obstacles).with_bounds(layout.bounds), layout.notes)
            }
            (None, None) => (Scene::new(name, own), Vec::new()),
        };
        let scene = match self.table.markers {
            Some(markers) => scene.with_markers(markers.into()),
            None => scene,
        };
        match &self.table.bounds {
            Some(bounds) => Ok((scene.with_bounds(Aabb { min: bounds.min_m, max: bounds.max_m }), notes)),
            None => Ok((scene, notes)),
        }
    }

    fn airspace(&self) -> Result<Airspace, ScenarioError> {
        let checked = self.table.airspace.check();
        checked.map_err(|error| self.contradiction(format!("airspace.{}", error.field), error.problem))
    }

    /// Stated bounds are part of the scenario, and so are those of a generated world; but an empty field has no edge.
    fn fixed_bounds(&self) -> bool {
        let generated = self.table.generator.is_some_and(|g| g != Generator::Open);
        self.table.bounds.is_some() || (generated && self.table.world.is_none())
    }

    fn obstacles(&self) -> Result<Vec<Obstacle>, ScenarioError> {
        let own = self.table.obstacle.iter().enumerate().map(|(i, table)| self.obstacle(i, table));
        let airspace = self.airspace()?;
        let mountains = (1..).zip(&airspace.mountains);
        own.chain(mountains.flat_map(|(number, mountain)| mountain::steps(number, mountain)).map(Ok))
            .collect()
    }

    fn obstacle(&self, index: usize, table: &ObstacleTable) -> Result<Obstacle, ScenarioError> {
        let shape = match (&table.box_m, &table.cylinder, &table.sphere) {
            (Some(size), None, None) => Shape::Box { half_extents: size / 2.0 },
            (None, Some(c), None) => Shape::Cylinder { radius: c.radius_m, half_height: c.height_m / 2.0 },
            (None, None, Some(s)) => Shape::Sphere { radius: s.radius_m },
            _ => {
                let message = "expected exactly one of box_m, cylinder and sphere";
                return Err(self.contradiction(format!("obstacle[{index}]"), message));
            }
        };
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), table.yaw_rad);
        let name = table.name.clone().unwrap_or_else(|| format!("obstacle {}", index + 1));
        let pose = Isometry3::from_parts(table.centre_m.into(), turn);
        let way = table
            .moves()
            .way(table.centre_m)
            .map_err(|(field, message)| self.contradiction(format!("obstacle[{index}].{field}"), message))?;
        Ok(Obstacle { reflectivity: table.reflectivity, way, ..Obstacle::new(name, shape, pose) })
    }

    fn orders(&self, vehicles: usize) -> Result<Vec<(f64, Order)>, ScenarioError> {
        let order = |(i, table): (usize, &OrderTable)| {
            let wrong =
                |field: &str, message: &str| self.contradiction(format!("order[{i}]{field}"), message);
            if table.order == What::Load {
                return Err(wrong(".order", "a scenario's scripts are its [[script]] tables"));
            }
            let who = match table.vehicle {
                None => Who::All,
                Some(number) if (1..=vehicles).contains(&number) => Who::only(vehicle_name(number - 1)),
                Some(number) => {
                    let message = format!("there is no vehicle {number}: expected 1 to {vehicles}");
                    return Err(wrong(".vehicle", &message));
                }
            };
            let point = match table.point.as_deref() {
                None => None,
                Some([x, y]) => Some(Destination { x: *x, y: *y, z: None }),
                Some([x, y, z]) => Some(Destination { x: *x, y: *y, z: Some(*z) }),
                Some(_) => {
                    return Err(wrong(".point", "expected [east, north] or [east, north, up], metres"));
                }
            };
            let (points, name) = (table.points.clone(), table.name.clone());
            let details = Details { point, points, name, ..Details::default() };
            let order = Order::read(table.order, who, details).map_err(|message| wrong("", &message))?;
            Ok((table.at_s, order))
        };
        let mut orders = self.table.order.iter().enumerate().map(order).collect::<Result<Vec<_>, _>>()?;
        orders.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        Ok(orders)
    }

    /// The scripts of all vehicles, each tried with its values.
    fn scripts(&self, vehicles: usize) -> Result<Vec<VehicleScript>, ScenarioError> {
        let mut scripts = Vec::new();
        for (i, table) in self.table.script.iter().enumerate() {
            let field = |name: &str| format!("script[{i}].{name}");
            let path = self.beside(&table.file);
            let script = ScriptFile::parse(&path.display().to_string(), &read(&path)?)
                .map_err(|error| self.contradiction(field("file"), error.to_string()))?;
            let assignment = Assignment { script, with: table.with.clone(), called: table.called.clone() };
            for vehicle in table.vehicles.clone().unwrap_or_else(|| (1..=vehicles).collect()) {
                if !(1..=vehicles).contains(&vehicle) {
                    let message = format!("there is no vehicle {vehicle}: expected 1 to {vehicles}");
                    return Err(self.contradiction(field("vehicles"), message));
                }
                assignment
                    .bind(&format!("uav/{vehicle}"))
                    .map_err(|error| self.contradiction(field("with"), error.to_string()))?;
                scripts.push(VehicleScript { vehicle, assignment: assignment.clone() });
            }
        }
        Ok(scripts)
    }
}

/// The plan of a vehicle that takes off under its route's first point.
fn from_under(route: Vec<Vector3<f64>>, model: &VehicleModel) -> VehiclePlan {
    let first = route.first().copied().unwrap_or_default();
    let ahead = route.get(1).map_or(Vector3::x(), |second| second - first);
    VehiclePlan {
        start: Vector3::new(first.x, first.y, 0.0),
        yaw: ahead.y.atan2(ahead.x),
        waypoints: route,
        errands: Vec::new(),
        model: model.clone(),
        autopilot: None,
        position_errors: PositionErrors::default(),
    }
}
