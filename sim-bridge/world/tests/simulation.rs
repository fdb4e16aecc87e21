//! The world in motion: instruments, collisions, records, repetition.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_wire::Scan;
use skein_world::{
    HANGS, MotorCommands, Obstacle, PositionErrors, RigidState, Scene, SensorReadings, Simulation,
    SimulationConfig, VehicleModel, VehicleSetup, Way, WindConfig,
};

fn simulation(obstacles: Vec<Obstacle>, places: &[[f64; 3]], seed: u64) -> Simulation {
    let model = VehicleModel::built_in("x500").expect("a built-in vehicle");
    let vehicles = places.iter().enumerate().map(|(index, place)| VehicleSetup {
        model: model.clone(),
        position: Vector3::from(*place),
        yaw: 0.0,
        system_id: index as u8 + 1,
        position_errors: PositionErrors::default(),
    });
    Simulation::new(SimulationConfig {
        scene: Scene::new("test", obstacles),
        vehicles: vehicles.collect(),
        seed,
        wind: WindConfig::default(),
    })
}

fn hover() -> MotorCommands {
    let model = VehicleModel::built_in("x500").expect("a built-in vehicle");
    MotorCommands([model.hover_share(); 4])
}

fn flying(position: [f64; 3], velocity: [f64; 3]) -> RigidState {
    RigidState {
        position: position.into(),
        velocity: velocity.into(),
        attitude: UnitQuaternion::identity(),
        angular_rate: Vector3::zeros(),
    }
}

fn run(simulation: &mut Simulation, seconds: f64) {
    for _ in 0..(seconds * 250.0) as usize {
        simulation.step();
    }
}

#[test]
fn time_goes_in_steps_of_four_milliseconds() {
    let mut simulation = simulation(Vec::new(), &[[0.0; 3]], 1);
    assert_eq!(simulation.now(), Duration::ZERO);
    run(&mut simulation, 2.0);
    assert_eq!(simulation.now(), Duration::from_secs(2));
}

#[test]
fn a_vehicle_begins_in_the_air_hangs_until_its_autopilot_knows_where_it_is_and_is_held_there() {
    let place = [30.0, -12.0, 8.0];
    let mut simulation = simulation(Vec::new(), &[place], 1);
    simulation.charge(0, 0.6);
    simulation.begin_in_air(0, Vector3::new(4.0, 0.0, 0.0));
    run(&mut simulation, HANGS.as_secs_f64());
    let hanging = simulation.vehicle(0).expect("it is there");
    assert_eq!((<[f64; 3]>::from(hanging.motion.position), hanging.battery.fraction), (place, 0.6));
    run(&mut simulation, 10.0);
    let held = simulation.vehicle(0).expect("it is there");
    let strayed_m = (held.motion.position - Vector3::from(place)).norm();
    assert!(held.airborne && !held.crashed && strayed_m < 0.3, "{strayed_m} m, {held:?}");
    assert!((0.58..0.6).contains(&held.battery.fraction), "{}", held.battery.fraction);
}

#[test]
fn instruments_speak_at_their_rates() {
    let mut simulation = simulation(Vec::new(), &[[0.0; 3]], 1);
    let mut counts = [0; 4];
    for _ in 0..1000 {
        simulation.step();
        let readings = simulation.readings(0).expect("a vehicle");
        for (count, spoke) in counts.iter_mut().zip([
            readings.gps.is_some(),
            readings.baro_height_m.is_some(),
            readings.magnetic_heading.is_some(),
            readings.rangefinder_down_m.is_some(),
        ]) {
            *count += u32::from(spoke);
        }
    }
    assert_eq!(counts, [40, 200, 200, 100]);
}

#[test]
fn readings_scatter_about_the_truth() {
    let mut simulation = simulation(Vec::new(), &[[3.0, -4.0, 0.0]], 5);
    simulation.drive(0, MotorCommands::default());
    let mut fixes = Vec::new();
    let mut forces = Vec::new();
    for _ in 0..10_000 {
        simulation.step();
        let readings = simulation.readings(0).expect("a vehicle");
        assert!(readings.contact);
        forces.push(readings.imu.specific_force);
        fixes.extend(readings.gps.map(|gps| gps.position));
    }
    let mean = |vectors: &[Vector3<f64>]| vectors.iter().sum::<Vector3<f64>>() / vectors.len() as f64;
    let place = mean(&fixes);
    assert!((place - Vector3::new(3.0, -4.0, 0.15)).norm() < 0.02, "{place}");
    let spread = fixes.iter().map(|fix| (fix.x - place.x) * (fix.x - place.x)).sum::<f64>();
    let sigma = (spread / fixes.len() as f64).sqrt();
    assert!((sigma - 0.05).abs() < 0.01, "{sigma}");
    // The constant bias of 0.03 stays.
    let force = mean(&forces);
    assert!((force - Vector3::new(0.0, 0.0, 9.806_65)).norm() < 0.15, "{force}");
}

#[test]
fn the_gyroscope_and_the_compass_agree_on_a_turn_to_the_left() {
    let mut simulation = simulation(Vec::new(), &[[0.0; 3]], 1);
    simulation.drive(0, MotorCommands::default());
    let turning = RigidState {
        attitude: UnitQuaternion::from_euler_angles(0.0, 0.0, 3.0),
        angular_rate: Vector3::new(0.0, 0.0, 1.0),
        ..flying([0.0, 0.0, 30.0], [0.0; 3])
    };
    simulation.place(0, turning);
    simulation.step();
    let rate = simulation.readings(0).expect("a vehicle").imu.angular_rate;
    assert!((rate - Vector3::new(0.0, 0.0, 1.0)).norm() < 0.05, "{rate}");
    run(&mut simulation, 0.5);
    let heading = (0..10)
        .find_map(|_| {
            simulation.step();
            simulation.readings(0)?.magnetic_heading
        })
        .expect("a heading");
    // Half a radian further is beyond pi.
    assert!((heading - (3.52 - std::f64::consts::TAU)).abs() < 0.1, "{heading}");
}

#[test]
fn a_flat_roof_is_ground_to_the_rangefinder() {
    let roof = Obstacle::block("roof", Vector3::new(0.0, 0.0, 1.0), Vector3::new(4.0, 4.0, 2.0));
    let mut simulation = simulation(vec![roof], &[[10.0, 0.0, 0.0]], 1);
    simulation.drive(0, hover());
    simulation.place(0, flying([0.0, 0.0, 6.0], [0.0; 3]));
    let range = (0..20)
        .find_map(|_| {
            simulation.step();
            simulation.readings(0)?.rangefinder_down_m
        })
        .expect("a range");
    assert!((range - 4.0).abs() < 0.2, "{range}");
}

#[test]
fn scans_come_ten_times_a_second_from_each_vehicle_in_turn() {
    let places: Vec<[f64; 3]> = (0..8).map(|i| [f64::from(i) * 3.0, 0.0, 0.0]).collect();
    let mut simulation = simulation(Vec::new(), &places, 1);
    let mut counts = [0; 8];
    for _ in 0..250 {
        simulation.step();
        let scans = simulation.take_scans();
        assert!(scans.len() <= 1, "never two at once");
        for (vehicle, scan) in scans {
            assert_eq!(scan.stamp, simulation.now());
            counts[vehicle] += 1;
        }
    }
    assert_eq!(counts, [10; 8]);
}

#[test]
fn flying_into_a_tree_is_one_collision_and_ends_the_flight() {
    let oak = Obstacle::trunk("oak", 5.0, 0.0, 0.5, 12.0);
    let mut simulation = simulation(vec![oak], &[[0.0; 3]], 1);
    simulation.drive(0, hover());
    simulation.place(0, flying([0.0, 0.0, 5.0], [4.0, 0.0, 0.0]));
    run(&mut simulation, 0.5);
    let before = simulation.truth();
    assert_eq!(before.collisions_obstacle, 0);
    let vehicle = simulation.vehicle(0).expect("a vehicle");
    let hull_to_bark = 5.0 - 0.5 - 0.25 - vehicle.motion.position.x;
    let clearance = before.min_clearance_m.expect("somebody flew");
    assert!((clearance - hull_to_bark).abs() < 1e-6, "{clearance} {hull_to_bark}");
    run(&mut simulation, 4.0);
    let after = simulation.truth();
    assert_eq!((after.collisions_obstacle, after.collisions_vehicle), (1, 0));
    assert_eq!(after.min_clearance_m, Some(0.0));
    let wreck = simulation.vehicle(0).expect("a vehicle");
    assert!(wreck.crashed && !wreck.airborne);
    assert!(wreck.motion.position.x < 4.3, "it stopped at the tree");
}

#[test]
fn two_vehicles_that_meet_are_one_collision() {
    let mut simulation = simulation(Vec::new(), &[[0.0; 3], [9.0, 0.0, 0.0]], 1);
    for index in 0..2 {
        simulation.drive(index, hover());
    }
    simulation.place(0, flying([0.0, 0.0, 5.0], [2.0, 0.0, 0.0]));
    simulation.place(1, flying([6.0, 0.0, 5.0], [-2.0, 0.0, 0.0]));
    run(&mut simulation, 1.0);
    let separation = simulation.truth().min_separation_m.expect("both flew");
    assert!((2.0..2.5).contains(&separation), "{separation}");
    run(&mut simulation, 4.0);
    let truth = simulation.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 1));
    assert!(truth.min_separation_m.expect("both flew") <= 0.5);
    assert_eq!(truth.min_clearance_m, None, "there is no obstacle");
    assert!((0..2).all(|index| simulation.vehicle(index).expect("a vehicle").crashed));
}

#[test]
fn vehicles_on_the_ground_are_neither_close_nor_colliding() {
    let mut simulation = simulation(Vec::new(), &[[0.0; 3], [0.3, 0.0, 0.0]], 1);
    for index in 0..2 {
        simulation.drive(index, MotorCommands::default());
    }
    run(&mut simulation, 1.0);
    let truth = simulation.truth();
    assert_eq!((truth.collisions_vehicle, truth.min_separation_m), (0, None));
}

#[test]
fn leaving_the_bounds_counts_once_each_time_and_does_not_end_the_flight() {
    let mut simulation = simulation(Vec::new(), &[[0.0; 3]], 1);
    simulation.drive(0, hover());
    simulation.place(0, flying([49.0, 0.0, 5.0], [4.0, 0.0, 0.0]));
    run(&mut simulation, 1.0);
    assert_eq!(simulation.truth().collisions_obstacle, 1);
    simulation.place(0, flying([49.0, 0.0, 5.0], [4.0, 0.0, 0.0]));
    run(&mut simulation, 1.0);
    assert_eq!(simulation.truth().collisions_obstacle, 2);
    assert!(!simulation.vehicle(0).expect("a vehicle").crashed);
}

#[test]
fn a_fall_is_a_collision_with_the_ground() {
    let mut simulation = simulation(Vec::new(), &[[0.0, 0.0, 10.0]], 1);
    simulation.drive(0, MotorCommands::default());
    run(&mut simulation, 3.0);
    assert_eq!(simulation.truth().collisions_obstacle, 1);
    let vehicle = simulation.vehicle(0).expect("a vehicle");
    assert!(vehicle.crashed && !vehicle.airborne);
    assert!((vehicle.path_length_m - 9.85).abs() < 0.1, "{}", vehicle.path_length_m);
    assert!((vehicle.flight_time.as_secs_f64() - 1.45).abs() < 0.1);
}

#[test]
fn nothing_is_recorded_of_vehicles_that_stay_on_the_ground() {
    let oak = Obstacle::trunk("oak", 0.2, 0.0, 0.1, 12.0);
    let mut simulation = simulation(vec![oak], &[[0.0; 3]], 1);
    simulation.drive(0, MotorCommands::default());
    run(&mut simulation, 1.0);
    assert_eq!(simulation.truth(), Default::default());
    let vehicle = simulation.vehicle(0).expect("a vehicle");
    assert_eq!((vehicle.path_length_m, vehicle.flight_time), (0.0, Duration::ZERO));
}

/// Every number that a run makes.
fn record(seed: u64) -> (Vec<RigidState>, Vec<SensorReadings>, Vec<Scan>) {
    let oak = Obstacle::trunk("oak", 5.0, 0.0, 0.5, 12.0);
    let places = [[0.0; 3], [3.0, 3.0, 0.0]];
    let mut simulation = simulation(vec![oak], &places, seed);
    simulation.drive(0, MotorCommands([0.6, 0.601, 0.602, 0.6]));
    simulation.drive(1, MotorCommands([0.55; 4]));
    let mut record = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..250 {
        simulation.step();
        for index in 0..2 {
            record.0.extend(simulation.vehicle(index).map(|vehicle| vehicle.motion));
            record.1.extend(simulation.readings(index).cloned());
        }
        record.2.extend(simulation.take_scans().into_iter().map(|(_, scan)| scan));
    }
    record
}

#[test]
fn one_seed_is_one_run_and_another_seed_another() {
    assert!(record(1) == record(1));
    assert!(record(1).1 != record(2).1);
}

#[test]
fn an_index_without_a_vehicle_is_no_vehicle() {
    let mut simulation = simulation(Vec::new(), &[], 1);
    simulation.drive(3, hover());
    run(&mut simulation, 0.1);
    assert!(simulation.vehicle(3).is_none() && simulation.readings(3).is_none());
    assert_eq!(simulation.truth(), Default::default());
}

#[test]
fn what_moves_is_seen_and_met_where_it_is() {
    let cart = |speed_m_s: f64| {
        let cart = Obstacle::trunk("cart", 10.0, 0.0, 0.5, 4.0);
        let from = cart.pose.translation.vector;
        cart.on(Way::straight(from, Vector3::new(-speed_m_s, 0.0, 0.0)))
    };
    let mut simulation = simulation(vec![cart(2.0)], &[[0.0, 0.0, 0.0]], 1);
    simulation.drive(0, hover());
    simulation.place(0, flying([0.0, 0.0, 2.0], [0.0; 3]));
    run(&mut simulation, 2.0);
    let seen =
        simulation.take_scans().into_iter().last().and_then(|(_, scan)| scan.ranges_m.get(360).copied());
    assert!(seen.is_some_and(|ahead| (ahead - 5.5).abs() < 0.4), "{seen:?}");
    let clearance_m = simulation.truth().min_clearance_m.unwrap_or(f64::INFINITY);
    assert!((clearance_m - 5.25).abs() < 0.2, "{clearance_m}");
    run(&mut simulation, 3.0);
    assert_eq!(simulation.truth().collisions_obstacle, 1, "it has driven into the vehicle");
    assert!(simulation.vehicle(0).is_some_and(|vehicle| vehicle.crashed));
}
