//! One vehicle in an empty field, flown over MAVLink by a companion.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Command, Companion, CompanionConfig, FlightMode, Landed, MavEvent, SetPoint, Telemetry};
use skein_world::{
    PositionErrors, Scene, Simulation, SimulationConfig, VehicleModel, VehicleSetup, VehicleState, WindConfig,
};

/// Set-points and the companion run at 50 Hz.
const STEPS_PER_TICK: u32 = 5;

pub struct Flight {
    pub simulation: Simulation,
    pub companion: Companion,
    pub events: Vec<MavEvent>,
    /// Sent at each tick.
    pub set_point: Option<SetPoint>,
}

pub fn x500() -> VehicleModel {
    VehicleModel::built_in("x500").unwrap()
}

pub fn at(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

pub fn velocity(x: f64, y: f64, z: f64) -> SetPoint {
    SetPoint::Velocity { velocity: at(x, y, z), yaw: None }
}

impl Flight {
    pub fn new(model: VehicleModel, seed: u64, wind: WindConfig) -> Self {
        Self::misled(model, seed, wind, PositionErrors::default())
    }

    /// The same with errors of its position.
    pub fn misled(model: VehicleModel, seed: u64, wind: WindConfig, position_errors: PositionErrors) -> Self {
        let scene = Scene::new("field", Vec::new());
        let datum = *scene.datum();
        let simulation = Simulation::new(SimulationConfig {
            scene,
            vehicles: vec![VehicleSetup {
                model,
                position: at(2.0, -3.0, 0.0),
                yaw: 0.5,
                system_id: 1,
                position_errors,
            }],
            seed,
            wind,
        });
        Self {
            simulation,
            companion: Companion::new(CompanionConfig::new(1, datum)),
            events: Vec::new(),
            set_point: None,
        }
    }

    /// Ready to arm.
    pub fn ready(model: VehicleModel, seed: u64) -> Self {
        let mut flight = Self::new(model, seed, WindConfig::default());
        flight.until("ready to arm", 10.0, |flight| flight.telemetry().ready_to_arm);
        flight
    }

    /// Holding three metres above the ground.
    pub fn airborne(model: VehicleModel, seed: u64) -> Self {
        let mut flight = Self::ready(model, seed);
        flight.take_off(3.0);
        flight
    }

    /// Holding in offboard with a zero velocity.
    pub fn offboard(model: VehicleModel, seed: u64) -> Self {
        let mut flight = Self::airborne(model, seed);
        flight.set_point = Some(velocity(0.0, 0.0, 0.0));
        flight.run(0.5);
        flight.command(Command::Offboard);
        flight.until_mode(FlightMode::Offboard);
        flight
    }

    pub fn take_off(&mut self, height_m: f64) {
        self.command(Command::Arm);
        self.until("armed", 2.0, |flight| flight.telemetry().armed);
        self.command(Command::Takeoff { height_m });
        self.until("take-off", 2.0, |flight| flight.telemetry().mode == FlightMode::Takeoff);
        self.until("climb", 15.0, |flight| flight.telemetry().mode == FlightMode::Hold);
    }

    pub fn now(&self) -> Duration {
        self.simulation.now()
    }

    pub fn truth(&self) -> VehicleState {
        self.simulation.vehicle(0).unwrap()
    }

    pub fn telemetry(&self) -> &Telemetry {
        self.companion.telemetry()
    }

    pub fn command(&mut self, command: Command) {
        let now = self.now();
        self.companion.command(now, command);
    }

    pub fn has_text(&self, part: &str) -> bool {
        let texts = self.events.iter().filter_map(|event| match event {
            MavEvent::Text(text) => Some(&text.text),
            _ => None,
        });
        texts.into_iter().any(|text| text.contains(part))
    }

    pub fn tick(&mut self) {
        let now = self.now();
        self.companion.tick(now);
        if let Some(set_point) = self.set_point {
            self.companion.set_point(now, set_point);
        }
        let up = self.companion.take_output();
        self.simulation.send(0, &up);
        for _ in 0..STEPS_PER_TICK {
            self.simulation.step();
        }
        let down = self.simulation.receive(0);
        let now = self.now();
        self.companion.receive(now, &down);
        while let Some(event) = self.companion.poll_event() {
            self.events.push(event);
        }
    }

    pub fn run(&mut self, seconds: f64) {
        let end = self.now() + Duration::from_secs_f64(seconds);
        while self.now() < end {
            self.tick();
        }
    }

    /// Runs until something has happened; fails when it has not after `seconds`. Returns how long it took, s.
    pub fn until(&mut self, what: &str, seconds: f64, done: impl Fn(&Self) -> bool) -> f64 {
        let start = self.now();
        while !done(self) {
            let waited = (self.now() - start).as_secs_f64();
            assert!(waited < seconds, "no {what} after {seconds} s: {:?}, {:?}", self.truth(), self.events);
            self.tick();
        }
        (self.now() - start).as_secs_f64()
    }

    pub fn until_mode(&mut self, mode: FlightMode) -> f64 {
        self.until(&mode.to_string(), 3.0, |flight| flight.telemetry().mode == mode)
    }

    pub fn until_landed(&mut self, seconds: f64) -> f64 {
        self.until("landing", seconds, |flight| {
            !flight.telemetry().armed && flight.telemetry().landed == Landed::OnGround
        })
    }
}
