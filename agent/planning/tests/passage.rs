//! Narrow passages are found, are the same from both sides, and single obstacles are none.

use nalgebra::Vector3;
use proptest::prelude::*;
use skein_planning::Path;
use skein_planning::map::{ClearanceMap, RayEnd, VoxelMapConfig};
use skein_planning::passage::{PassageConfig, first_passage};

fn empty() -> ClearanceMap {
    let config = VoxelMapConfig { size_m: [40.0, 40.0, 6.0], ..VoxelMapConfig::default() };
    let mut map = ClearanceMap::new(config, Vector3::new(0.0, 0.0, 3.0), 2.5).unwrap();
    map.track(3.0);
    map
}

fn path(points: &[[f64; 2]]) -> Path {
    Path::new(points.iter().map(|p| Vector3::new(p[0], p[1], 3.0)).collect()).unwrap()
}

/// The cylinder's outline at the height of flight.
fn tree(map: &mut ClearanceMap, x: f64, y: f64, radius: f64) {
    for k in 0..40 {
        let angle = f64::from(k) * std::f64::consts::TAU / 40.0;
        map.insert(&Vector3::new(x + radius * angle.cos(), y + radius * angle.sin(), 3.0));
    }
}

/// What a lidar at `eye` sees of a wall `x = -0.2 .. 0.2` with an opening `y = -1 .. 1`.
fn scan_wall(map: &mut ClearanceMap, eye: Vector3<f64>) {
    let rays: Vec<_> = (0..720)
        .map(|k| {
            let angle = f64::from(k) * std::f64::consts::TAU / 720.0;
            let ahead = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let mut range = 12.0_f64;
            for face in [-0.2, 0.2] {
                let t = (face - eye.x) / ahead.x;
                if t > 0.0 && (eye.y + t * ahead.y).abs() >= 1.0 {
                    range = range.min(t);
                }
            }
            for jamb in [-1.0, 1.0] {
                let t = (jamb - eye.y) / ahead.y;
                if t > 0.0 && (eye.x + t * ahead.x).abs() <= 0.2 {
                    range = range.min(t);
                }
            }
            RayEnd { point: eye + ahead * range, hit: range < 12.0 }
        })
        .collect();
    map.integrate(eye, &rays);
}

#[test]
fn an_opening_of_two_metres_in_a_wall_is_a_passage() {
    let mut map = empty();
    scan_wall(&mut map, Vector3::new(-6.0, 0.3, 3.0));
    let way = path(&[[-6.0, 0.3], [0.0, 0.0], [8.0, 0.0]]);
    let found = first_passage(&map, &way, 0.0, &PassageConfig::default()).unwrap();
    assert!((found.centre.xy()).norm() < 0.4, "{found:?}");
    assert!((found.width_m - 2.0).abs() < 0.3, "{found:?}");
    assert!((found.distance_m - 6.0).abs() < 0.4, "{found:?}");
    assert!(found.direction.x > 0.95, "{found:?}");
    assert!(
        first_passage(&map, &way, 0.0, &PassageConfig { look_m: 4.0, ..PassageConfig::default() }).is_none()
    );
    assert!(first_passage(&map, &way, 7.5, &PassageConfig::default()).is_none(), "it lies behind");
}

#[test]
fn one_tree_beside_the_path_is_no_passage() {
    let mut map = empty();
    tree(&mut map, 4.0, 1.2, 0.4);
    assert_eq!(first_passage(&map, &path(&[[0.0, 0.0], [8.0, 0.0]]), 0.0, &PassageConfig::default()), None);
}

#[test]
fn trees_on_both_sides_are_one_if_they_stand_close() {
    for (apart, narrow) in [(1.5, true), (3.2, false)] {
        let mut map = empty();
        tree(&mut map, 4.0, 0.4 + apart / 2.0, 0.4);
        tree(&mut map, 4.0, -0.4 - apart / 2.0, 0.4);
        let found = first_passage(&map, &path(&[[0.0, 0.0], [8.0, 0.0]]), 0.0, &PassageConfig::default());
        assert_eq!(found.is_some(), narrow, "{apart} m apart: {found:?}");
    }
}

#[test]
fn trees_one_after_another_on_either_side_are_none() {
    let mut map = empty();
    tree(&mut map, 2.0, 1.1, 0.4);
    tree(&mut map, 6.0, -1.1, 0.4);
    assert_eq!(first_passage(&map, &path(&[[0.0, 0.0], [8.0, 0.0]]), 0.0, &PassageConfig::default()), None);
}

proptest! {
    #[test]
    fn vehicles_from_both_sides_mean_the_same_opening(
        west in (3.0..7.0_f64, -3.0..3.0_f64), east in (3.0..7.0_f64, -3.0..3.0_f64), aside in -0.5..0.5_f64,
    ) {
        let eyes = [Vector3::new(-west.0, west.1, 3.0), Vector3::new(east.0, east.1, 3.0)];
        let found = eyes.map(|eye| {
            let mut map = empty();
            scan_wall(&mut map, eye);
            let way = path(&[[eye.x, eye.y], [0.0, aside], [-eye.x.signum() * 6.0, -eye.y]]);
            first_passage(&map, &way, 0.0, &PassageConfig::default())
        });
        prop_assert!(found[0].is_some() && found[1].is_some(), "{found:?}");
        let [one, other] = found.map(Option::unwrap);
        prop_assert!((one.centre - other.centre).xy().norm() <= 0.5, "{one:?} {other:?}");
    }

    #[test]
    fn vehicles_from_both_sides_mean_the_same_two_trees(
        apart in 1.0..1.9_f64, angle in 0.0..std::f64::consts::TAU, slant in -0.6..0.6_f64,
    ) {
        let across = Vector3::new(angle.cos(), angle.sin(), 0.0);
        let mut map = empty();
        for side in [-1.0, 1.0] {
            let trunk = across * side * (apart / 2.0 + 0.4);
            tree(&mut map, trunk.x, trunk.y, 0.4);
        }
        let ahead = Vector3::new(-across.y, across.x, 0.0) + across * slant;
        let ends = [ahead * -5.0, ahead * 5.0].map(|end| [end.x, end.y]);
        let there = first_passage(&map, &path(&[ends[0], [0.0, 0.0], ends[1]]), 0.0, &PassageConfig::default());
        let back = first_passage(&map, &path(&[ends[1], [0.0, 0.0], ends[0]]), 0.0, &PassageConfig::default());
        prop_assert!(there.is_some() && back.is_some(), "{there:?} {back:?}");
        let (there, back) = (there.unwrap(), back.unwrap());
        // Where a slanted path passes trunks of a few voxels, the points that face it may differ by half a voxel
        // more. Right of way takes passages within 3 m for one.
        prop_assert!((there.centre - back.centre).norm() <= 0.6, "{there:?} {back:?}");
        prop_assert!(there.centre.xy().norm() <= 0.4, "{there:?}");
    }
}
