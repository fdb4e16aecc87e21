//! What the scanner sees.

use std::f64::consts::PI;
use std::time::Duration;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use skein_wire::Scan;
use skein_world::vehicle::LidarModel;
use skein_world::{Hull, Lidar, Mesh, Obstacle, Scene, Shape, Surroundings};

const MODEL: LidarModel = LidarModel {
    rays: 720,
    range_m: 40.0,
    dark_range_m: Some(10.0),
    sigma_m: 0.0,
    rate_hz: 10.0,
    vertical_range_m: 15.0,
    vertical_cone_rad: std::f64::consts::FRAC_PI_6,
    upright_rays: 0,
};

/// Vehicle 0 looks from `pose`; `others` are the other vehicles.
fn scan(model: LidarModel, scene: &Scene, pose: Isometry3<f64>, others: &[Hull]) -> Scan {
    let own = Hull { centre: pose.translation.vector, radius_m: 0.25 };
    let hulls: Vec<Hull> = std::iter::once(own).chain(others.iter().copied()).collect();
    let surroundings = Surroundings { scene, hulls: &hulls, own: 0 };
    Lidar::new(model, 1, 1).scan(Duration::from_millis(100), &pose, &surroundings)
}

fn level(x: f64, y: f64, z: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(0.0, 0.0, yaw))
}

#[test]
fn the_ray_ahead_is_body_x_and_angles_turn_left() {
    let trunks =
        vec![Obstacle::trunk("ahead", 0.0, 5.0, 0.5, 8.0), Obstacle::trunk("left", -3.0, 0.0, 0.5, 8.0)];
    // The vehicle faces north.
    let scan = scan(MODEL, &Scene::new("two", trunks), level(0.0, 0.0, 2.0, PI / 2.0), &[]);
    let at = |angle: f64| scan.ranges_m[((angle - scan.angle_min) / scan.angle_step).round() as usize];
    assert_eq!(scan.ranges_m.len(), 720);
    assert_eq!(at(0.0), 4.5);
    assert_eq!(at(PI / 2.0), 2.5);
    assert_eq!(at(-PI / 2.0), f32::INFINITY);
    assert_eq!(scan.stamp, Duration::from_millis(100));
}

#[test]
fn an_upright_scanner_sees_a_cable_that_the_level_one_misses_and_counts_from_the_nose_upwards() {
    let across = UnitQuaternion::from_euler_angles(PI / 2.0, 0.0, 0.0);
    let shape = Shape::Cylinder { radius: 0.012, half_height: 10.0 };
    let cable =
        Obstacle::new("cable", shape, Isometry3::from_parts(Translation3::new(8.0, 0.0, 3.0), across));
    let scene = Scene::new("cable", vec![cable]);
    let model = LidarModel { upright_rays: 3600, ..MODEL };
    let scan = scan(model, &scene, level(0.0, 0.0, 2.0, 0.0), &[]);
    assert!(scan.ranges_m.iter().all(|range| range.is_infinite()));
    // One metre higher and eight ahead: 7.125 degrees, ray 71.
    let seen = (1..1700).filter(|ray| scan.upright_m[*ray].is_finite()).collect::<Vec<_>>();
    assert!(seen.contains(&71) && seen.len() <= 3, "{seen:?}");
    assert!((f64::from(scan.upright_m[71]) - 65.0_f64.sqrt()).abs() < 0.013);
    assert!((scan.upright_m[2700] - 2.0).abs() < 1e-6, "the ground is straight below");
}

#[test]
fn a_tilted_scanner_sees_the_ground() {
    let scene = Scene::new("empty", Vec::new());
    let nose_down = Isometry3::from_parts(
        Translation3::new(0.0, 0.0, 2.0),
        UnitQuaternion::from_euler_angles(0.0, 0.2, 0.0),
    );
    let scan = scan(MODEL, &scene, nose_down, &[]);
    assert!((f64::from(scan.ranges_m[360]) - 2.0 / 0.2_f64.sin()).abs() < 1e-5);
    assert_eq!(scan.ranges_m[0], f32::INFINITY, "behind, where the plane rises");
}

#[test]
fn other_vehicles_are_seen_and_the_own_hull_is_not() {
    let other = Hull { centre: Vector3::new(3.0, 0.0, 2.0), radius_m: 0.25 };
    let scene = Scene::new("empty", Vec::new());
    let scan = scan(MODEL, &scene, level(0.0, 0.0, 2.0, 0.0), &[other]);
    assert_eq!(scan.ranges_m[360], 2.75);
    let seen = scan.ranges_m.iter().filter(|range| range.is_finite()).count();
    // asin(0.25 / 3) to either side is 9.5 rays of half a degree.
    assert_eq!(seen, 19);
}

#[test]
fn vertical_finders_take_the_nearest_in_their_cone() {
    let roof = Obstacle::block("roof", Vector3::new(0.0, 0.0, 6.0), Vector3::new(4.0, 4.0, 1.0));
    let below = Hull { centre: Vector3::new(0.3, 0.0, 1.0), radius_m: 0.3 };
    let scan = scan(MODEL, &Scene::new("hall", vec![roof]), level(0.0, 0.0, 3.0, 0.0), &[below]);
    assert_eq!(scan.up_m, Some(2.5));
    let down = scan.down_m.expect("something below");
    assert!((1.7..1.9).contains(&down), "the vehicle below, not the ground: {down}");
}

#[test]
fn nothing_within_reach_is_no_return() {
    let scene = Scene::new("far", vec![Obstacle::trunk("far", 41.0, 0.0, 0.5, 60.0)]);
    let scan = scan(MODEL, &scene, level(0.0, 0.0, 30.0, 0.0), &[]);
    assert!(scan.ranges_m.iter().all(|range| *range == f32::INFINITY));
    assert_eq!((scan.up_m, scan.down_m), (None, None));
}

/// The range that is told of a wall of this reflectivity, so far away, with a white one 2 m behind it.
fn range_to(reflectivity: f64, distance_m: f64) -> f32 {
    let wall = |x: f64| Obstacle::block("wall", Vector3::new(x + 0.5, 0.0, 2.0), Vector3::new(1.0, 9.0, 4.0));
    let walls = vec![Obstacle { reflectivity, ..wall(distance_m) }, wall(distance_m + 2.0)];
    scan(MODEL, &Scene::new("walls", walls), level(0.0, 0.0, 2.0, 0.0), &[]).ranges_m[360]
}

#[test]
fn what_is_dark_is_seen_late_and_hides_what_is_behind_it() {
    assert_eq!([range_to(0.0, 9.9), range_to(0.0, 10.1)], [9.9, f32::INFINITY]);
    assert_eq!([range_to(0.25, 19.9), range_to(0.25, 20.1)], [19.9, f32::INFINITY]);
    assert_eq!([range_to(1.0, 39.9), range_to(1.0, 40.1)], [39.9, f32::INFINITY]);
    assert_eq!(range_to(0.01, 10.1), f32::INFINITY, "nothing is darker than black");
}

#[test]
fn noise_has_the_deviation_of_the_model_and_repeats() {
    let wall = Obstacle::block("wall", Vector3::new(0.0, 0.0, 0.0), Vector3::repeat(200.0));
    // From inside of a box every range is 0; put the scanner beside it instead.
    let scene = Scene::new("wall", vec![wall]);
    let noisy = LidarModel { sigma_m: 0.03, ..MODEL };
    let pose = level(105.0, 0.0, 2.0, 0.0);
    let exact = scan(MODEL, &scene, pose, &[]);
    let first = scan(noisy, &scene, pose, &[]);
    let errors: Vec<f64> = first
        .ranges_m
        .iter()
        .zip(&exact.ranges_m)
        .filter(|(_, exact)| exact.is_finite())
        .map(|(noisy, exact)| f64::from(noisy - exact))
        .collect();
    let variance = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    assert!(errors.len() > 300);
    assert!((variance.sqrt() - 0.03).abs() < 0.004, "{}", variance.sqrt());
    assert_eq!(first, scan(noisy, &scene, pose, &[]));
}

fn obstacle() -> impl Strategy<Value = Obstacle> {
    let shape = prop_oneof![
        (0.1..1.5, 0.1..1.5, 0.1..6.0)
            .prop_map(|(x, y, z)| Shape::Box { half_extents: Vector3::new(x, y, z) }),
        (0.1..1.0, 0.2..6.0).prop_map(|(radius, half_height)| Shape::Cylinder { radius, half_height }),
        (0.1..2.0).prop_map(|radius| Shape::Sphere { radius }),
        (0.1..1.0, 0.2..3.0).prop_map(|(radius, half_length)| Shape::Capsule { radius, half_length }),
        (0.1..2.0, 0.2..3.0).prop_map(|(radius, half_height)| Shape::Cone { radius, half_height }),
        (0.1..2.0, 0.1..2.0, 0.1..2.0)
            .prop_map(|(x, y, z)| Shape::Ellipsoid { radii: Vector3::new(x, y, z) }),
        (0.1..2.0, 0.2..6.0).prop_map(|(side, height)| {
            let outline = [[0.0, 0.0], [side, 0.0], [0.0, side]];
            Shape::Mesh(Mesh::extrusion(&outline, height).unwrap())
        }),
    ];
    let turn = prop_oneof![
        // Upright, tilted by any angle, and upside down.
        3 => (-PI..PI).prop_map(|yaw| Vector3::new(0.0, 0.0, yaw)),
        2 => [-2.0..2.0, -2.0..2.0, -2.0..2.0].prop_map(Vector3::from),
        1 => Just(Vector3::new(PI, 0.0, 0.0)),
    ];
    (shape, [-15.0..15.0, -15.0..15.0, 0.0..6.0], turn).prop_map(|(shape, place, turn)| {
        let turn = UnitQuaternion::from_scaled_axis(turn);
        Obstacle::new("any", shape, Isometry3::from_parts(place.into(), turn))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    /// Angular spans are only a short cut: every ray must tell what casting it alone tells.
    #[test]
    fn a_scan_equals_its_rays_cast_one_by_one(
        obstacles in prop::collection::vec(obstacle(), 0..25),
        place in [-15.0..15.0, -15.0..15.0, 0.2..8.0],
        (roll, pitch, yaw) in (-0.7..0.7, -0.7..0.7, -PI..PI),
    ) {
        let scene = Scene::new("any", obstacles);
        let pose = Isometry3::from_parts(
            place.into(),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        );
        let scan = scan(MODEL, &scene, pose, &[]);
        for (ray, range) in scan.ranges_m.iter().enumerate() {
            let angle = scan.angle_min + ray as f64 * scan.angle_step;
            let direction = pose * Vector3::new(angle.cos(), angle.sin(), 0.0);
            let expected = scene
                .cast_ray(&Point3::from(pose.translation.vector), &direction, 40.0)
                .map_or(f32::INFINITY, |range| range as f32);
            let equal = *range == expected || (range - expected).abs() < 1e-4;
            // Grazing rays may hit or miss by rounding alone; allow those that pass the edge
            // within a hair, as seen from rays a hair beside them.
            let grazes = || [-1e-7, 1e-7].iter().any(|beside| {
                let angle = angle + beside;
                let direction = pose * Vector3::new(angle.cos(), angle.sin(), 0.0);
                let beside = scene
                    .cast_ray(&Point3::from(pose.translation.vector), &direction, 40.0)
                    .map_or(f32::INFINITY, |range| range as f32);
                *range == beside || (range - beside).abs() < 1e-3
            });
            prop_assert!(equal || grazes(), "ray {ray}: {range} is not {expected}");
        }
    }
}
