//! Something that tells nobody where it is flies across a vehicle's way: the vehicle sees it by lidar alone.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::{LocalPlanner, Outcome};
use skein_mav::{Command, Companion, CompanionConfig, FlightMode, SetPoint};
use skein_sim::cli::Controller;
use skein_sim::fly::{self, Links, Swarm};
use skein_sim::scenario::Scenario;
use skein_wire::{Fleet, Network, NetworkConfig};
use skein_world::{PositionErrors, Simulation, Truth, VehicleModel, VehicleSetup};

const SCENARIO: &str = r#"
vehicles = 1
cruise_speed_m_s = 2.0

[bounds]
min_m = [-40.0, -30.0, -1.0]
max_m = [50.0, 30.0, 12.0]

[[vehicle]]
start_m = [-30.0, 0.0]
waypoints_m = [[30.0, 0.0, 3.0]]
"#;
/// Where the ways cross, and from where the intruder comes.
const CROSSING_M: f64 = 15.0;
const AWAY_M: f64 = 12.0;
/// Index of the intruder, which has an autopilot and no agent.
const INTRUDER: usize = 1;

/// Flies straight across, whoever comes.
struct Intruder {
    companion: Companion,
    speed_m_s: f64,
    heard: Vec<u8>,
}

impl Intruder {
    /// Once in a tick; sets out when the vehicle is as far from the crossing, in time, as the intruder is.
    fn tick(&mut self, swarm: &mut Swarm, vehicle_m_s: f64) {
        let now = swarm.now();
        let vehicle = swarm.simulation().vehicle(0).unwrap().motion;
        let sets_out = (CROSSING_M - vehicle.position.x) / vehicle_m_s <= AWAY_M / self.speed_m_s;
        self.companion.receive(now, &std::mem::take(&mut self.heard));
        self.companion.tick(now);
        while self.companion.poll_event().is_some() {}
        let telemetry = self.companion.telemetry();
        let (mode, armed, ready) = (telemetry.mode, telemetry.armed, telemetry.ready_to_arm);
        let height_m = telemetry.position.map_or(0.0, |position| position.value.z);
        let every_second = now.as_millis().is_multiple_of(1000);
        match mode {
            _ if !every_second => {}
            _ if ready && !armed => self.companion.command(now, Command::Arm),
            FlightMode::Hold if armed && height_m < 2.0 => {
                self.companion.command(now, Command::Takeoff { height_m: 3.0 });
            }
            FlightMode::Hold if armed => self.companion.command(now, Command::Offboard),
            _ => {}
        }
        let speed_m_s = if sets_out { self.speed_m_s } else { 0.0 };
        self.companion.set_point(now, SetPoint::Planar { vx: 0.0, vy: speed_m_s, z: 3.0, yaw: None });
        swarm.send_mavlink(INTRUDER, &self.companion.take_output());
    }
}

/// Flies until the vehicle's mission is over.
fn meet(local: LocalPlanner, intruder_m_s: f64, seed: u64) -> (Option<Outcome>, Truth) {
    let mut scenario = Scenario::from_toml(SCENARIO, "crossing.toml", None, seed).unwrap();
    scenario.planners.local = local;
    let mut config = fly::simulation_config(&scenario);
    let start = Vector3::new(CROSSING_M, -AWAY_M, 0.0);
    let model = VehicleModel::built_in("x500").unwrap();
    config.vehicles.push(VehicleSetup {
        model,
        position: start,
        yaw: 0.0,
        system_id: 9,
        position_errors: PositionErrors::default(),
    });
    let network = Network::new(NetworkConfig::default(), seed);
    let links = Links {
        vehicles: vec![Box::new(network.join(&fly::vehicle_name(0)))],
        ground: Box::new(network.join(&fly::GROUND)),
    };
    let mut swarm = Swarm::new(
        Simulation::new(config),
        fly::agent_configs(&scenario),
        fly::ground_config(&scenario, Fleet::new(fly::FLEET).unwrap(), Controller::Bp),
        links,
    )
    .unwrap();
    let companion = Companion::new(CompanionConfig::new(9, *scenario.scene.datum()));
    let mut intruder = Intruder { companion, speed_m_s: intruder_m_s, heard: Vec::new() };
    while swarm.now() < Duration::from_secs(120) && !swarm.is_over() {
        network.advance(swarm.now() + skein_world::STEP);
        let happenings = swarm.step();
        intruder.heard.extend(swarm.receive_mavlink(INTRUDER));
        if happenings.ticked {
            intruder.tick(&mut swarm, scenario.cruise_speed_m_s);
        }
    }
    let outcome = swarm.outcomes().next().unwrap().cloned();
    (outcome, swarm.truth())
}

#[test]
fn something_that_crosses_is_given_way_to() {
    for local in [LocalPlanner::Apf, LocalPlanner::Vfh] {
        for (intruder_m_s, seed) in [(0.8, 1), (1.5, 2)] {
            let (outcome, truth) = meet(local, intruder_m_s, seed);
            let case = format!("{local:?}, {intruder_m_s} m/s: {truth:?}");
            assert_eq!(outcome, Some(Outcome::Complete), "{case}");
            assert_eq!(truth.collisions_vehicle, 0, "{case}");
            assert!(truth.min_separation_m.unwrap() < 4.0, "they have met: {case}");
        }
    }
}
