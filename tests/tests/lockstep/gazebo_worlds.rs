//! Four vehicles fly QGroundControl plans in trail through worlds made for Gazebo.

use std::fmt::Write as _;
use std::path::Path;

use skein_tests::{flight, fly, shared_data};

/// A QGroundControl plan over these points: metres east, north and up of home.
fn plan(points: &[[f64; 3]]) -> String {
    let (latitude, longitude) = (47.397_742_f64, 8.545_594_f64);
    let metres_per_degree = 6_378_137.0 * std::f64::consts::PI / 180.0;
    let mut items = String::new();
    for (index, [x, y, z]) in points.iter().enumerate() {
        let command = if index == 0 { 22 } else { 16 };
        let north = latitude + y / metres_per_degree;
        let east = longitude + x / (metres_per_degree * latitude.to_radians().cos());
        let separator = if index == 0 { "" } else { "," };
        write!(
            items,
            r#"{separator}{{"type":"SimpleItem","command":{command},"frame":3,"autoContinue":true,"doJumpId":{},"params":[0,0,0,null,{north:.9},{east:.9},{z}]}}"#,
            index + 1
        )
        .unwrap();
    }
    format!(
        r#"{{"fileType":"Plan","groundStation":"QGroundControl","version":1,
            "geoFence":{{"circles":[],"polygons":[],"version":2}},"rallyPoints":{{"points":[],"version":2}},
            "mission":{{"cruiseSpeed":15,"hoverSpeed":5,"firmwareType":12,"vehicleType":2,"version":2,
            "plannedHomePosition":[{latitude},{longitude},488],"items":[{items}]}}}}"#
    )
}

fn flies(data: &Path, world: &str, points: &[[f64; 3]]) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mission.plan");
    std::fs::write(&file, plan(points)).unwrap();
    let mut flight = flight("open", 1);
    flight.world.overrides.vehicles = Some(4);
    flight.world.overrides.world = Some(data.join("gazebo").join(world));
    flight.world.overrides.missions = vec![file];
    let summary = fly(flight);
    assert_eq!(summary.reason, None, "{world}");
    assert!(
        summary.min_separation_m.unwrap_or(f64::INFINITY) >= 1.0,
        "{world}: {:?}",
        summary.min_separation_m
    );
}

#[test]
fn weaving_between_boxes() {
    let Some(data) = shared_data() else { return };
    let weave = [
        [-6.0, 0.0, 3.0],
        [-1.0, 4.0, 3.0],
        [6.2, 4.2, 3.0],
        [6.3, 1.5, 3.0],
        [12.0, 1.0, 3.0],
        [12.0, -5.0, 3.0],
    ];
    flies(&data, "boxes3.world", &weave);
}

#[test]
fn around_a_wall_that_no_waypoint_avoids() {
    let Some(data) = shared_data() else { return };
    flies(&data, "boxes1.world", &[[0.0, 0.0, 2.5], [25.0, 0.0, 2.5]]);
    flies(&data, "boxes2.world", &[[-4.0, 0.0, 2.0], [8.0, 0.0, 2.0]]);
}

#[test]
fn through_an_opening_little_wider_than_a_vehicle() {
    let Some(data) = shared_data() else { return };
    flies(&data, "window.world", &[[0.0, 0.0, 3.0], [3.0, 0.45, 3.0], [8.0, 0.45, 3.0], [12.0, 0.0, 3.0]]);
}
