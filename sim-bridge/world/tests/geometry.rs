//! The exact formulas of obstacles, checked against parry.

use glamx::{DPose3, DVec3};
use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};
use parry3d_f64::query::Ray;
use parry3d_f64::shape::SharedShape;
use proptest::prelude::*;
use skein_world::{Aabb, Obstacle, Scene, Shape};

fn vector(reach: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-reach..reach, -reach..reach, -reach..reach].prop_map(Vector3::from)
}

fn direction() -> impl Strategy<Value = Unit<Vector3<f64>>> {
    vector(1.0).prop_filter_map("too short", |v| Unit::try_new(v, 0.05))
}

fn size() -> impl Strategy<Value = f64> {
    0.05..4.0
}

fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![
        [size(), size(), size()].prop_map(|half| Shape::Box { half_extents: half.into() }),
        (size(), size()).prop_map(|(radius, half_height)| Shape::Cylinder { radius, half_height }),
        size().prop_map(|radius| Shape::Sphere { radius }),
        (size(), size()).prop_map(|(radius, half_length)| Shape::Capsule { radius, half_length }),
        (size(), size()).prop_map(|(radius, half_height)| Shape::Cone { radius, half_height }),
        direction().prop_map(|normal| Shape::Plane { normal }),
    ]
}

fn obstacle() -> impl Strategy<Value = Obstacle> {
    (shape(), vector(6.0), vector(3.0)).prop_map(|(shape, place, turn)| {
        let turn = UnitQuaternion::from_scaled_axis(turn);
        Obstacle::new("any", shape, Isometry3::from_parts(place.into(), turn))
    })
}

/// The same obstacle in parry's words.
fn in_parry(obstacle: &Obstacle) -> (DPose3, SharedShape) {
    let mut pose = obstacle.pose;
    let shape = match obstacle.shape {
        Shape::Box { half_extents: h } => SharedShape::cuboid(h.x, h.y, h.z),
        Shape::Cylinder { radius, half_height } => {
            pose *= UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            SharedShape::cylinder(half_height, radius)
        }
        Shape::Sphere { radius } => SharedShape::ball(radius),
        Shape::Capsule { radius, half_length } => SharedShape::capsule_z(half_length, radius),
        Shape::Cone { radius, half_height } => {
            pose *= UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            SharedShape::cone(half_height, radius)
        }
        Shape::Mesh(_) | Shape::Ellipsoid { .. } => unreachable!("parry's own, or not parry's"),
        Shape::Plane { normal } => SharedShape::halfspace(DVec3::new(normal.x, normal.y, normal.z)),
    };
    (pose.into(), shape)
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 10_000, ..ProptestConfig::default() })]

    #[test]
    fn distances_equal_parrys(obstacle in obstacle(), point in vector(12.0)) {
        let (pose, shape) = in_parry(&obstacle);
        let expected = shape.distance_to_point(&pose, DVec3::new(point.x, point.y, point.z), true);
        let found = obstacle.signed_distance(&point.into());
        prop_assert!((found.max(0.0) - expected).abs() < 1e-9, "{found} is not {expected}");
    }

    #[test]
    fn inside_a_shape_the_distance_is_the_depth(obstacle in obstacle(), offset in vector(1.0)) {
        let point = obstacle.pose.translation.vector + offset;
        let depth = -obstacle.signed_distance(&point.into());
        prop_assume!(depth > 0.0);
        let (pose, shape) = in_parry(&obstacle);
        let expected = shape.distance_to_point(&pose, DVec3::new(point.x, point.y, point.z), false);
        prop_assert!((depth - expected.abs()).abs() < 1e-9, "{depth} is not {expected}");
    }

    #[test]
    fn rays_equal_parrys(
        obstacle in obstacle(),
        origin in vector(12.0),
        towards in vector(3.0),
    ) {
        // Aimed near the obstacle, so that about half of the rays hit.
        let aim = obstacle.pose.translation.vector + towards - origin;
        prop_assume!(aim.norm() > 0.1);
        let aim = aim.normalize();
        let (pose, shape) = in_parry(&obstacle);
        let ray = Ray::new(
            DVec3::new(origin.x, origin.y, origin.z),
            DVec3::new(aim.x, aim.y, aim.z),
        );
        // Parry finds a ray's way to a cone step by step.
        let hair = if matches!(obstacle.shape, Shape::Cone { .. }) { 1e-3 } else { 1e-6 };
        let expected = shape.cast_ray(&pose, &ray, 1e3, true);
        let found = obstacle.cast_ray(&origin.into(), &aim).filter(|range| *range <= 1e3);
        match (found, expected) {
            (Some(found), Some(expected)) => {
                prop_assert!((found - expected).abs() < hair, "{found} is not {expected}");
            }
            (None, None) => {}
            // A grazing ray may fall on either side: then it must pass within a hair.
            (Some(range), None) | (None, Some(range)) => {
                let touch = Point3::from(origin + aim * range);
                prop_assert!(obstacle.signed_distance(&touch).abs() < hair);
                let deeper = (0..100).map(|i| {
                    let point = Point3::from(origin + aim * (range + 0.01 * f64::from(i)));
                    obstacle.signed_distance(&point)
                });
                prop_assert!(deeper.fold(0.0, f64::min) > -1e-4, "{found:?} is not {expected:?}");
            }
        }
    }

    #[test]
    fn the_axis_aligned_box_holds_the_obstacle(obstacle in obstacle(), offset in vector(2.0)) {
        let point = obstacle.pose.translation.vector + offset;
        prop_assume!(obstacle.signed_distance(&point.into()) < 0.0);
        if let Some(aabb) = obstacle.aabb() {
            prop_assert!(aabb.contains(&point));
        }
    }

    #[test]
    fn a_scene_answers_as_its_nearest_obstacle(
        obstacles in prop::collection::vec(obstacle(), 1..20),
        point in vector(12.0),
        aim in direction(),
    ) {
        let scene = Scene::new("any", obstacles.clone());
        let nearest = obstacles
            .iter()
            .map(|obstacle| obstacle.signed_distance(&point.into()))
            .fold(f64::INFINITY, f64::min);
        // Inside of several obstacles the depth in any of them will do.
        prop_assert_eq!(scene.clearance(&point).max(0.0), nearest.max(0.0));

        let ground = if aim.z < 0.0 { point.z.max(0.0) / -aim.z } else { f64::INFINITY };
        let first = obstacles
            .iter()
            .filter_map(|obstacle| obstacle.cast_ray(&point.into(), &aim))
            .fold(ground, f64::min);
        let found = scene.cast_ray(&point.into(), &aim, 30.0);
        prop_assert_eq!(found, (first <= 30.0).then_some(first));
    }
}

#[test]
fn a_ray_meets_a_trunk_where_it_should() {
    let trunk = Obstacle::trunk("oak", 5.0, 0.0, 0.5, 8.0);
    let ahead = Vector3::x();
    let from = |x, y, z| trunk.cast_ray(&Point3::new(x, y, z), &ahead);
    assert_eq!(from(0.0, 0.0, 1.0), Some(4.5));
    assert_eq!(from(5.0, 0.0, 1.0), Some(0.0), "inside");
    assert_eq!(from(0.0, 0.6, 1.0), None, "beside");
    assert_eq!(from(0.0, 0.0, 8.1), None, "above");
    assert_eq!(from(6.0, 0.0, 1.0), None, "behind");
}

#[test]
fn bounds_follow_the_stated_rule() {
    let empty = Scene::new("empty", Vec::new());
    assert_eq!(
        *empty.bounds(),
        Aabb { min: Vector3::new(-50.0, -50.0, -1.0), max: Vector3::new(50.0, 50.0, 20.0) }
    );
    let tower = Scene::new("tower", vec![Obstacle::trunk("t", 100.0, 0.0, 1.0, 40.0)]);
    assert_eq!(
        *tower.bounds(),
        Aabb { min: Vector3::new(-50.0, -50.0, -1.0), max: Vector3::new(121.0, 50.0, 50.0) }
    );
}

#[test]
fn an_empty_scene_has_no_nearest_obstacle_but_a_ground() {
    let scene = Scene::new("empty", Vec::new());
    assert_eq!(scene.clearance(&Vector3::new(1.0, 2.0, 3.0)), f64::INFINITY);
    let down = scene.cast_ray(&Point3::new(0.0, 0.0, 3.0), &-Vector3::z(), 10.0);
    assert_eq!(down, Some(3.0));
    let level = scene.cast_ray(&Point3::new(0.0, 0.0, 3.0), &Vector3::x(), 10.0);
    assert_eq!(level, None);
}

#[test]
fn a_footprint_is_the_outline_on_the_ground() {
    let mut block = Obstacle::block("b", Vector3::new(2.0, 0.0, 1.0), Vector3::new(2.0, 4.0, 2.0));
    assert_eq!(block.footprint(), [[3.0, 2.0], [1.0, 2.0], [1.0, -2.0], [3.0, -2.0]]);
    block.shape = Shape::Sphere { radius: 1.0 };
    assert_eq!(block.footprint().len(), 16);
}

#[test]
fn a_solid_is_as_thick_as_it_is_high_over_one_place() {
    let turned = |shape, roll: f64| {
        let turn = nalgebra::UnitQuaternion::from_euler_angles(roll, 0.0, 0.3);
        Obstacle::new("", shape, Isometry3::from_parts(nalgebra::Translation3::new(3.0, 4.0, 5.0), turn))
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let cylinder = Shape::Cylinder { radius: 0.01, half_height: 10.0 };
    let plate = Shape::Box { half_extents: nalgebra::Vector3::new(4.0, 4.0, 0.05) };
    for (solid, thickness_m) in [
        (turned(cylinder.clone(), 0.0), 20.0),
        (turned(cylinder.clone(), quarter), 0.02),
        (turned(cylinder, quarter - 0.5), 0.02 / 0.5_f64.cos()),
        (turned(plate.clone(), 0.0), 0.1),
        (turned(plate, quarter / 2.0), 0.1 * 2.0_f64.sqrt()),
        (turned(Shape::Sphere { radius: 0.3 }, 0.0), 0.6),
    ] {
        assert!((solid.thickness_m() - thickness_m).abs() < 1e-9, "{solid:?}: {}", solid.thickness_m());
    }
}

proptest! {
    #[test]
    fn the_distance_to_an_ellipsoid_is_that_of_the_nearest_of_many_places_on_it(
        radii in [size(), size(), size()],
        point in vector(6.0),
        on_axis in 0..4_usize,
    ) {
        let radii = Vector3::from(radii);
        let mut point = point;
        if on_axis < 3 {
            point[on_axis] = 0.0;
        }
        let found = Shape::Ellipsoid { radii }.signed_distance(&point.into());
        let places = (0..200).flat_map(|up| (0..200).map(move |around| (up, around))).map(|(up, around)| {
            let (sin_up, cos_up) = (PI * f64::from(up) / 199.0).sin_cos();
            let (sin, cos) = (2.0 * PI * f64::from(around) / 200.0).sin_cos();
            Vector3::new(sin_up * cos, sin_up * sin, cos_up).component_mul(&radii)
        });
        let nearest = places.map(|place| (place - point).norm()).fold(f64::INFINITY, f64::min);
        let is_inside = point.component_div(&radii).norm() < 1.0;
        prop_assert_eq!(found < 0.0, is_inside);
        prop_assert!(found.abs() <= nearest + 1e-9 && found.abs() >= nearest - 0.1, "{} is not {}", found, nearest);
    }
}
