//! Mission files: what of them is flown, by whom, and how users are told what is wrong.

// Helpers fail like the tests that call them.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use skein_mav::Datum;
use skein_sim::mission::{Ends, Mission, MissionSet, Payload, Waypoint};
use skein_sim::scenario::{Overrides, SPACING_M, Scenario, ScenarioError, apply_missions};

pub const HOME: Datum = Datum { latitude_rad: 0.827_246, longitude_rad: 0.149_149, height_m: 488.0 };

/// A SimpleItem; numbers as MAVLink has them.
pub fn item(command: u32, frame: u32, params: &str) -> String {
    format!(r#"{{"type": "SimpleItem", "command": {command}, "frame": {frame}, "params": [{params}]}}"#)
}

/// Latitude, longitude and altitude of a place, as the last three parameters.
pub fn at(datum: &Datum, x: f64, y: f64, altitude: f64) -> String {
    let place = datum.to_geodetic(&Vector3::new(x, y, 0.0));
    let (latitude, longitude) = (place.latitude_rad.to_degrees(), place.longitude_rad.to_degrees());
    format!("{latitude:.10}, {longitude:.10}, {altitude}")
}

/// A plan with each item on a line of its own, the first on line 5.
pub fn plan(home: &Datum, items: &[String]) -> String {
    let (latitude, longitude) = (home.latitude_rad.to_degrees(), home.longitude_rad.to_degrees());
    let items = items.join(",\n");
    format!(
        "{{\"fileType\": \"Plan\",\n\"mission\": {{\"plannedHomePosition\": [{latitude:.10}, {longitude:.10}, {}],\n\
         \"hoverSpeed\": 5, \"cruiseSpeed\": 15, \"items\":\n[\n{items}\n]}},\n\
         \"geoFence\": {{\"circles\": [], \"polygons\": [], \"version\": 2}},\n\"rallyPoints\": {{\"points\": []}}}}\n",
        home.height_m
    )
}

pub fn read(text: &str) -> MissionSet {
    MissionSet::read(text, "f.plan", None).expect("the plan is sound")
}

pub fn refusal(text: &str) -> String {
    MissionSet::read(text, "f.plan", None).expect_err("the plan is wrong").to_string()
}

pub fn near(a: Vector3<f64>, b: [f64; 3]) -> bool {
    (a - Vector3::from(b)).norm() < 0.01
}

fn route(mission: &Mission) -> Vec<Vector3<f64>> {
    mission.waypoints.iter().map(|w| w.position).collect()
}

#[test]
fn takeoff_speed_waypoints_and_landing_of_a_plan_are_flown_from_the_origin() {
    let text = plan(
        &HOME,
        &[
            item(22, 3, &format!("0, 0, 0, null, {}", at(&HOME, 0.0, 0.0, 4.0))),
            item(178, 2, "1, 2.5, -1, 0, 0, 0, 0"),
            item(16, 3, &format!("3, 0, 0, null, {}", at(&HOME, 10.0, 20.0, 5.0))),
            item(19, 0, &format!("2, 0, 0, null, {}", at(&HOME, -5.0, 0.0, 494.0))),
            item(21, 3, &format!("0, 0, 0, null, {}", at(&HOME, -5.0, 8.0, 0.0))),
        ],
    );
    let set = read(&text);
    let mission = &set.missions[0];
    let way = route(mission);
    assert!(
        near(way[0], [10.0, 20.0, 5.0]) && near(way[1], [-5.0, 0.0, 6.0]) && near(way[2], [-5.0, 8.0, 6.0])
    );
    assert_eq!(way.len(), 3);
    assert_eq!((mission.takeoff_height_m, mission.ends), (Some(4.0), Ends::Land));
    assert_eq!((mission.waypoints[0].hold_s, mission.waypoints[1].hold_s), (3.0, 2.0));
    assert!(mission.waypoints.iter().all(|w| w.speed_m_s == Some(2.5)));
    assert!(near(mission.home, [0.0; 3]));
    assert!(set.warnings.is_empty(), "{:?}", set.warnings);
}

#[test]
fn a_return_ends_the_plan_and_what_comes_after_it_is_warned_of() {
    let waypoint = item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, 9.0, 0.0, 5.0)));
    let set = read(&plan(&HOME, &[waypoint.clone(), item(20, 2, "0, 0, 0, 0, 0, 0, 0"), waypoint]));
    assert_eq!((set.missions[0].ends, set.missions[0].waypoints.len()), (Ends::Return, 1));
    let [warning] = &set.warnings[..] else { panic!("one warning: {:?}", set.warnings) };
    let text = "f.plan:7: mission.items[2].command: comes after the landing or return and is not flown";
    assert_eq!(warning.to_string(), text);
}

#[test]
fn a_plan_near_the_worlds_datum_is_flown_where_it_was_drawn_and_any_other_from_the_origin() {
    let elsewhere = Datum { latitude_rad: HOME.latitude_rad + 1e-6, ..HOME };
    let waypoint = item(16, 3, &format!("0, 0, 0, null, {}", at(&elsewhere, 9.0, 0.0, 5.0)));
    let text = plan(&elsewhere, &[waypoint]);
    let home = |datum: Option<Datum>| {
        MissionSet::read(&text, "f.plan", datum).expect("the plan is sound").missions[0].home
    };
    assert!((home(Some(HOME)).y - 6.37).abs() < 0.02, "a millionth of a radian north is 6.37 m");
    assert!(near(home(None), [0.0; 3]));
    assert!(near(home(Some(Datum::from_degrees(0.0, 0.0, 0.0))), [0.0; 3]));
}

#[test]
fn what_a_camera_is_told_stands_between_the_waypoints() {
    let waypoint = item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, 9.0, 0.0, 5.0)));
    let picture = || item(2000, 2, "0, 0, 1, null, null, null, null");
    let items = [waypoint.clone(), item(206, 2, "5, 0, 0, 0, 0, 0, 0"), picture(), waypoint, picture()];
    let set = read(&plan(&HOME, &items));
    let mission = &set.missions[0];
    let told = |payload: &[Payload]| payload.iter().map(|one| one.command).collect::<Vec<_>>();
    assert_eq!(
        mission.waypoints.iter().map(|w| told(&w.payload)).collect::<Vec<_>>(),
        [vec![], vec![206, 2000]]
    );
    assert_eq!(told(&mission.last_payload), [2000]);
    assert!(mission.last_payload[0].params[6].is_nan() && set.warnings.is_empty());
}

#[test]
fn what_cannot_be_flown_is_refused_with_line_field_and_expectation() {
    let place = at(&HOME, 9.0, 0.0, 5.0);
    let waypoint = item(16, 3, &format!("0, 0, 0, null, {place}"));
    let second = |item: String| refusal(&plan(&HOME, &[waypoint.clone(), item]));
    let cases = [
        (
            item(16, 3, "0, 0, 0, null, null, null, 5"),
            "mission.items[1].params[4]`: expected a latitude and a longitude, found null",
        ),
        (
            item(16, 3, "0, 0, 0, null, 91, 8, 5"),
            "mission.items[1].params[4]`: expected a number from -90 to 90 degrees, found 91",
        ),
        (
            item(16, 3, "0, 0, 0, null, 47, \"8\", 5"),
            "mission.items[1].params[5]`: expected a number, found \"8\"",
        ),
        (
            item(16, 3, "0, 0, 0, null, 47, 8, -2"),
            "mission.items[1].params[6]`: expected an altitude above home's ground, found -2",
        ),
        (item(16, 3, "0, 0, 0"), "mission.items[1].params`: expected 7 parameters, found an array of 3"),
        (
            item(16, 9, &format!("0, 0, 0, null, {place}")),
            "mission.items[1].frame`: expected 0 (above sea level)",
        ),
        (
            item(177, 2, "1, -1, 0, 0, 0, 0, 0"),
            "mission.items[1].params[1]`: expected how often to jump; a mission that never ends",
        ),
        (
            item(4000, 3, &format!("0, 0, 0, null, {place}")),
            "mission.items[1].command`: expected a command that moves a multirotor",
        ),
        (
            item(208, 2, "1, 0, 0, 0, 0, 0, 0"),
            "mission.items[1].command`: expected a command that a flight of a multirotor has, found 208 parachute",
        ),
        (item(178, 2, "1, 0.1, 0, 0, 0, 0, 0"), "mission.items[1].params[1]`: expected a speed from 0.3"),
        ("{\"type\": \"ComplexItem\"}".to_owned(), "mission.items[1]`: expected \"survey\""),
        (
            "{\"type\": \"SimpleItem\"}".to_owned(),
            "mission.items[1]`: expected a member `command`, found none",
        ),
        ("7".to_owned(), "mission.items[1]`: expected a member `type`, found 7"),
    ];
    for (item, expected) in cases {
        let text = second(item.clone());
        let (place, rest) = text.split_once(" field `").expect("names a field");
        assert_eq!(place, "f.plan:6:", "{item}: {text}");
        assert!(rest.starts_with(expected), "{item}: {text}");
    }
}

#[test]
fn a_number_that_is_text_is_refused_as_such() {
    let text = refusal("{\"mission\": {\"plannedHomePosition\": [47, \"8\", 488],\n \"items\": []}}");
    assert_eq!(text, "f.plan:1: field `mission.plannedHomePosition[1]`: expected a number, found \"8\"");
}

#[test]
fn broken_files_are_refused_with_their_place() {
    assert_eq!(refusal("{\"mission\":\n {\"items\": [}}"), "f.plan:2:13: expected value");
    assert!(refusal("").starts_with("f.plan:1:0: EOF"), "{}", refusal(""));
    assert!(refusal("{\"a\": 1}").contains("expected a QGroundControl plan"));
    assert!(refusal(&plan(&HOME, &[])).contains("field `mission.items`: expected at least one waypoint"));
    let no_home = "{\"mission\": {\"items\": []}}";
    assert!(
        refusal(no_home).contains("field `mission`: expected a member `plannedHomePosition`, found none")
    );
    let deep = "[".repeat(100_000);
    assert!(refusal(&deep).starts_with("f.plan:1:"), "{}", refusal(&deep));
}

#[test]
fn any_cut_of_a_plan_is_refused_or_read_but_never_panics() {
    let waypoint = item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, 9.0, 0.0, 5.0)));
    let text = plan(&HOME, &[waypoint]);
    for end in 0..text.trim_end().len() {
        assert!(MissionSet::read(&text[..end], "f.plan", None).is_err(), "cut at {end}");
    }
}

#[test]
fn agents_of_an_lsc_mission_fly_from_exactly_their_starts() -> Result<(), Box<dyn std::error::Error>> {
    let text = "{ \"agents\": [ # comment\n\
        {\"type\": \"crazyflie\", \"cid\": 1, \"start\": [-1, 3.0, 1], \"goal\": [5, 1.0, 1]},\n\
        {\"type\": \"default\", \"cid\": 2, \"start\": [-1, 2.5, 1], \"goal\": [5, 1.5, 1]}]}";
    let set = MissionSet::read(text, "m.json", None)?;
    let [first, second] = &set.missions[..] else { panic!("two agents") };
    assert_eq!((first.home, route(first)), (Vector3::new(-1.0, 3.0, 0.0), vec![Vector3::new(5.0, 1.0, 1.0)]));
    assert_eq!((first.model.as_deref(), second.model.as_deref()), (Some("crazyflie"), None));
    let bad = text.replace("[5, 1.5, 1]", "[5, 1.5]");
    let error = MissionSet::read(&bad, "m.json", None).expect_err("two numbers").to_string();
    assert_eq!(error, "m.json:3: field `agents[1].goal`: expected 3 numbers, found 2");
    Ok(())
}

/// A mission over these places (ENU) that ends with a landing.
fn mission(places: &[[f64; 3]]) -> Mission {
    let waypoint = |p: &[f64; 3]| Waypoint { position: (*p).into(), ..Waypoint::default() };
    Mission { waypoints: places.iter().map(waypoint).collect(), ..Mission::default() }
}

fn field(vehicles: usize) -> Scenario {
    Scenario::built_in("open", Some(vehicles), 1).expect("an open field")
}

#[test]
fn one_mission_is_flown_by_all_in_trail() -> Result<(), ScenarioError> {
    let mut scenario = field(4);
    apply_missions(&mut scenario, vec![mission(&[[10.0, 0.0, 3.0], [10.0, 40.0, 3.0]])])?;
    for (i, vehicle) in scenario.vehicles.iter().enumerate() {
        let behind = SPACING_M * i as f64;
        assert!(near(vehicle.start, [-behind, 0.0, 0.0]), "{}", vehicle.start);
        assert!(near(vehicle.waypoints[0], [10.0, 0.0, 3.0]));
        assert!(near(vehicle.goal(), [10.0, 40.0 - behind, 3.0]), "{}", vehicle.goal());
        assert_eq!(vehicle.yaw, 0.0);
    }
    scenario.validate()
}

#[test]
fn in_trail_back_home_each_vehicle_returns_to_its_own_start() -> Result<(), ScenarioError> {
    let mut scenario = field(3);
    let there = Mission { ends: Ends::Return, ..mission(&[[10.0, 0.0, 3.0]]) };
    apply_missions(&mut scenario, vec![there])?;
    for vehicle in &scenario.vehicles {
        assert_eq!(vehicle.goal(), vehicle.start + Vector3::z() * 3.0);
        assert_eq!(vehicle.waypoints.len(), 2);
    }
    scenario.validate()
}

#[test]
fn several_missions_are_flown_one_by_each_and_may_share_a_home() -> Result<(), ScenarioError> {
    let mut scenario = field(2);
    let missions = vec![mission(&[[10.0, 0.0, 3.0]]), mission(&[[0.0, 10.0, 4.0]])];
    apply_missions(&mut scenario, missions)?;
    let [first, second] = &scenario.vehicles[..] else { panic!("two vehicles") };
    assert!((first.start - second.start).norm() >= SPACING_M - 1e-9);
    assert!(near(first.goal(), [10.0, 0.0, 3.0]) && near(second.goal(), [0.0, 10.0, 4.0]));
    assert!(scenario.notes.iter().any(|n| n.starts_with("vehicle 2: start moved from (0.00, 0.00, 0.00)")));
    scenario.validate()?;
    let error = apply_missions(&mut field(3), vec![mission(&[[9.0, 0.0, 3.0]]), mission(&[[0.0, 9.0, 3.0]])]);
    assert!(matches!(error, Err(ScenarioError::MissionCount { missions: 2, vehicles: 3 })));
    Ok(())
}

#[test]
fn as_many_vehicles_fly_as_there_are_missions() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let files: Vec<PathBuf> = (0..3)
        .map(|i| {
            let waypoint =
                item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, 9.0, 9.0 * f64::from(i), 5.0)));
            let path = folder.path().join(format!("{i}.plan"));
            std::fs::write(&path, plan(&HOME, &[waypoint])).map(|()| path)
        })
        .collect::<Result<_, _>>()?;
    let overrides = Overrides { missions: files, ..Overrides::default() };
    assert_eq!(Scenario::open("open", &overrides, 1)?.vehicles.len(), 3);
    Ok(())
}

#[test]
fn a_mission_sets_takeoff_height_and_speeds_up_to_what_the_vehicle_can() -> Result<(), ScenarioError> {
    let at_speed = |speed: f64| {
        let mut one = mission(&[[10.0, 0.0, 3.0]]);
        one.takeoff_height_m = Some(1.5);
        one.waypoints[0].speed_m_s = Some(speed);
        one
    };
    let mut slow = field(2);
    apply_missions(&mut slow, vec![at_speed(1.0)])?;
    assert_eq!((slow.takeoff_height_m, slow.cruise_speed_m_s), (1.5, 1.0));
    let mut fast = field(2);
    apply_missions(&mut fast, vec![at_speed(50.0)])?;
    assert_eq!(fast.cruise_speed_m_s, 50.0);
    assert!(
        fast.notes
            .iter()
            .any(|note| note.starts_with("vehicle 2: its mission asks for 50 m/s, it flies at most"))
    );
    Ok(())
}

fn gazebo(world: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/gazebo")).join(world);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: needs ../shared/data");
    None
}

/// Four vehicles with one plan in a published world.
fn in_trail(world: &Path, places: &[[f64; 3]]) -> Result<Scenario, Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("route.plan");
    let waypoint = |p: &[f64; 3]| item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, p[0], p[1], p[2])));
    let items: Vec<_> = places.iter().map(waypoint).collect();
    std::fs::write(&path, plan(&HOME, &items))?;
    let overrides = Overrides { world: Some(world.to_owned()), missions: vec![path], ..Overrides::default() };
    Ok(Scenario::open("open", &overrides, 1)?)
}

#[test]
fn a_single_plan_puts_four_vehicles_clear_of_published_obstacles() -> Result<(), Box<dyn std::error::Error>> {
    let routes: [(&str, &[[f64; 3]]); 4] = [
        ("boxes1.world", &[[8.0, 8.0, 3.0], [22.0, 8.0, 3.0], [22.0, -2.0, 3.0]]),
        ("boxes2.world", &[[0.0, -5.0, 3.0], [5.0, 0.0, 3.0], [10.0, 6.0, 3.0]]),
        ("boxes3.world", &[[0.5, 4.5, 3.0], [6.5, 3.0, 3.0], [12.0, 1.0, 3.0], [16.0, 0.0, 3.0]]),
        ("window.world", &[[2.0, 0.45, 3.0], [8.0, 0.45, 3.0], [16.0, 0.45, 3.0]]),
    ];
    for (world, route) in routes {
        let Some(path) = gazebo(world) else { return Ok(()) };
        let scenario = in_trail(&path, route)?;
        assert_eq!(scenario.vehicles.len(), 4, "{world}");
        for (i, vehicle) in scenario.vehicles.iter().enumerate() {
            let (start, goal) = (vehicle.start, vehicle.goal());
            assert!(scenario.scene.clearance(&start) >= 1.5 - 1e-9, "{world}: start {start}");
            assert!(scenario.scene.clearance(&goal) >= 1.5 - 1e-9, "{world}: goal {goal}");
            assert!(
                near(scenario.vehicles[0].goal(), route[route.len() - 1]),
                "{world}: the first flies to the end"
            );
            for other in scenario.vehicles.iter().skip(i + 1) {
                assert!((start - other.start).norm() >= SPACING_M - 1e-9);
                assert!((goal - other.goal()).xy().norm() >= SPACING_M - 1e-9);
            }
            for (place, waypoint) in route.iter().zip(&vehicle.waypoints).take(route.len() - 1) {
                assert!(near(*waypoint, *place), "{world}: the route is the plan's");
            }
        }
        if world == "window.world" {
            assert!(
                scenario.vehicles.iter().all(|v| v.start.x < 4.0 && v.goal().x > 6.0),
                "all go through the window"
            );
        }
    }
    Ok(())
}

#[test]
fn published_lsc_missions_are_read_with_their_worlds() -> Result<(), Box<dyn std::error::Error>> {
    let lsc = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/lsc"));
    if !lsc.exists() {
        println!("skipped: needs ../shared/data");
        return Ok(());
    }
    for (missions, worlds) in [
        ("missions/forest10/forest10_", "world/forest/forest"),
        ("missions/maze10_dense/maze10_", "world/maze/dense/maze"),
    ] {
        for number in [1, 2, 10] {
            let mission = lsc.join(format!("{missions}{number}.json"));
            let world = lsc.join(format!("{worlds}{number}.csv"));
            if !mission.exists() || !world.exists() {
                continue;
            }
            let overrides = Overrides { world: Some(world), missions: vec![mission], ..Overrides::default() };
            let scenario = Scenario::open("open", &overrides, 1)?;
            assert_eq!(scenario.vehicles.len(), 10);
            assert!(scenario.vehicles.iter().all(|v| v.model.name == "crazyflie"));
            assert!(scenario.notes.is_empty(), "{:?}", scenario.notes);
        }
    }
    Ok(())
}

/// A plan whose geofence excludes a circle of 5 m at (20, 0) and a triangle around (0, 20), and includes a large
/// circle.
fn fenced(items: &[String]) -> String {
    let corner = |x: f64, y: f64| {
        let place = HOME.to_geodetic(&Vector3::new(x, y, 0.0));
        format!("[{:.10}, {:.10}]", place.latitude_rad.to_degrees(), place.longitude_rad.to_degrees())
    };
    let circle = |x: f64, y: f64, radius_m: f64, inclusion: bool| {
        let centre = corner(x, y);
        format!(
            r#"{{"circle": {{"center": {centre}, "radius": {radius_m}}}, "inclusion": {inclusion}, "version": 1}}"#
        )
    };
    let corners = [corner(-4.0, 17.0), corner(4.0, 17.0), corner(0.0, 25.0)].join(", ");
    let fence = format!(
        r#""geoFence": {{"circles": [{}, {}], "polygons": [{{"inclusion": false, "polygon": [{corners}]}}], "version": 2}}"#,
        circle(20.0, 0.0, 5.0, false),
        circle(0.0, 0.0, 200.0, true),
    );
    let empty = r#""geoFence": {"circles": [], "polygons": [], "version": 2}"#;
    plan(&HOME, items).replace(empty, &fence)
}

#[test]
fn what_a_geofence_excludes_is_known_to_every_vehicle() {
    let waypoint = item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, 40.0, 0.0, 5.0)));
    let set = read(&fenced(&[waypoint]));
    let [circle] = &set.airspace.no_fly[..] else { panic!("one circle: {:?}", set.airspace) };
    assert!((circle.centre.x - 20.0).abs() < 0.01 && circle.centre.y.abs() < 0.01 && circle.radius_m == 5.0);
    let [polygon] = &set.airspace.prisms[..] else { panic!("one polygon: {:?}", set.airspace) };
    assert!((polygon.corners[2] - nalgebra::Vector2::new(0.0, 25.0)).norm() < 0.01);
    let [inside] = &set.airspace.stay_inside[..] else { panic!("one to stay inside of: {:?}", set.airspace) };
    assert!((inside.room_m(&Vector3::new(150.0, 0.0, 5.0)) - 50.0).abs() < 0.05, "{inside:?}");
    assert!(set.warnings.is_empty());
}

#[test]
fn an_item_inside_an_excluded_zone_is_refused_with_its_line() {
    let waypoint = |x, y| item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, x, y, 5.0)));
    for (x, y) in [(22.0, 1.0), (0.0, 20.0)] {
        let text = refusal(&fenced(&[waypoint(9.0, 0.0), waypoint(x, y)]));
        assert!(text.starts_with("f.plan:6: field `mission.items[1]`: expected a place outside"), "{text}");
    }
    let turned = fenced(&[waypoint(9.0, 0.0)]).replace("\"inclusion\": false", "\"inclusion\": 0");
    assert!(refusal(&turned).contains("expected true or false"), "{}", refusal(&turned));
}

#[test]
fn of_many_warnings_a_hundred_are_listed_and_the_rest_is_said() {
    let way = item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, 10.0, 20.0, 5.0)));
    let odd = || way.replace("\"command\": 16", "\"command\": 82");
    let items: Vec<String> = (0..150).map(|_| odd()).chain([way.clone()]).collect();
    let warnings = read(&plan(&HOME, &items)).warnings;
    assert_eq!(warnings.len(), 101);
    assert!(warnings[100].message.ends_with("from here on, warnings are not listed"), "{}", warnings[100]);
}
