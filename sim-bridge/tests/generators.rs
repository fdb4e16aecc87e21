//! What each built-in scenario promises, whatever the seed.

// Helpers fail like the tests that call them.

use nalgebra::Vector3;
use skein_sim::scenario::{Scenario, ScenarioError};
use skein_world::Shape;

const SEEDS: std::ops::RangeInclusive<u64> = 1..=50;

fn built_in(name: &str, vehicles: Option<usize>, seed: u64) -> Scenario {
    Scenario::built_in(name, vehicles, seed).expect("a built-in scenario is sound")
}

fn least_spacing(places: &[Vector3<f64>]) -> f64 {
    let pairs = places
        .iter()
        .enumerate()
        .flat_map(|(i, a)| places.iter().skip(i + 1).map(move |b| (a - b).xy().norm()));
    pairs.fold(f64::INFINITY, f64::min)
}

fn starts(scenario: &Scenario) -> Vec<Vector3<f64>> {
    scenario.vehicles.iter().map(|v| v.start).collect()
}

fn goals(scenario: &Scenario) -> Vec<Vector3<f64>> {
    scenario.vehicles.iter().map(|v| v.goal()).collect()
}

/// Whether the straight ways of two vehicles cross, seen from above.
fn cross(scenario: &Scenario, a: usize, b: usize) -> bool {
    let way = |i: usize| (scenario.vehicles[i].start.xy(), scenario.vehicles[i].goal().xy());
    let ((p, q), (r, s)) = (way(a), way(b));
    let side = |from: nalgebra::Vector2<f64>, to: nalgebra::Vector2<f64>, point: nalgebra::Vector2<f64>| {
        (to - from).perp(&(point - from)).signum()
    };
    side(p, q, r) != side(p, q, s) && side(r, s, p) != side(r, s, q)
}

#[test]
fn every_built_in_scenario_is_listed_with_what_it_is() {
    let names = Scenario::names();
    let only_names: Vec<_> = names.iter().map(|(name, _)| *name).collect();
    let built_in = [
        "forest",
        "antipodal",
        "window",
        "open",
        "survey",
        "geese",
        "valley",
        "indoor",
        "warehouse",
        "canyon",
    ];
    assert_eq!(only_names, built_in);
    assert!(names.iter().all(|(_, about)| about.len() > 20));
}

#[test]
fn starts_and_goals_are_three_metres_apart_and_goals_fly_at_one_height() {
    for (name, vehicles) in [("forest", 8), ("antipodal", 8), ("window", 6), ("open", 4)] {
        for seed in SEEDS {
            let scenario = built_in(name, None, seed);
            assert_eq!(scenario.vehicles.len(), vehicles, "{name}");
            assert!(least_spacing(&starts(&scenario)) >= 3.0 - 1e-9, "{name} {seed}: starts");
            assert!(least_spacing(&goals(&scenario)) >= 3.0 - 1e-9, "{name} {seed}: goals");
            assert!(goals(&scenario).iter().all(|g| (2.5..=3.5).contains(&g.z)), "{name} {seed}: heights");
            assert!(
                starts(&scenario).iter().all(|s| s.z == 0.0),
                "{name} {seed}: starts stand on the ground"
            );
            assert!(scenario.notes.is_empty(), "{name} {seed}: {:?}", scenario.notes);
        }
    }
}

#[test]
fn the_forest_is_as_dense_as_promised_and_every_gap_can_be_flown() {
    for seed in SEEDS {
        let scenario = built_in("forest", None, seed);
        let trunks: Vec<_> = scenario
            .scene
            .obstacles()
            .iter()
            .map(|o| match o.shape.clone() {
                Shape::Cylinder { radius, half_height } => (o.pose.translation.vector, radius, half_height),
                other => panic!("a tree is a cylinder, not {other:?}"),
            })
            .collect();
        assert!(trunks.len() as f64 >= 0.04 * 60.0 * 40.0);
        for (i, (centre, radius, half_height)) in trunks.iter().enumerate() {
            assert!((0.3..=0.6).contains(radius));
            assert!(
                centre.z - half_height <= 0.0 && centre.z + half_height >= 6.0,
                "spans the flight heights"
            );
            assert!((0.0..=60.0).contains(&centre.x) && (0.0..=40.0).contains(&centre.y));
            for (other, other_radius, _) in trunks.iter().skip(i + 1) {
                assert!((centre - other).xy().norm() - radius - other_radius >= 2.7 - 1e-9);
            }
        }
    }
}

#[test]
fn half_of_all_pairs_of_ways_through_the_forest_cross_and_half_of_all_ways_cross_another() {
    for vehicles in [2, 3, 8, 13, 20] {
        for seed in SEEDS {
            let scenario = built_in("forest", Some(vehicles), seed);
            let pairs: Vec<_> = (0..vehicles).flat_map(|a| (a + 1..vehicles).map(move |b| (a, b))).collect();
            let crossing: Vec<_> = pairs.iter().filter(|(a, b)| cross(&scenario, *a, *b)).collect();
            assert!(
                2 * crossing.len() >= pairs.len(),
                "{vehicles} vehicles, seed {seed}: {}",
                crossing.len()
            );
            let crossed = (0..vehicles).filter(|v| crossing.iter().any(|(a, b)| a == v || b == v)).count();
            assert!(2 * crossed >= vehicles);
        }
    }
}

#[test]
fn the_forest_holds_the_swarm_once_in_mid_flight_for_three_seconds() {
    use skein_wire::event::What;
    use skein_wire::{Order, Who};
    let orders = built_in("forest", None, 1).orders;
    let [(held_at_s, hold), (resumed_at_s, resume)] = &orders[..] else { panic!("{orders:?}") };
    assert_eq!([hold, resume], [&Order::new(What::Hold, Who::All), &Order::new(What::Resume, Who::All)]);
    assert_eq!(resumed_at_s - held_at_s, 3.0);
}

#[test]
fn antipodal_vehicles_swap_places_across_a_circle_of_eight_metres() {
    for seed in SEEDS {
        let scenario = built_in("antipodal", None, seed);
        for vehicle in &scenario.vehicles {
            assert!((vehicle.start.norm() - 8.0).abs() < 1e-9);
            assert!((vehicle.start + vehicle.goal()).xy().norm() < 1e-9);
        }
    }
}

#[test]
fn a_circle_too_small_for_the_swarm_grows_and_says_so() {
    let scenario = built_in("antipodal", Some(30), 1);
    assert!(least_spacing(&starts(&scenario)) >= 3.0 - 1e-9);
    assert_eq!(scenario.notes.len(), 1);
    assert!(scenario.notes[0].contains("30 vehicles"), "{}", scenario.notes[0]);
}

#[test]
fn the_wall_leaves_only_its_window() {
    for seed in SEEDS {
        let scenario = built_in("window", None, seed);
        let bounds = *scenario.scene.bounds();
        let open = |y: f64, z: f64| scenario.scene.clearance(&Vector3::new(0.0, y, z)) > 0.0;
        for step_y in 0..=200 {
            for step_z in 0..=100 {
                let y = bounds.min.y + (bounds.max.y - bounds.min.y) * f64::from(step_y) / 200.0;
                let z = bounds.min.z + (bounds.max.z - bounds.min.z) * f64::from(step_z) / 100.0;
                assert_eq!(open(y, z), y.abs() < 1.0 && (z - 3.0).abs() < 1.0, "at y {y}, z {z}");
            }
        }
        assert!(bounds.max.z - bounds.min.z < 20.0);
    }
}

#[test]
fn both_groups_pass_the_window_from_eight_metres_away() {
    for vehicles in [2, 5, 6, 12] {
        for seed in SEEDS {
            let scenario = built_in("window", Some(vehicles), seed);
            let eastward = scenario.vehicles.iter().filter(|v| v.start.x < 0.0).count();
            assert_eq!(eastward, vehicles.div_ceil(2));
            for vehicle in &scenario.vehicles {
                assert!(vehicle.start.x * vehicle.goal().x < 0.0, "passes the wall");
                assert!(vehicle.start.x.abs() >= 8.2 && vehicle.goal().x.abs() >= 8.2);
            }
            let mut places = starts(&scenario);
            places.extend(goals(&scenario));
            assert!(least_spacing(&places) >= 3.0 - 1e-9);
        }
    }
}

#[test]
fn ways_over_the_open_field_cross() {
    for seed in SEEDS {
        let scenario = built_in("open", None, seed);
        assert!(scenario.scene.obstacles().is_empty());
        assert!(cross(&scenario, 0, 2) && cross(&scenario, 1, 3));
    }
}

#[test]
fn one_seed_is_one_world_and_another_seed_another() {
    for name in ["forest", "antipodal", "window", "open"] {
        let (a, b, c) = (built_in(name, None, 7), built_in(name, None, 7), built_in(name, None, 8));
        assert_eq!(a.scene, b.scene, "{name}");
        assert_eq!(a.vehicles, b.vehicles, "{name}");
        assert_ne!(a.vehicles, c.vehicles, "{name}");
    }
}

#[test]
fn any_number_of_vehicles_finds_room() {
    for name in ["forest", "antipodal", "window", "open"] {
        for vehicles in [1, 2, 3, 7, 16, 40, 100, 254] {
            let scenario = built_in(name, Some(vehicles), 3);
            assert_eq!(scenario.vehicles.len(), vehicles);
            assert!(least_spacing(&starts(&scenario)) >= 3.0 - 1e-9, "{name} {vehicles}");
            assert!(least_spacing(&goals(&scenario)) >= 3.0 - 1e-9, "{name} {vehicles}");
        }
        assert!(matches!(Scenario::built_in(name, Some(0), 1), Err(ScenarioError::NoVehicles { .. })));
        assert!(matches!(Scenario::built_in(name, Some(255), 1), Err(ScenarioError::TooManyVehicles { .. })));
    }
}
