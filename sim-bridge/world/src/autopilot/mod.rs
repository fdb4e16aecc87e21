//! The built-in autopilot: one per vehicle, reached over MAVLink alone, as PX4 would be.
//!
//! Each step of 4 ms it estimates its motion from the instruments ([`estimator`]), decides what to fly
//! ([`modes`], [`mission`]) and flies it with a cascade of loops: position and velocity
//! ([`position_control`]), attitude and rate ([`attitude_control`]), rotors ([`mixer`]). It speaks PX4's
//! dialect and uses PX4's parameter names, so that one companion flies both.

mod attitude_control;
mod estimator;
mod fence;
mod mission;
mod mixer;
mod modes;
mod parameters;
mod position_control;
mod telling;

use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_mav::{
    Datum, Distance, Endpoint, EndpointConfig, Inertial, Measured, MissionItem, ParameterTable, Request,
    VehicleState,
};

use crate::position_error::PositionErrors;
use crate::quadrotor::MotorCommands;
use crate::sensors::SensorReadings;
use crate::vehicle::{RangefinderModel, VehicleModel};
use attitude_control::AttitudeControl;
use estimator::{Estimate, Estimator};
use fence::GeoFence;
use mixer::Mixer;
use modes::{Drive, Modes, Sticks};
use parameters::Settings;
pub use parameters::default_parameters;
use position_control::PositionControl;
use telling::Telling;

/// Share of full thrust of rotors that idle on the ground.
const IDLE_SHARE: f64 = 0.05;

/// All that an autopilot is made from.
#[derive(Debug, Clone)]
pub struct AutopilotConfig {
    /// MAVLink system id of the vehicle, 1..=255.
    pub system_id: u8,
    /// The vehicle it flies: its gains and limits follow from that.
    pub vehicle: VehicleModel,
    pub datum: Datum,
    /// Its parameters; see [`default_parameters`].
    pub parameters: ParameterTable,
    /// Of them, the faults of autopilots, and the accuracy that is told.
    pub position_errors: PositionErrors,
}

impl AutopilotConfig {
    /// An autopilot with default parameters.
    pub fn new(system_id: u8, vehicle: VehicleModel, datum: Datum) -> Self {
        Self {
            system_id,
            parameters: default_parameters(&vehicle),
            vehicle,
            datum,
            position_errors: PositionErrors::default(),
        }
    }
}

/// The situation of the vehicle, from which modes and missions decide.
struct Situation<'a> {
    now: Duration,
    estimate: &'a Estimate,
    /// The error is the reason why the estimate cannot be flown by.
    readiness: Result<(), &'static str>,
    readings: &'a SensorReadings,
    settings: &'a Settings,
    datum: &'a Datum,
    mission: &'a [MissionItem],
    home: Vector3<f64>,
    fence: &'a GeoFence,
    rally: &'a [Vector2<f64>],
}

/// The built-in autopilot of one vehicle.
///
/// ```
/// use std::time::Duration;
/// use nalgebra::Vector3;
/// use skein_mav::Datum;
/// use skein_world::{Battery, Imu, MotorCommands, SensorReadings, VehicleModel};
/// use skein_world::autopilot::{Autopilot, AutopilotConfig};
///
/// let model = VehicleModel::built_in("x500")?;
/// let datum = Datum::from_degrees(47.397742, 8.545594, 488.0);
/// let mut autopilot = Autopilot::new(AutopilotConfig::new(1, model, datum));
/// let readings = SensorReadings {
///     imu: Imu { angular_rate: Vector3::zeros(), specific_force: Vector3::new(0.0, 0.0, 9.81) },
///     gps: None,
///     baro_height_m: None,
///     fix_error: Vector3::zeros(),
///     magnetic_heading: None,
///     rangefinder_down_m: None,
///     flow: None,
///     contact: true,
///     battery: Battery { fraction: 1.0, voltage_v: 16.8 },
/// };
/// let motors = autopilot.step(Duration::ZERO, &readings);
/// assert_eq!(motors, MotorCommands::default(), "disarmed");
/// assert!(!autopilot.take_output().is_empty(), "a heartbeat");
/// # Ok::<(), skein_world::VehicleError>(())
/// ```
pub struct Autopilot {
    endpoint: Endpoint,
    datum: Datum,
    settings: Settings,
    estimator: Estimator,
    modes: Modes,
    position_control: PositionControl,
    attitude_control: AttitudeControl,
    mixer: Mixer,
    telling: Telling,
    fence: GeoFence,
    /// Places to return to, ENU, m.
    rally: Vec<Vector2<f64>>,
    rangefinder: RangefinderModel,
    /// Time of the last step: bytes that arrive between two steps are stamped with it.
    now: Duration,
    /// The vehicle hangs in the air until then.
    hangs_until: Option<Duration>,
    /// Share of full thrust that carries the vehicle.
    hover_share: f64,
}

impl Autopilot {
    /// An autopilot that has just been switched on.
    pub fn new(config: AutopilotConfig) -> Self {
        let model = &config.vehicle;
        let attitude_control = AttitudeControl::new(model);
        Self {
            datum: config.datum,
            settings: Settings::read(&config.parameters),
            estimator: Estimator::new(model, config.position_errors.drift),
            telling: Telling::new(&config.position_errors.faults),
            modes: Modes::default(),
            position_control: PositionControl::new(model, attitude_control.bandwidth()),
            attitude_control,
            mixer: Mixer::new(model),
            now: Duration::ZERO,
            hangs_until: None,
            hover_share: model.hover_share(),
            endpoint: Endpoint::new(EndpointConfig {
                system_id: config.system_id,
                datum: config.datum,
                parameters: config.parameters,
                accepts_item: mission::accepts,
                accepts_fence: fence::accepts_fence,
                accepts_rally: fence::accepts_rally,
            }),
            fence: GeoFence::default(),
            rally: Vec::new(),
            rangefinder: config.vehicle.rangefinder,
        }
    }

    /// Begins in the air above `home` (ENU, m), armed: the vehicle hangs still until a moment at which the estimate has
    /// settled, and is held where it is from then on.
    pub fn begin_in_air(&mut self, home: Vector3<f64>, hangs_until: Duration) {
        self.hangs_until = Some(hangs_until);
        self.modes.begin_in_air(home);
    }

    /// Takes in bytes from any station, in whatever pieces they come.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.endpoint.receive(self.now, bytes);
    }

    /// Takes the bytes to be sent to every station.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.endpoint.take_output()
    }

    /// One step of 4 ms: `now` is the time since the run began, the readings are those of this step.
    pub fn step(&mut self, now: Duration, readings: &SensorReadings) -> MotorCommands {
        self.now = now;
        if self.telling.begins_anew(now) {
            self.estimator.forget_position();
            self.endpoint.restart_clock(now);
        }
        self.endpoint.move_origin(self.telling.origin(now));
        self.estimator.update(now, readings);
        self.pass_on(readings);
        while let Some(request) = self.endpoint.next_request() {
            self.serve(request, readings);
        }
        let commands = if self.hangs(readings) {
            MotorCommands([self.hover_share; 4])
        } else {
            let (modes, situation) = self.decide(readings);
            let drive = modes.step(&situation);
            self.drive(drive)
        };
        self.report(readings, &commands);
        commands
    }

    /// Whether the vehicle hangs still; once it does no more, it is to stay where it is.
    fn hangs(&mut self, readings: &SensorReadings) -> bool {
        match self.hangs_until {
            Some(until) if self.now < until => true,
            Some(_) => {
                self.hangs_until = None;
                let (modes, situation) = self.decide(readings);
                modes.stay(&situation);
                false
            }
            None => false,
        }
    }

    /// Passes on what the instruments have measured, to who asks for it.
    fn pass_on(&mut self, readings: &SensorReadings) {
        let inertial = Inertial { rate: readings.imu.angular_rate, force: readings.imu.specific_force };
        self.endpoint.measure(self.now, &Measured::Inertial(inertial));
        if let Some(flow) = readings.flow {
            self.endpoint.measure(self.now, &Measured::Flow(flow));
        }
        if let Some(distance_m) = readings.rangefinder_down_m {
            let distance = Distance {
                distance_m,
                least_m: 0.0,
                most_m: self.rangefinder.range_m,
                sigma_m: Some(self.rangefinder.sigma_m),
                half_cone_rad: 0.0,
            };
            self.endpoint.measure(self.now, &Measured::Distance(distance));
        }
    }

    /// The state machine, and what it decides from.
    fn decide<'a>(&'a mut self, readings: &'a SensorReadings) -> (&'a mut Modes, Situation<'a>) {
        let situation = Situation {
            now: self.now,
            estimate: self.estimator.estimate(),
            readiness: self.estimator.readiness(self.now),
            readings,
            settings: &self.settings,
            datum: &self.datum,
            mission: self.endpoint.mission(),
            home: self.modes.home().unwrap_or_else(Vector3::zeros),
            fence: &self.fence,
            rally: &self.rally,
        };
        (&mut self.modes, situation)
    }

    fn serve(&mut self, request: Request, readings: &SensorReadings) {
        let now = self.now;
        match request {
            Request::Command { ticket, command, .. } => {
                let (modes, situation) = self.decide(readings);
                let result = modes.command(&situation, command);
                self.read_settings();
                self.endpoint.answer(ticket, result);
            }
            Request::External(external) => self.estimator.take_external(now, &external),
            Request::SetPoint { set_point, .. } => self.modes.on_set_point(now, set_point),
            Request::Sticks { forward, left, up, turn_left } => {
                let sticks = Sticks { forward, left, up, turn_left };
                self.modes.on_sticks(now, sticks);
            }
            Request::ParameterChanged { .. } => self.read_settings(),
            Request::PlacesChanged => {
                self.fence = GeoFence::read(self.endpoint.fence(), &self.datum).unwrap_or_default();
                self.rally =
                    fence::rally_points(self.endpoint.rally_points(), &self.datum).unwrap_or_default();
            }
            Request::MissionChanged => {
                let (modes, situation) = self.decide(readings);
                modes.on_mission_changed(&situation);
            }
        }
    }

    /// The settings follow the parameters, but for the cruising speed that a station or the mission asked
    /// for.
    fn read_settings(&mut self) {
        self.settings = Settings::read(self.endpoint.parameters());
        if let Some(speed_m_s) = self.modes.speed() {
            self.settings.cruise_speed_m_s = speed_m_s;
        }
    }

    fn drive(&mut self, drive: Drive) -> MotorCommands {
        let Drive::Fly(demand) = drive else {
            self.position_control.reset();
            self.attitude_control.reset();
            let share = if drive == Drive::Idle { IDLE_SHARE } else { 0.0 };
            return MotorCommands([share; 4]);
        };
        let estimate = self.estimator.estimate();
        let target = self.position_control.step(estimate, &demand, &self.settings);
        let torque = self.attitude_control.step(estimate, &target);
        self.mixer.mix(target.thrust_n, &torque)
    }

    fn report(&mut self, readings: &SensorReadings, commands: &MotorCommands) {
        for (severity, text) in self.modes.take_texts() {
            self.endpoint.text(severity, &text);
        }
        for item in self.modes.take_items_reached() {
            self.endpoint.item_reached(item as u16);
        }
        let (modes, situation) = self.decide(readings);
        let ready_to_arm = modes.armed() || modes.arming_check(&situation).is_ok();
        let sensors_ok = situation.readiness.is_ok();
        let estimate = *situation.estimate;
        let state = VehicleState {
            measured: self.now,
            mode: self.modes.mode(),
            armed: self.modes.armed(),
            landed: self.modes.landed(),
            position: self.estimator.has_position().then_some(estimate.position),
            velocity: estimate.velocity,
            position_sigma_m: self.estimator.position_sigma_m(),
            has_fix: self.estimator.has_gps(self.now),
            attitude: estimate.attitude,
            angular_rate: estimate.angular_rate,
            battery: readings.battery,
            home: self.modes.home(),
            sensors_ok,
            ready_to_arm,
            failsafe: self.modes.failsafe(),
            throttle: commands.0.iter().sum::<f64>() / 4.0,
            mission_item: self.modes.mission_item() as u16,
        };
        self.endpoint.report(self.now, &self.telling.told(self.now, state));
    }
}
