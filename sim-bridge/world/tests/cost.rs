//! What the world costs. Run with
//! `cargo test --release -p skein-world --test cost -- --ignored --nocapture --test-threads 1`.

use std::time::{Duration, Instant};

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use skein_world::{
    Hull, Lidar, MotorCommands, Obstacle, PositionErrors, Scene, Simulation, SimulationConfig, Surroundings,
    VehicleModel, VehicleSetup, WindConfig,
};

/// 120 trunks about 5 m apart.
fn forest() -> Scene {
    let trunks = (0..120).map(|i| {
        let (row, column) = (i / 12, i % 12);
        let x = f64::from(column) * 5.0 - 27.0 + f64::from(row % 3);
        let y = f64::from(row) * 5.0 - 22.0 + f64::from(column % 2);
        Obstacle::trunk(format!("tree {i}"), x, y, 0.3, 12.0)
    });
    Scene::new("forest", trunks.collect())
}

fn x500() -> VehicleModel {
    VehicleModel::built_in("x500").expect("a built-in vehicle")
}

/// The mean time of `batch` runs, in the quickest of 20 batches: other programs only slow it down.
fn quickest(batch: u32, mut run: impl FnMut()) -> Duration {
    let batches = (0..20).map(|_| {
        let start = Instant::now();
        (0..batch).for_each(|_| run());
        start.elapsed() / batch
    });
    batches.min().unwrap_or_default()
}

#[test]
#[ignore = "measures time; run alone in a release build"]
fn a_scan_of_720_rays_among_120_trunks_takes_under_60_microseconds() {
    let scene = forest();
    let mut lidar = Lidar::new(x500().lidar.unwrap(), 1, 1);
    let hulls: Vec<Hull> =
        (0..8).map(|i| Hull { centre: Vector3::new(f64::from(i) * 2.0, 1.5, 3.0), radius_m: 0.25 }).collect();
    let surroundings = Surroundings { scene: &scene, hulls: &hulls, own: 0 };
    let pose =
        Isometry3::from_parts(hulls[0].centre.into(), UnitQuaternion::from_euler_angles(0.1, 0.15, 0.5));
    let mut stamps = (0..).map(Duration::from_millis);
    let mut returns = 0;
    let each = quickest(100, || {
        let scan = lidar.scan(stamps.next().unwrap_or_default(), &pose, &surroundings);
        returns = scan.ranges_m.iter().filter(|range| range.is_finite()).count();
    });
    println!("{each:?} a scan, {returns} returns");
    assert!(each < Duration::from_micros(60), "{each:?}");
}

fn eight_vehicles() -> Simulation {
    let setups = (0..8).map(|i| VehicleSetup {
        model: x500(),
        position: Vector3::new(f64::from(i) * 3.0 - 12.0, -1.0, 0.0),
        yaw: 0.0,
        system_id: i + 1,
        position_errors: PositionErrors::default(),
    });
    Simulation::new(SimulationConfig {
        scene: forest(),
        vehicles: setups.collect(),
        seed: 1,
        wind: WindConfig::default(),
    })
}

fn second_of(simulation: &mut Simulation) -> Duration {
    quickest(1, || {
        for _ in 0..250 {
            simulation.step();
            for index in 0..8 {
                simulation.receive(index);
            }
        }
    })
}

#[test]
#[ignore = "measures time; run alone in a release build"]
fn eight_vehicles_without_autopilot_take_under_10_milliseconds_a_second() {
    let mut simulation = eight_vehicles();
    for index in 0..8 {
        simulation.drive(index, MotorCommands([x500().hover_share() * 1.0005; 4]));
    }
    let each = second_of(&mut simulation);
    println!("{each:?} a simulated second, {:?}", simulation.truth());
    assert!(each < Duration::from_millis(10), "{each:?}");
}

#[test]
#[ignore = "measures time; run alone in a release build"]
fn eight_vehicles_with_autopilots_take_under_25_milliseconds_a_second() {
    let each = second_of(&mut eight_vehicles());
    println!("{each:?} a simulated second");
    assert!(each < Duration::from_millis(25), "{each:?}");
}
