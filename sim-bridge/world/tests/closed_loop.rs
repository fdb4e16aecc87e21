//! A vehicle flown over its MAVLink pipe, as its agent will fly it.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Command, Companion, CompanionConfig, Landed, SetPoint};
use skein_world::{
    Obstacle, PositionErrors, Scene, Simulation, SimulationConfig, VehicleModel, VehicleSetup, VehicleState,
    WindConfig,
};

/// A companion and the world it flies in.
struct Flight {
    simulation: Simulation,
    companion: Companion,
}

impl Flight {
    fn new(model: &str, wind: WindConfig) -> Self {
        let scene = Scene::new("glade", vec![Obstacle::trunk("oak", 20.0, 0.0, 0.3, 12.0)]);
        let companion = Companion::new(CompanionConfig::new(1, *scene.datum()));
        let vehicle = VehicleSetup {
            model: VehicleModel::built_in(model).expect("a built-in vehicle"),
            position: Vector3::new(1.0, 2.0, 0.0),
            yaw: 0.7,
            system_id: 1,
            position_errors: PositionErrors::default(),
        };
        Self {
            simulation: Simulation::new(SimulationConfig { scene, vehicles: vec![vehicle], seed: 4, wind }),
            companion,
        }
    }

    /// 20 ms of flight.
    fn tick(&mut self, set_point: Option<SetPoint>) {
        let now = self.simulation.now();
        self.companion.receive(now, &self.simulation.receive(0));
        self.companion.tick(now);
        if let Some(set_point) = set_point {
            self.companion.set_point(now, set_point);
        }
        self.simulation.send(0, &self.companion.take_output());
        for _ in 0..5 {
            self.simulation.step();
        }
    }

    fn command(&mut self, command: Command) {
        self.companion.command(self.simulation.now(), command);
    }

    /// Flies until `done`, for `seconds` at most.
    fn fly(&mut self, seconds: u32, set_point: Option<SetPoint>, done: impl Fn(&Self) -> bool) {
        for _ in 0..seconds * 50 {
            if done(self) {
                return;
            }
            self.tick(set_point);
        }
        assert!(done(self), "not done in {seconds} s: {:?}", self.companion.telemetry());
    }

    fn vehicle(&self) -> VehicleState {
        self.simulation.vehicle(0).expect("a vehicle")
    }

    fn near(&self, target: Vector3<f64>) -> bool {
        (self.vehicle().motion.position - target).norm() < 0.3
    }

    /// Arms, climbs to 3 m, flies `target` by position, and lands there.
    fn there_and_down(&mut self, target: Vector3<f64>) {
        self.fly(10, None, |flight| flight.companion.telemetry().ready_to_arm);
        self.command(Command::Arm);
        self.fly(2, None, |flight| flight.companion.telemetry().armed);
        self.command(Command::Takeoff { height_m: 3.0 });
        self.fly(15, None, |flight| flight.vehicle().motion.position.z > 2.8);
        let set_point = Some(SetPoint::Position { position: target, yaw: None });
        let streaming_until = self.simulation.now() + Duration::from_secs(1);
        self.fly(2, set_point, |flight| flight.simulation.now() >= streaming_until);
        self.command(Command::Offboard);
        self.fly(20, set_point, |flight| flight.near(target));
        self.command(Command::Land);
        self.fly(20, None, |flight| {
            let telemetry = flight.companion.telemetry();
            telemetry.landed == Landed::OnGround && !telemetry.armed
        });
    }
}

#[test]
fn every_built_in_vehicle_with_satellites_takes_off_flies_to_a_point_and_lands() {
    let has_gps = |name: &&str| VehicleModel::built_in(name).is_ok_and(|model| model.gps.is_some());
    for model in VehicleModel::built_in_names().filter(has_gps) {
        let mut flight = Flight::new(model, WindConfig::default());
        let target = Vector3::new(6.0, -3.0, 3.0);
        flight.there_and_down(target);
        let vehicle = flight.vehicle();
        assert!(!vehicle.crashed && !vehicle.airborne, "{model}: {vehicle:?}");
        assert!((vehicle.motion.position - target).xy().norm() < 0.6, "{model}: {vehicle:?}");
        let truth = flight.simulation.truth();
        assert_eq!(truth.collisions_obstacle, 0, "{model}");
        assert!(truth.min_clearance_m.is_some_and(|clearance| clearance > 10.0), "{model}: {truth:?}");
        // Up 3, across 7.07, down 3.
        assert!((12.0..17.0).contains(&vehicle.path_length_m), "{model}: {}", vehicle.path_length_m);
    }
}

#[test]
fn a_vehicle_holds_its_own_against_gusts() {
    let mut flight = Flight::new(
        "x500",
        WindConfig { mean: Vector3::new(-3.0, 2.0, 0.0), gust_sigma_m_s: 1.0, gust_time_s: 2.0 },
    );
    flight.there_and_down(Vector3::new(6.0, -3.0, 3.0));
    assert!(!flight.vehicle().crashed);
}
