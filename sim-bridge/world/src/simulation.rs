//! The whole world in motion, one step at a time.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::Battery;
use skein_positioning::PoseFix;
use skein_wire::Scan;

use crate::autopilot::{Autopilot, AutopilotConfig};
use crate::floor_camera::FloorCamera;
use crate::lidar::{Hull, Lidar, Surroundings};
use crate::noise::Noise;
use crate::pilot::{BuiltIn, Fixed, Pilot};
use crate::position_error::{FixErrors, PositionErrors};
use crate::quadrotor::{MotorCommands, Quadrotor, RigidState, STEP};
use crate::scene::Scene;
use crate::sensors::{SensorReadings, Sensors, is_due};
use crate::truth::{Player, Referee, Truth};
use crate::vehicle::VehicleModel;
use crate::wind::{Wind, WindConfig};

/// The stream of the first vehicle's position errors, beyond those of its instruments and lidar.
const FIX_ERROR_STREAM: u64 = 1 << 32;
/// Those of the first vehicle's flow sensor and floor camera.
const FLOW_STREAM: u64 = 2 << 32;
const CAMERA_STREAM: u64 = 3 << 32;

/// Vehicles that begin in the air hang still for so long: until their autopilots know where they are.
pub const HANGS: Duration = Duration::from_millis(2500);

/// All that a run depends on.
#[derive(Debug, Clone)]
pub struct SimulationConfig {
    pub scene: Scene,
    /// A vehicle's place in this list is its index everywhere else.
    pub vehicles: Vec<VehicleSetup>,
    /// From which all noise is drawn: equal configurations give equal runs, bit for bit.
    pub seed: u64,
    pub wind: WindConfig,
}

/// One vehicle at the start.
#[derive(Debug, Clone)]
pub struct VehicleSetup {
    pub model: VehicleModel,
    /// World ENU, m; below standing height means on the ground.
    pub position: Vector3<f64>,
    /// Heading, counter-clockwise from east, rad.
    pub yaw: f64,
    /// MAVLink system id.
    pub system_id: u8,
    pub position_errors: PositionErrors,
}

/// The true state of a vehicle, for referees, recorders and pictures; its agent must not see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleState {
    /// Position, velocity, attitude and angular rate.
    pub motion: RigidState,
    pub battery: Battery,
    pub airborne: bool,
    pub crashed: bool,
    /// Way flown, m.
    pub path_length_m: f64,
    /// From the first lift-off to the last landing, or to now when airborne.
    pub flight_time: Duration,
}

/// A world with its vehicles, their instruments and built-in autopilots.
///
/// A vehicle that touches an obstacle, another vehicle, or the ground too hard is wrecked: it
/// stops, its rotors give no thrust any more, and it falls.
pub struct Simulation {
    scene: Scene,
    vehicles: Vec<Vehicle>,
    /// One per vehicle, as of the last step.
    hulls: Vec<Hull>,
    wind: Wind,
    referee: Referee,
    tick: u64,
}

struct Vehicle {
    quadrotor: Quadrotor,
    sensors: Sensors,
    readings: SensorReadings,
    pilot: Box<dyn Pilot>,
    lidar: Option<Lidar>,
    camera: Option<FloorCamera>,
    fixes: Vec<PoseFix>,
    /// Shifts the instruments in time, in steps.
    phase: u64,
    /// It hangs in the air until then.
    hangs_until: Duration,
    scan: Option<Scan>,
    path_length_m: f64,
    lifted_off: Option<Duration>,
    last_airborne: Duration,
}

impl Simulation {
    /// A world in which every vehicle stands at its start, at time 0.
    pub fn new(config: SimulationConfig) -> Self {
        let SimulationConfig { scene, vehicles: setups, seed, wind } = config;
        let quadrotors: Vec<Quadrotor> = setups
            .iter()
            .map(|setup| Quadrotor::new(setup.model.clone(), setup.position, setup.yaw))
            .collect();
        let hulls: Vec<Hull> = quadrotors.iter().map(hull_of).collect();
        let players: Vec<Player> = quadrotors.iter().map(player_of).collect();
        let vehicles = quadrotors
            .into_iter()
            .zip(&setups)
            .enumerate()
            .map(|(own, (quadrotor, setup))| {
                let surroundings = Surroundings { scene: &scene, hulls: &hulls, own };
                Vehicle::new(quadrotor, setup, seed, &surroundings)
            })
            .collect();
        Self {
            referee: Referee::new(&scene, &players),
            wind: Wind::new(wind, STEP, seed),
            scene,
            vehicles,
            hulls,
            tick: 0,
        }
    }

    /// Moves the world on by [`STEP`].
    pub fn step(&mut self) {
        let now = self.now();
        let wind = self.wind.step();
        self.tick += 1;
        let after = self.now();
        for Vehicle { pilot, readings, quadrotor, .. } in &mut self.vehicles {
            pilot.sense(now, readings, quadrotor);
        }
        for vehicle in &mut self.vehicles {
            if vehicle.fly(now, after, &wind) {
                self.referee.count_hard_landing();
            }
        }
        self.scene.move_on(after);
        self.judge();
        self.hulls.clear();
        self.hulls.extend(self.vehicles.iter().map(|vehicle| hull_of(&vehicle.quadrotor)));
        for (own, vehicle) in self.vehicles.iter_mut().enumerate() {
            let surroundings = Surroundings { scene: &self.scene, hulls: &self.hulls, own };
            vehicle.sense(self.tick, after, &surroundings);
        }
    }

    /// Time since the run began.
    pub fn now(&self) -> Duration {
        // A tick count of centuries still fits.
        Duration::from_millis(self.tick * STEP.as_millis() as u64)
    }

    /// The world without its vehicles, as it is now.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    pub fn vehicle_count(&self) -> usize {
        self.vehicles.len()
    }

    /// The true state of vehicle `index`; `None` if there is no such vehicle.
    pub fn vehicle(&self, index: usize) -> Option<VehicleState> {
        self.vehicles.get(index).map(Vehicle::state)
    }

    /// The newest readings of vehicle `index`.
    pub fn readings(&self, index: usize) -> Option<&SensorReadings> {
        self.vehicles.get(index).map(|vehicle| &vehicle.readings)
    }

    /// Takes the lidar scans that have come since the last call, each with its vehicle's index;
    /// of several by one vehicle the newest. Vehicles scan in turn, not all at once.
    pub fn take_scans(&mut self) -> Vec<(usize, Scan)> {
        let vehicles = self.vehicles.iter_mut().enumerate();
        vehicles.filter_map(|(index, vehicle)| Some((index, vehicle.scan.take()?))).collect()
    }

    /// Takes the poses that floor cameras have found by markers since the last call, each with its vehicle's index.
    pub fn take_fixes(&mut self) -> Vec<(usize, PoseFix)> {
        let vehicles = self.vehicles.iter_mut().enumerate();
        vehicles.flat_map(|(index, vehicle)| vehicle.fixes.drain(..).map(move |fix| (index, fix))).collect()
    }

    /// Sends MAVLink bytes to the autopilot of vehicle `index`.
    pub fn send(&mut self, index: usize, bytes: &[u8]) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.pilot.receive(bytes);
        }
    }

    /// Takes the MAVLink bytes that the autopilot of vehicle `index` has sent since the last call.
    pub fn receive(&mut self, index: usize) -> Vec<u8> {
        self.vehicles.get_mut(index).map_or_else(Vec::new, |vehicle| vehicle.pilot.take_output())
    }

    /// Flies vehicle `index` by these commands from now on, in place of its built-in autopilot.
    pub fn drive(&mut self, index: usize, commands: MotorCommands) {
        self.seat(index, Box::new(Fixed(commands)));
    }

    /// Lets `pilot` fly vehicle `index` from now on, in place of its built-in autopilot.
    pub fn seat(&mut self, index: usize, pilot: Box<dyn Pilot>) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.pilot = pilot;
        }
    }

    /// Puts vehicle `index` somewhere, in motion or at rest, as no force could; for tests and for
    /// starts in the air.
    pub fn place(&mut self, index: usize, motion: RigidState) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.quadrotor.set_state(motion);
        }
    }

    /// Before the first step: vehicle `index` begins in the air where it is, above its `home` (ENU, m). Its autopilot is
    /// armed and holds it; it hangs still for [`HANGS`].
    pub fn begin_in_air(&mut self, index: usize, home: Vector3<f64>) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.hangs_until = HANGS;
            vehicle.pilot.begin_in_air(home, HANGS);
        }
    }

    /// Leaves this share of its battery's energy, 0 to 1, to vehicle `index`.
    pub fn charge(&mut self, index: usize, fraction: f64) {
        if let Some(vehicle) = self.vehicles.get_mut(index) {
            vehicle.quadrotor.charge(fraction);
            vehicle.readings.battery = vehicle.quadrotor.battery();
        }
    }

    /// The record of collisions, separation and clearance so far.
    pub fn truth(&self) -> Truth {
        self.referee.truth()
    }

    fn judge(&mut self) {
        let players: Vec<Player> =
            self.vehicles.iter().map(|vehicle| player_of(&vehicle.quadrotor)).collect();
        for index in self.referee.judge(&players, &self.scene) {
            if let Some(vehicle) = self.vehicles.get_mut(index) {
                vehicle.quadrotor.wreck();
            }
        }
    }
}

impl Vehicle {
    fn new(quadrotor: Quadrotor, setup: &VehicleSetup, seed: u64, surroundings: &Surroundings<'_>) -> Self {
        let index = surroundings.own as u64;
        // Steps of 12 ms: 25 vehicles share the 100 ms of a 10 Hz instrument evenly.
        let phase = 3 * index;
        let model = quadrotor.model();
        let errors =
            FixErrors::new(setup.position_errors.clone(), Noise::new(seed, FIX_ERROR_STREAM + index));
        let mut sensors = {
            let flow = Noise::new(seed, FLOW_STREAM + index);
            Sensors::new(model, Noise::new(seed, 2 * index), flow, errors, phase)
        };
        let camera =
            model.floor_camera.map(|model| FloorCamera::new(model, Noise::new(seed, CAMERA_STREAM + index)));
        let lidar = model.lidar.map(|model| Lidar::new(model, seed, 2 * index + 1));
        let autopilot = Autopilot::new(AutopilotConfig {
            position_errors: setup.position_errors.clone(),
            ..AutopilotConfig::new(setup.system_id, model.clone(), *surroundings.scene.datum())
        });
        Self {
            readings: sensors.read(0, &quadrotor, surroundings),
            quadrotor,
            sensors,
            pilot: Box::new(BuiltIn::new(autopilot)),
            lidar,
            camera,
            fixes: Vec::new(),
            phase,
            hangs_until: Duration::ZERO,
            scan: None,
            path_length_m: 0.0,
            lifted_off: None,
            last_airborne: Duration::ZERO,
        }
    }

    /// One step from `now` to `after`; tells whether it ended in a crash on the ground.
    fn fly(&mut self, now: Duration, after: Duration, wind: &Vector3<f64>) -> bool {
        let commands = self.pilot.commands();
        if after <= self.hangs_until {
            self.quadrotor.hang(&commands);
            return false;
        }
        let before = self.quadrotor.state().position;
        let touchdown = self.quadrotor.step(&commands, wind);
        if !self.quadrotor.on_ground() && !self.quadrotor.wrecked() {
            self.path_length_m += (self.quadrotor.state().position - before).norm();
            self.lifted_off.get_or_insert(now);
            self.last_airborne = after;
        }
        let crashed = !self.quadrotor.wrecked() && touchdown.is_some_and(|touchdown| touchdown.is_crash());
        if crashed {
            self.quadrotor.wreck();
        }
        crashed
    }

    fn sense(&mut self, tick: u64, now: Duration, surroundings: &Surroundings<'_>) {
        self.readings = self.sensors.read(tick, &self.quadrotor, surroundings);
        if let (Some(camera), Some(floor)) = (&mut self.camera, surroundings.scene.markers()) {
            if is_due(tick + self.phase, camera.rate_hz()) && !self.sensors.lost().markers {
                camera.look(now, floor, self.quadrotor.state());
            }
            self.fixes.extend(camera.take(now));
        }
        let Some(lidar) = &mut self.lidar else { return };
        if is_due(tick + self.phase, lidar.rate_hz()) {
            let pose = self.quadrotor.state().pose();
            self.scan = Some(lidar.scan(now, &pose, surroundings));
        }
    }

    fn state(&self) -> VehicleState {
        VehicleState {
            motion: *self.quadrotor.state(),
            battery: self.quadrotor.battery(),
            airborne: !self.quadrotor.on_ground(),
            crashed: self.quadrotor.wrecked(),
            path_length_m: self.path_length_m,
            flight_time: self.lifted_off.map_or(Duration::ZERO, |lifted_off| self.last_airborne - lifted_off),
        }
    }
}

fn hull_of(quadrotor: &Quadrotor) -> Hull {
    Hull { centre: quadrotor.state().position, radius_m: quadrotor.model().hull_radius_m }
}

fn player_of(quadrotor: &Quadrotor) -> Player {
    Player { hull: hull_of(quadrotor), airborne: !quadrotor.on_ground(), wrecked: quadrotor.wrecked() }
}
