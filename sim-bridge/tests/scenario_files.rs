//! Scenario files that users write: what they may say, and how they are told what is wrong.

// Helpers fail like the tests that call them.

use std::path::Path;
use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::bthreads::LinkLossPolicy;
use skein_agent::{GlobalPlanner, LocalPlanner};
use skein_sim::fly::vehicle_name;
use skein_sim::scenario::{Overrides, Scenario, ScenarioError};
use skein_wire::event::What;
use skein_wire::{Destination, Order, Route, Who};
use skein_world::{Obstacle, PositionErrors, PositionFaultKind, Scene};

const YARD: &str = r#"
name = "yard"
about = "two vehicles change places round a pole"
cruise_speed_m_s = 1.5
global = "dstar-lite"
local = "vfh"
takeoff_height_m = 2.0
without_ground = "land"
time_limit_s = 60

[network]
latency_ms = 20
loss = 0.1

[wind]
mean_m_s = [2.0, 0.0, 0.0]
gust_m_s = 0.5

[gps]
sigma_m = 0.2

[[order]]
at_s = 9.0
order = "land"
vehicle = 2

[[order]]
at_s = 4.0
order = "hold"

[[vehicle]]
start_m = [-5.0, 0.0]
waypoints_m = [[-5.0, 5.0, 2.5], [5.0, 0.0, 2.5]]

[[vehicle]]
start_m = [5.0, 0.0]
waypoints_m = [[-5.0, 0.0, 3.0]]
yaw_rad = 1.0
model = "crazyflie"

[[obstacle]]
name = "pole"
centre_m = [0.0, 0.0, 2.0]
cylinder = { radius_m = 0.3, height_m = 4.0 }

[[obstacle]]
centre_m = [20.0, 0.0, 1.0]
yaw_rad = 0.5
box_m = [1.0, 2.0, 2.0]
"#;

fn read(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::from_toml(text, "yard.toml", None, 1)
}

/// The message for [`YARD`] with one piece of it replaced.
fn message(from: &str, to: &str) -> String {
    assert!(YARD.contains(from), "`{from}` is in the file");
    read(&YARD.replacen(from, to, 1)).expect_err("the file is wrong").to_string()
}

/// `yard.toml:LINE:` where [`YARD`] says `part`.
fn line_of(part: &str) -> String {
    let before = YARD.find(part).map_or(0, |offset| YARD[..offset].matches('\n').count());
    format!("yard.toml:{}:", before + 1)
}

#[test]
fn a_scenario_file_sets_vehicles_obstacles_orders_and_conditions() -> Result<(), ScenarioError> {
    let yard = read(YARD)?;
    assert_eq!((yard.name.as_str(), yard.vehicles.len()), ("yard", 2));
    assert_eq!((yard.cruise_speed_m_s, yard.takeoff_height_m, yard.time_limit_s), (1.5, 2.0, 60.0));
    assert_eq!(yard.without_ground, LinkLossPolicy::Land);
    assert_eq!((yard.planners.global, yard.planners.local), (GlobalPlanner::DstarLite, LocalPlanner::Vfh));
    assert_eq!((yard.network.latency_ms, yard.network.loss), (20.0, 0.1));
    assert_eq!((yard.wind.mean, yard.wind.gust_sigma_m_s), (Vector3::new(2.0, 0.0, 0.0), 0.5));
    let orders =
        [(4.0, Order::new(What::Hold, Who::All)), (9.0, Order::new(What::Land, Who::only(vehicle_name(1))))];
    assert_eq!(yard.orders, orders);
    let [first, second] = &yard.vehicles[..] else { panic!("two vehicles") };
    assert_eq!(first.start, Vector3::new(-5.0, 0.0, 0.0));
    assert!((first.yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "looks at its first waypoint");
    assert_eq!((second.yaw, second.model.name.as_str()), (1.0, "crazyflie"));
    assert_eq!(first.model.gps.unwrap().sigma_horizontal_m, 0.2);
    let names: Vec<_> = yard.scene.obstacles().iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["pole", "obstacle 2"]);
    assert!((yard.scene.clearance(&Vector3::new(-5.0, 0.0, 1.0)) - 4.7).abs() < 1e-12);
    Ok(())
}

#[test]
fn fewer_vehicles_than_described_may_fly_but_not_more() {
    let two =
        Scenario::from_toml(YARD, "yard.toml", Some(1), 1).expect_err("an order is for the second vehicle");
    assert!(two.to_string().contains("order[0].vehicle"), "{two}");
    let one = YARD.replace("vehicle = 2\n", "");
    assert_eq!(Scenario::from_toml(&one, "yard.toml", Some(1), 1).map(|s| s.vehicles.len()).ok(), Some(1));
    let three =
        Scenario::from_toml(&one, "yard.toml", Some(3), 1).expect_err("two are described").to_string();
    assert_eq!(three, "scenario `yard` describes 2 vehicles, 3 were asked for");
}

#[test]
fn a_scenario_s_operator_may_say_all_that_one_at_the_console_may() {
    let said = |order: &str| {
        let text = YARD.replace("order = \"land\"\nvehicle = 2\n", order);
        Scenario::from_toml(&text, "yard.toml", None, 1).map(|yard| yard.orders[1].1.clone())
    };
    let (all, second) = (Who::All, || vehicle_name(1));
    let place = Destination { x: 1.0, y: -2.0, z: None };
    let way = Route::new(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).unwrap();
    for (order, expected) in [
        ("order = \"goto\"\npoint = [1, -2]\n", Order::go_to(all, place)),
        ("order = \"route\"\nvehicle = 2\npoints = [[1, 2, 3], [4, 5, 6]]\n", Order::route(second(), way)),
        ("order = \"give\"\nvehicle = 2\nname = \"Ben\"\n", Order::give(Who::only(second()), "Ben")),
    ] {
        assert_eq!(said(order).unwrap(), expected, "{order}");
    }
    for (order, words) in [
        ("order = \"goto\"\n", "`goto` needs a `point`"),
        ("order = \"goto\"\npoint = [1]\n", "expected [east, north]"),
        ("order = \"route\"\npoints = [[1, 2, 3], [4, 5, 6]]\n", "a route is for one vehicle"),
        ("order = \"abort\"\nvehicle = 2\n", "is for all"),
        ("order = \"load\"\n", "[[script]]"),
    ] {
        let error = said(order).unwrap_err().to_string();
        assert!(error.contains("order[0]") && error.contains(words), "{order}: {error}");
    }
}

#[test]
fn malformed_toml_is_refused_with_file_line_and_column() {
    let text = message("name = \"yard\"", "name = \"yard");
    assert!(text.starts_with(&line_of("name = ")), "{text}");
    let text = message("at_s = 9.0", "at_s 9.0");
    assert!(text.starts_with(&line_of("at_s = 9.0")), "{text}");
}

#[test]
fn an_unknown_key_is_refused_with_its_place_and_the_known_ones() {
    let text = message("gust_m_s = 0.5", "gusts = 0.5");
    let place = line_of("gust_m_s = 0.5");
    assert!(text.starts_with(&format!("{place}1: field `wind.gusts`: unknown field `gusts`")), "{text}");
    assert!(text.contains("`gust_m_s`"), "{text}");
    let text = message("model = \"crazyflie\"", "modle = \"crazyflie\"");
    let place = line_of("model = \"crazyflie\"");
    assert!(text.starts_with(&format!("{place}1: field `vehicle[1].modle`")), "{text}");
}

#[test]
fn a_value_out_of_range_is_refused_with_its_field_and_what_was_expected() {
    let cases = [
        (
            "cruise_speed_m_s = 1.5",
            "cruise_speed_m_s = -1.5",
            "20: field `cruise_speed_m_s`",
            "a number above 0",
        ),
        ("loss = 0.1", "loss = 1.0", "8: field `network.loss`", "a number from 0 to below 1"),
        (
            "latency_ms = 20",
            "latency_ms = 1e300",
            "14: field `network.latency_ms`",
            "a number from 0 to 60000",
        ),
        ("loss = 0.1", "lease_ms = -5", "12: field `network.lease_ms`", "a number from 100 to 10000"),
        ("radius_m = 0.3", "radius_m = nan", "25: field `obstacle[0].cylinder.radius_m`", "a number above 0"),
        ("[5.0, 0.0, 2.5]]", "[5.0, inf, 2.5]]", "15: field `vehicle[0].waypoints_m`", "finite"),
        ("order = \"hold\"", "order = \"stop\"", "9: field `order[1].order`", "`hold`"),
        ("start_m = [5.0, 0.0]", "start_m = [5.0]", "11: field `vehicle[1].start_m`", "2"),
        ("box_m = [1.0, 2.0, 2.0]", "box_m = [1.0, 0.0, 2.0]", "9: field `obstacle[1].box_m`", "above 0"),
    ];
    for (from, to, place, expected) in cases {
        let text = message(from, to);
        assert!(text.starts_with(&(line_of(from) + place)) && text.contains(expected), "{to}: {text}");
    }
}

#[test]
fn fields_that_contradict_one_another_are_refused() {
    let text = message("box_m = [1.0, 2.0, 2.0]", "");
    assert_eq!(text, "yard.toml: obstacle[1]: expected exactly one of box_m, cylinder and sphere");
    let text = message("[gps]", "[forest]\n[gps]");
    assert_eq!(text, "yard.toml: forest: has no effect without generator = \"forest\"");
    let text = message("[gps]", "[bounds]\nmin_m = [0, 0, 0]\nmax_m = [1, 0, 1]\n[gps]");
    assert!(text.contains("min_m below max_m"), "{text}");
    let thick = "generator = \"forest\"\n[forest]\nmin_radius_m = 0.9\n";
    let text = read(thick).expect_err("thin is thicker than thick").to_string();
    assert_eq!(text, "yard.toml: forest.min_radius_m: expected at most max_radius_m, 0.6");
    let dense = "generator = \"forest\"\n[forest]\ndensity_per_m2 = 1e6\n";
    assert!(read(dense).expect_err("too many trunks").to_string().contains("forest.density_per_m2"));
}

#[test]
fn a_start_inside_an_obstacle_names_vehicle_obstacle_and_position() {
    let text = message("start_m = [5.0, 0.0]", "start_m = [0.1, 0.0]");
    assert!(text.starts_with("vehicle 2: start (0.10, 0.00, 0.00) is inside obstacle `pole`"), "{text}");
}

#[test]
fn a_start_under_something_that_the_climb_would_meet_names_it_and_how_high_it_is() {
    let roof = |z: f64, x: f64| {
        format!("[[obstacle]]\nname = \"roof\"\ncentre_m = [{x}, 0.0, {z}]\nbox_m = [2.0, 2.0, 0.2]\n[gps]")
    };
    let fault = |z, x| read(&YARD.replacen("[gps]", &roof(z, x), 1)).err().map(|error| error.to_string());
    let text = fault(1.7, 5.0).unwrap_or_default();
    assert!(
        text.starts_with("vehicle 2: obstacle `roof` is 1.6 m above the start (5.00, 0.00, 0.00)"),
        "{text}"
    );
    // Its hull would touch the roof's edge.
    assert!(fault(1.7, 6.1).is_some_and(|text| text.contains("`roof`")));
    assert_eq!(fault(1.7, 6.2), None);
    assert_eq!(fault(2.9, 5.0), None, "it climbs to 2 m only");
    assert!(fault(2.5, 5.0).is_some(), "it needs room above itself");
}

#[test]
fn a_start_or_goal_out_of_stated_bounds_is_refused() {
    let bounded = |edge: &str| format!("[bounds]\nmin_m = [{edge}, -20, -1]\nmax_m = [6, 20, 9]\n[gps]");
    let text = message("[gps]", &bounded("-4.0"));
    assert!(text.starts_with("vehicle 1: start (-5.00, 0.00, 0.00) is outside the world"), "{text}");
    let tall = YARD.replace("[5.0, 0.0, 2.5]]", "[5.0, 0.0, 9.5]]").replace("[gps]", &bounded("-9.0"));
    let text = read(&tall).expect_err("over the ceiling").to_string();
    assert!(text.starts_with("vehicle 1: goal (5.00, 0.00, 9.50) is outside the world"), "{text}");
}

#[test]
fn bounds_that_nobody_stated_grow_with_the_routes() -> Result<(), ScenarioError> {
    let far = read(&YARD.replace("[5.0, 0.0, 2.5]]", "[500.0, 0.0, 2.5]]"))?;
    assert_eq!(far.scene.bounds().max.x, 505.0);
    Ok(())
}

#[test]
fn vehicles_that_would_stand_in_one_another_are_refused() {
    let text = message("start_m = [5.0, 0.0]", "start_m = [-5.0, 0.3]");
    assert!(text.starts_with("starts of vehicles 1 and 2 are 0.30 m apart: expected at least"), "{text}");
    let text = message("[[-5.0, 0.0, 3.0]]", "[[5.0, 0.1, 6.0]]");
    assert!(text.starts_with("goals of vehicles 1 and 2 are 0.10 m apart"), "{text}");
}

#[test]
fn goals_nearer_than_the_vehicles_keep_are_refused_to_one_another_and_beside_anothers_start() {
    // A crazyflie keeps 5.6 hulls of 0.15 m from its like, and an X500 1.4 m from both.
    let goal = |x: f64| YARD.replacen("[[-5.0, 0.0, 3.0]]", &format!("[[{x}, -6.0, 3.0]]"), 1);
    let text = |x: f64| goal(x).replacen("[5.0, 0.0, 2.5]]", "[0.0, -6.0, 2.5]]", 1);
    let error = read(&text(1.39)).expect_err("too near").to_string();
    assert_eq!(
        error,
        "goals of vehicles 1 and 2 are 1.39 m apart: expected at least 1.40 m; move one of them"
    );
    assert!(read(&text(1.4)).is_ok());
    let beside = |x: f64| YARD.replacen("[5.0, 0.0, 2.5]]", &format!("[{x}, 0.0, 2.5]]"), 1);
    let error = read(&beside(5.8)).expect_err("too near").to_string();
    assert!(
        error.starts_with(
            "goal of vehicle 1 is 0.80 m beside the start of vehicle 2: expected at least 1.40 m"
        ),
        "{error}"
    );
    assert!(read(&beside(6.4)).is_ok());
    assert!(read(&beside(5.0)).is_ok_and(|yard| yard.musters()), "that very place is left first");
}

#[test]
fn vehicles_that_are_in_the_air_together_start_as_far_apart_as_they_keep() {
    let near = YARD.replacen("start_m = [5.0, 0.0]", "start_m = [-5.0, 1.0]", 1);
    let near = near.replacen("[[-5.0, 0.0, 3.0]]", "[[9.0, 9.0, 3.0]]", 1);
    assert!(read(&near).is_ok(), "one takes off when the other is gone");
    let together = near.replacen("order = \"hold\"", "order = \"launch_together\"", 1);
    let error = read(&together).expect_err("too near").to_string();
    assert!(
        error.starts_with("starts of vehicles 1 and 2 are 1.00 m apart: expected at least 1.40 m"),
        "{error}"
    );
}

#[test]
fn a_task_whose_routes_end_too_near_to_one_another_is_refused() {
    let formation = |spacing_m: f64| {
        format!(
            "vehicles = 3\n[formation]\nshape = \"line\"\nspacing_m = {spacing_m}\nleader_m = [[0, 0, 3], [9, 0, 3]]\n"
        )
    };
    assert!(read(&formation(1.4)).is_ok());
    let error = read(&formation(1.2)).expect_err("too near").to_string();
    assert!(error.contains("of vehicles 1 and 2 are 1.20 m apart"), "{error}");
}

#[test]
fn a_vehicle_without_a_way_or_below_the_ground_is_refused() {
    let text = message("waypoints_m = [[-5.0, 0.0, 3.0]]", "");
    assert_eq!(text, "vehicle 2 has nowhere to go: give it waypoints or a mission");
    let text = message("[[-5.0, 0.0, 3.0]]", "[[-5.0, 0.5, 0.0]]");
    assert!(text.starts_with("vehicle 2: goal (-5.00, 0.50, 0.00) is not above the ground"), "{text}");
}

#[test]
fn no_vehicles_are_refused() {
    let text = Scenario::built_in("forest", Some(0), 1).expect_err("nothing to fly").to_string();
    assert_eq!(
        text,
        "scenario `forest` has no vehicles: expected at least 1; give --vehicles N or [[vehicle]] tables"
    );
    assert!(matches!(read("name = \"empty\""), Err(ScenarioError::NoVehicles { .. })));
}

#[test]
fn an_unknown_scenario_lists_the_known_ones() {
    let error =
        Scenario::open("forrest", &Overrides::default(), 1).expect_err("no such scenario").to_string();
    assert!(
        error.contains("`forrest`")
            && error.contains("forest, antipodal, window, open, survey, geese, valley"),
        "{error}"
    );
    let error =
        Scenario::open("no/such.toml", &Overrides::default(), 1).expect_err("no such file").to_string();
    assert!(error.starts_with("cannot read `no/such.toml`"), "{error}");
}

#[test]
fn files_named_in_a_scenario_are_beside_it() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
    put("boxes.csv", "10,0,2.5,1,1,5\n")?;
    put("crossing.toml", "generator = \"open\"\nworld = \"boxes.csv\"\nvehicles = 2\n")?;
    let path = folder.path().join("crossing.toml").display().to_string();
    let scenario = Scenario::open(&path, &Overrides::default(), 1)?;
    assert_eq!((scenario.name.as_str(), scenario.scene.obstacles().len()), ("crossing", 1));
    put("crossing.toml", "generator = \"open\"\nworld = \"none.csv\"\n")?;
    let error = Scenario::open(&path, &Overrides::default(), 1).expect_err("no such world").to_string();
    assert!(error.contains("none.csv"), "{error}");
    Ok(())
}

#[test]
fn in_another_world_starts_and_goals_move_out_of_its_obstacles() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let world = folder.path().join("boxes.csv");
    // A building over each start of the eastbound pair.
    std::fs::write(&world, "-12,2,2.5,3,12,5\n")?;
    let overrides = Overrides { world: Some(world), ..Overrides::default() };
    let scenario = Scenario::open("open", &overrides, 1)?;
    for vehicle in &scenario.vehicles {
        assert!(scenario.scene.clearance(&vehicle.start) >= 1.5, "{}", vehicle.start);
    }
    let starts: Vec<_> = scenario.vehicles.iter().map(|v| v.start).collect();
    assert!(
        starts
            .iter()
            .enumerate()
            .all(|(i, a)| starts.iter().skip(i + 1).all(|b| (a - b).norm() >= 3.0 - 1e-9))
    );
    assert!(
        scenario.notes.iter().any(|note| note.starts_with("vehicle 1: start moved from")),
        "{:?}",
        scenario.notes
    );
    Ok(())
}

#[test]
fn malformed_world_files_name_file_and_line() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    for (name, text) in [("bad.csv", "1,2,3,1,1,1\n1,2,x\n"), ("bad.world", "<sdf>\n<world>\n</sdf>\n")] {
        let world = folder.path().join(name);
        std::fs::write(&world, text)?;
        let overrides = Overrides { world: Some(world.clone()), ..Overrides::default() };
        let error = Scenario::open("open", &overrides, 1).expect_err("malformed").to_string();
        assert!(error.contains(&format!("{}:", Path::new(name).display())), "{error}");
    }
    Ok(())
}

#[test]
fn the_example_scenario_is_sound_and_explains_every_key() -> Result<(), ScenarioError> {
    let text = include_str!("../scenarios/yard.toml");
    let yard = Scenario::from_toml(text, "yard.toml", None, 1)?;
    assert_eq!((yard.vehicles.len(), yard.scene.obstacles().len(), yard.orders.len()), (2, 3, 2));
    assert!(yard.notes.is_empty(), "{:?}", yard.notes);
    let refusal = read("nothing = 1").expect_err("no such key").to_string();
    let generated = ["forest", "antipodal", "window", "open"];
    let (_, expected) = refusal.split_once("expected one of").expect("lists the keys");
    let named = expected.split('`').skip(1).step_by(2);
    let keys: Vec<_> = named.filter(|key| !generated.contains(key)).collect();
    assert!(keys.len() > 12, "{refusal}");
    for key in keys {
        assert!(text.contains(key), "`{key}` is not in the example");
    }
    Ok(())
}

#[test]
fn a_task_that_cannot_be_done_is_refused_with_why() {
    let refusal = |text: &str| read(text).expect_err("the task is wrong").to_string();
    let coverage = "[coverage]\narea_m = [[0, 0], [9, 9], [18, 18]]\nswath_m = 4\nheight_m = 3\n";
    let error = refusal(coverage);
    assert!(error.contains("coverage") && error.contains("encloses nothing"), "{error}");
    let formation = "[formation]\nshape = \"wedge\"\nspacing_m = 4\nleader_m = [[0, 0, 3], [9, 0, 3]]\n";
    let error = refusal(&format!("{formation}{coverage}"));
    assert!(error.contains("formation") && error.contains("`coverage`"), "{error}");
    let targets = "[targets]\nfrom_m = [[0, 0], [0, 20]]\nplaces_m = [[40, 10, 5]]\nspacing_m = 4\n";
    assert!(refusal(targets).contains("[bounds]"));
    let bounds = "[bounds]\nmin_m = [-5, -5, -1]\nmax_m = [45, 25, 15]\n";
    let mountain = "[[airspace.mountain]]\ncentre_m = [40, 10]\nheight_m = 10\nslope_m = [5, 5]\n";
    let error = refusal(&format!("{bounds}{targets}{mountain}"));
    assert!(error.contains("no route was found for vehicle"), "the target is in the mountain: {error}");
    let triangle = "[[airspace.no_fly]]\ncorners_m = [[10, 5], [20, 5], [20, 15]]\n";
    let error = refusal(&format!("{bounds}{targets}{triangle}"));
    assert!(error.contains("`airspace.no_fly`"), "{error}");
}

#[test]
fn more_vehicles_than_a_scenario_counts_with_have_time_to_take_off() -> Result<(), ScenarioError> {
    let limit_s = |vehicles| Scenario::built_in("forest", vehicles, 1).map(|forest| forest.time_limit_s);
    assert_eq!([limit_s(Some(2))?, limit_s(Some(8))?], [limit_s(None)?; 2]);
    assert_eq!(limit_s(Some(108))?, limit_s(None)? + 300.0);
    Ok(())
}

#[test]
fn targets_are_shared_and_reached_at_one_time() -> Result<(), ScenarioError> {
    let valley = Scenario::built_in("valley", None, 7)?;
    assert!(valley.muster && valley.arrive_together);
    let again = Scenario::built_in("valley", None, 7)?;
    assert_eq!(valley.vehicles, again.vehicles);
    Ok(())
}

#[test]
fn errors_of_positions_are_each_vehicles_own_or_those_of_all() -> Result<(), ScenarioError> {
    let tables = "[position_error]\nsigma_m = 1.0\n[[position_fault]]\nat_s = 20.0\nfor_s = 5.0\nvehicle = 2\n\
                  jump_m = [8.0, 0.0, 0.0]\n[[position_fault]]\nat_s = 30.0\ngps_lost = true\n[gps]";
    let text = YARD.replace("[gps]", tables).replace(
        "model = \"crazyflie\"",
        "model = \"crazyflie\"\nposition_error = { sigma_m = 0.3, correlation_s = 20.0, vertical = 1.0 }",
    );
    let errors: Vec<_> = read(&text)?.vehicles.iter().map(|plan| plan.position_errors.clone()).collect();
    let [first, second] = errors.as_slice() else { panic!("two vehicles: {errors:?}") };
    assert_eq!(
        (first.drift.sigma_m, first.drift.sigma_vertical_m, first.drift.correlation_s),
        (1.0, 0.5, 60.0)
    );
    assert_eq!((second.drift.sigma_m, second.drift.sigma_vertical_m), (0.3, 0.3));
    let kinds = |errors: &PositionErrors| errors.faults.iter().map(|fault| fault.kind).collect::<Vec<_>>();
    let jump = PositionFaultKind::Jump(Vector3::new(8.0, 0.0, 0.0));
    assert_eq!(kinds(first), [PositionFaultKind::GpsLost]);
    assert_eq!(kinds(second), [jump, PositionFaultKind::GpsLost]);
    Ok(())
}

#[test]
fn a_position_fault_is_one_thing_of_a_vehicle_that_is_there() {
    let fault = |fault: &str| message("[gps]", &format!("[[position_fault]]\nat_s = 1.0\n{fault}\n[gps]"));
    for none_or_two in ["", "gps_lost = false", "freezes = true\nresets = true"] {
        let text = fault(none_or_two);
        assert!(text.starts_with("yard.toml: position_fault[0]: expected exactly one of jump_m"), "{text}");
    }
    let text = fault("resets = true\nvehicle = 3");
    assert_eq!(text, "yard.toml: position_fault[0].vehicle: there is no vehicle 3: expected 1 to 2");
    let text = fault("late_s = 11.0");
    assert!(text.contains("`position_fault[0].late_s`") && text.contains("0 to 10"), "{text}");
}

const CROWD: &str = r#"
[bounds]
min_m = [-20.0, -10.0, -1.0]
max_m = [20.0, 10.0, 8.0]

[[vehicle]]
start_m = [-15.0, 0.0]
waypoints_m = [[15.0, 0.0, 1.2]]

[[obstacle]]
name = "cart"
centre_m = [0.0, 8.0, 1.0]
box_m = [1.0, 1.0, 2.0]
waypoints_m = [[0.0, -8.0, 1.0], [4.0, -8.0, 1.0]]
speed_m_s = [2.0, 1.0]
waits_s = 1.0
loops = true

[[obstacle]]
name = "ball"
centre_m = [5.0, 5.0, 1.0]
sphere = { radius_m = 0.3 }
velocity_m_s = [0.0, -0.5, 0.0]

[[obstacle]]
name = "pole"
centre_m = [-5.0, 5.0, 3.0]
cylinder = { radius_m = 0.3, height_m = 6.0 }

[[walker]]
number = 5
"#;

#[test]
fn obstacles_of_a_file_move_as_it_says() -> Result<(), ScenarioError> {
    let mut scene = Scenario::from_toml(CROWD, "crowd.toml", None, 3)?.scene;
    let place = |scene: &Scene, name: &str| {
        let found = scene.obstacles().iter().find(|obstacle| obstacle.name == name);
        found.map(|obstacle| obstacle.pose.translation.vector)
    };
    scene.move_on(Duration::from_secs(4));
    assert_eq!(place(&scene, "cart"), Some(Vector3::new(0.0, 0.0, 1.0)));
    assert_eq!(place(&scene, "ball"), Some(Vector3::new(5.0, 3.0, 1.0)));
    assert_eq!(place(&scene, "pole"), Some(Vector3::new(-5.0, 5.0, 3.0)));
    scene.move_on(Duration::from_secs(11));
    assert_eq!(place(&scene, "cart"), Some(Vector3::new(2.0, -8.0, 1.0)));
    assert_eq!(scene.moving().count(), 7);
    Ok(())
}

#[test]
fn walkers_walk_around_what_stands_and_not_over_pads_and_the_seed_tells_where() -> Result<(), ScenarioError> {
    let scene = |seed| Scenario::from_toml(CROWD, "crowd.toml", None, seed).map(|scenario| scenario.scene);
    let mut crowd = scene(3)?;
    let is_walker = |obstacle: &&Obstacle| obstacle.name.starts_with("walker");
    let mut walked_m = 0.0;
    for tenths in 0..600 {
        let before: Vec<_> = crowd.obstacles().iter().filter(is_walker).cloned().collect();
        crowd.move_on(Duration::from_millis(100 * tenths));
        for (walker, before) in crowd.obstacles().iter().filter(is_walker).zip(before) {
            let place = walker.pose.translation.vector;
            walked_m += (place - before.pose.translation.vector).norm();
            for pad in [-15.0, 15.0] {
                assert!((place.xy() - Vector3::new(pad, 0.0, 0.0).xy()).norm() > 2.9, "{place:?}");
            }
            let to_pole_m = (place.xy() - Vector3::new(-5.0, 5.0, 0.0).xy()).norm();
            assert!(to_pole_m > 0.3 + 0.25, "{place:?}");
            assert!(crowd.bounds().contains(&place));
        }
    }
    let mean_m_s = walked_m / 5.0 / 60.0;
    assert!((0.5..1.5).contains(&mean_m_s), "{mean_m_s} m/s");
    assert_eq!(crowd.obstacles().iter().filter(is_walker).count(), 5);
    assert_eq!(scene(3)?, scene(3)?);
    assert_ne!(scene(3)?, scene(4)?);
    Ok(())
}

#[test]
fn a_way_that_contradicts_itself_is_refused_with_its_field() {
    let refused = |from: &str, to: &str| {
        let text = CROWD.replacen(from, to, 1);
        Scenario::from_toml(&text, "crowd.toml", None, 1).map(|_| ()).expect_err(to).to_string()
    };
    for (from, to, field, expected) in [
        (
            "speed_m_s = [2.0, 1.0]",
            "speed_m_s = [2.0, 1.0, 3.0]",
            "obstacle[0].speed_m_s",
            "one for each of 2",
        ),
        ("speed_m_s = [2.0, 1.0]", "speed_m_s = 0.0", "obstacle[0].speed_m_s", "above 0"),
        ("loops = true", "velocity_m_s = [1.0, 0.0, 0.0]", "obstacle[0].velocity_m_s", "either"),
        ("velocity_m_s = [0.0, -0.5, 0.0]", "loops = true", "obstacle[1].waypoints_m", "waypoints_m"),
        ("number = 5", "speed_m_s = [1.5, 0.5]", "walker[0].speed_m_s", "least"),
    ] {
        let text = refused(from, to);
        assert!(text.contains(field) && text.contains(expected), "{text}");
    }
}
