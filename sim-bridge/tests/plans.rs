//! Plans as ground stations draw them: places that mean "here", jumps, surveys, fences, rally points, stays and speeds;
//! and how they are flown.

use std::path::PathBuf;

use nalgebra::Vector3;
use skein_sim::cli::Controller;
use skein_sim::element::Verdict;
use skein_sim::fly::Trial;
use skein_sim::mission::{Account, Allowances, MissionSet};
use skein_sim::scenario::{Overrides, Scenario, ScenarioError};
use skein_sim::summary::Summary;

use super::missions::{HOME, at, item, near, plan, read, refusal};

fn waypoint(x: f64, y: f64, height: f64) -> String {
    item(16, 3, &format!("0, 0, 0, null, {}", at(&HOME, x, y, height)))
}

fn takeoff(height: f64) -> String {
    item(22, 3, &format!("0, 0, 0, null, {}", at(&HOME, 0.0, 0.0, height)))
}

fn home() -> String {
    item(20, 2, "0, 0, 0, 0, 0, 0, 0")
}

fn corner(x: f64, y: f64) -> String {
    let place = HOME.to_geodetic(&Vector3::new(x, y, 0.0));
    format!("[{:.10}, {:.10}]", place.latitude_rad.to_degrees(), place.longitude_rad.to_degrees())
}

fn corners(places: &[[f64; 2]]) -> String {
    format!("[{}]", places.iter().map(|[x, y]| corner(*x, *y)).collect::<Vec<_>>().join(", "))
}

/// The plan with these polygons to stay inside of.
fn inside(text: &str, polygons: &[&[[f64; 2]]]) -> String {
    let zone = |places: &&[[f64; 2]]| {
        format!(r#"{{"inclusion": true, "polygon": {}, "version": 1}}"#, corners(places))
    };
    let zones = polygons.iter().map(zone).collect::<Vec<_>>().join(",\n");
    text.replace(r#""polygons": []"#, &format!(r#""polygons": [{zones}]"#))
}

fn rally(text: &str, places: &[[f64; 3]]) -> String {
    let point = |[x, y, z]: &[f64; 3]| format!("{}, {z}]", corner(*x, *y).trim_end_matches(']'));
    let points = places.iter().map(point).collect::<Vec<_>>().join(", ");
    text.replace(r#""points": []"#, &format!(r#""points": [{points}]"#))
}

fn survey(places: &[[f64; 3]]) -> String {
    let items: Vec<_> = places.iter().map(|[x, y, z]| waypoint(*x, *y, *z)).collect();
    format!(
        r#"{{"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {{"Items": [{}]}}}}"#,
        items.join(", ")
    )
}

fn route(text: &str) -> Vec<[f64; 3]> {
    let places = read(text).missions[0].waypoints.iter().map(|w| w.position).collect::<Vec<_>>();
    places.iter().map(|place| [place.x, place.y, place.z].map(|c| (c * 10.0).round() / 10.0)).collect()
}

fn allowing(text: &str, allowances: Allowances) -> Result<MissionSet, String> {
    let account = Account::read(text, "f.plan", None, allowances).map_err(|error| error.to_string())?;
    account.set.map_err(|error| error.to_string())
}

#[test]
fn nought_nought_is_where_the_item_before_ends() {
    let stay = item(16, 3, "4, 0, 0, null, 0, 0, 5");
    let loiter = item(19, 3, "4, 0, 0, null, null, null, 7");
    let text = plan(&HOME, &[takeoff(4.0), stay.clone(), waypoint(20.0, 3.0, 5.0), loiter, stay]);
    assert_eq!(route(&text), [[0.0, 0.0, 5.0], [20.0, 3.0, 5.0], [20.0, 3.0, 7.0], [20.0, 3.0, 5.0]]);
    let holds: Vec<f64> = read(&text).missions[0].waypoints.iter().map(|w| w.hold_s).collect();
    assert_eq!(holds, [4.0, 0.0, 4.0, 4.0]);
    let equator = plan(&HOME, &[item(16, 3, "0, 0, 0, null, 0, 8.5, 5")]);
    assert!(refusal(&equator).contains("--long-legs"), "latitude 0 alone is a place");
}

#[test]
fn a_leg_of_kilometres_is_flown_only_if_that_is_meant() {
    let text =
        plan(&HOME, &[waypoint(20.0, 0.0, 5.0), waypoint(20.0, 1400.0, 5.0), waypoint(20.0, 20.0, 5.0)]);
    let error = refusal(&text);
    assert!(
        error.starts_with("f.plan:6: field `mission.items[1].params[4]`") && error.contains("1400 m"),
        "{error}"
    );
    let allowances = Allowances { long_legs: true, ..Allowances::default() };
    assert_eq!(allowing(&text, allowances).unwrap().missions[0].waypoints.len(), 3);
}

#[test]
fn heights_from_the_sea_and_from_home_that_contradict_one_another_are_flown_only_if_that_is_meant() {
    let above_sea =
        |height: f64| item(16, 0, &format!("0, 0, 0, null, {}", at(&HOME, 20.0, 0.0, 488.0 + height)));
    let mixed = plan(&HOME, &[takeoff(5.0), above_sea(72.0), waypoint(20.0, 20.0, 5.0)]);
    let error = refusal(&mixed);
    assert!(error.starts_with("f.plan:6: field `mission.items[1].params[6]`"), "{error}");
    assert!(error.contains("--mixed-heights"), "{error}");
    let allowances = Allowances { mixed_heights: true, ..Allowances::default() };
    assert!(allowing(&mixed, allowances).is_ok());
    assert!(allowing(&plan(&HOME, &[takeoff(5.0), above_sea(9.0)]), Allowances::default()).is_ok());
    let climb = plan(&HOME, &[takeoff(5.0), waypoint(20.0, 0.0, 80.0)]);
    assert_eq!(route(&climb), [[20.0, 0.0, 80.0]], "of one kind they may differ");
}

#[test]
fn a_home_without_height_will_do_unless_a_height_counts_from_the_sea() {
    let unknown = |items: &[String]| plan(&HOME, items).replace(", 488]", ", null]");
    assert_eq!(route(&unknown(&[waypoint(9.0, 0.0, 5.0)])), [[9.0, 0.0, 5.0]]);
    let error = refusal(&unknown(&[item(16, 0, &format!("0, 0, 0, null, {}", at(&HOME, 9.0, 0.0, 493.0)))]));
    assert!(error.contains("mission.items[0].frame") && error.contains("plannedHomePosition"), "{error}");
}

#[test]
fn heights_above_terrain_are_refused_where_the_ground_is_not_flat() -> Result<(), Box<dyn std::error::Error>>
{
    let folder = tempfile::tempdir()?;
    let above_terrain = plan(&HOME, &[item(16, 10, &format!("0, 0, 0, null, {}", at(&HOME, 9.0, 0.0, 5.0)))]);
    std::fs::write(folder.path().join("t.plan"), above_terrain)?;
    let hill = "[[airspace.mountain]]\ncentre_m = [30.0, 30.0]\nheight_m = 6.0\nslope_m = [4.0, 4.0]\n";
    let open = |more: &str| {
        let path = folder.path().join("s.toml");
        std::fs::write(&path, format!("vehicles = 1\nmission = [\"t.plan\"]\n{more}"))?;
        Ok::<_, std::io::Error>(Scenario::open(&path.to_string_lossy(), &Overrides::default(), 1))
    };
    assert!(open("")?.is_ok());
    let error = open(hill)?.expect_err("a hill").to_string();
    assert!(error.contains("t.plan:5: mission.items[0].frame"), "{error}");
    Ok(())
}

#[test]
fn jumps_are_flown_as_often_as_they_say() {
    let jump = |to: u32, times: i32| item(177, 2, &format!("{to}, {times}, 0, 0, 0, 0, 0"));
    let (a, b) = (waypoint(9.0, 0.0, 5.0), waypoint(9.0, 9.0, 5.0));
    let text = plan(&HOME, &[a.clone(), b.clone(), jump(1, 2), waypoint(0.0, 9.0, 5.0)]);
    let norths: Vec<f64> = route(&text).iter().map(|place| place[1]).collect();
    assert_eq!(norths, [0.0, 9.0, 0.0, 9.0, 0.0, 9.0, 9.0]);
    let forward = plan(&HOME, &[a.clone(), jump(4, 1), b.clone(), waypoint(0.0, 9.0, 5.0)]);
    assert_eq!(route(&forward), [[9.0, 0.0, 5.0], [0.0, 9.0, 5.0]]);
    let error = refusal(&plan(&HOME, &[a.clone(), jump(9, 1)]));
    assert!(error.contains("params[0]`: expected the number of an item, found 9"), "{error}");
    let often: Vec<_> = (0..20).map(|_| jump(1, 1000)).collect();
    let error = refusal(&plan(&HOME, &[vec![a, b], often].concat()));
    assert!(error.contains("at most 10000 items that are flown again"), "{error}");
}

#[test]
fn turns_are_flown_around_their_place() {
    let loiter = item(18, 3, &format!("2, 0, -6, null, {}", at(&HOME, 20.0, 0.0, 5.0)));
    let text = plan(&HOME, &[waypoint(9.0, 0.0, 5.0), loiter]);
    let circle = read(&text).missions[0].waypoints.clone();
    let around = Vector3::new(20.0, 0.0, 5.0);
    assert_eq!(circle.len(), 26);
    assert!(circle[1..].iter().all(|w| ((w.position - around).norm() - 6.0).abs() < 0.01));
    assert!(near(circle[1].position, [14.0, 0.0, 5.0]) && near(circle[4].position, [20.0, -6.0, 5.0]));
}

#[test]
fn plans_of_former_years_are_read() {
    let old = waypoint(9.0, 3.0, 5.0);
    let place = at(&HOME, 9.0, 3.0, 5.0);
    let old = old
        .replace(&format!("[0, 0, 0, null, {place}]"), &format!("[0, 0, 0, 0], \"coordinate\": [{place}]"));
    assert!(old.contains("coordinate"));
    assert_eq!(route(&plan(&HOME, std::slice::from_ref(&old))), [[9.0, 3.0, 5.0]]);
    let fence = format!(
        r#""geoFence": {{"polygon": {}, "version": 1}}"#,
        corners(&[[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]])
    );
    let empty = r#""geoFence": {"circles": [], "polygons": [], "version": 2}"#;
    let error = refusal(&plan(&HOME, &[old]).replace(empty, &fence));
    assert!(error.contains("expected a place inside the zones"), "{error}");
    let other =
        refusal(&plan(&HOME, &[waypoint(1.0, 0.0, 5.0)]).replace(empty, r#""geoFence": {"ellipses": [1]}"#));
    assert!(other.contains("geoFence.ellipses"), "{other}");
}

#[test]
fn outside_of_what_a_fence_includes_an_item_a_home_and_a_rally_point_are_refused() {
    let l: &[[f64; 2]] =
        &[[-10.0, -10.0], [60.0, -10.0], [60.0, 15.0], [15.0, 15.0], [15.0, 60.0], [-10.0, 60.0]];
    let fenced = |x, y| inside(&plan(&HOME, &[waypoint(50.0, 0.0, 5.0), waypoint(x, y, 5.0)]), &[l]);
    assert_eq!(route(&fenced(0.0, 50.0)).len(), 2);
    let error = refusal(&fenced(50.0, 50.0));
    assert!(error.starts_with("f.plan:6: field `mission.items[1]`: expected a place inside"), "{error}");
    let away: &[[f64; 2]] = &[[20.0, -10.0], [60.0, -10.0], [60.0, 15.0], [20.0, 15.0]];
    let error = refusal(&inside(&plan(&HOME, &[waypoint(50.0, 0.0, 5.0)]), &[away]));
    assert!(error.contains("mission.plannedHomePosition"), "{error}");
    let error = refusal(&rally(&fenced(0.0, 50.0), &[[40.0, 40.0, 5.0]]));
    assert!(error.contains("rallyPoints.points[0]"), "{error}");
}

#[test]
fn of_several_zones_that_include_one_will_do_unless_the_autopilot_asks_for_all() {
    let (west, east): (&[[f64; 2]], &[[f64; 2]]) = (
        &[[-20.0, -20.0], [30.0, -20.0], [30.0, 20.0], [-20.0, 20.0]],
        &[[20.0, -20.0], [70.0, -20.0], [70.0, 20.0], [20.0, 20.0]],
    );
    let text = inside(&plan(&HOME, &[waypoint(50.0, 0.0, 5.0)]), &[west, east]);
    assert_eq!(route(&text).len(), 1);
    let ardupilot = text.replace("\"hoverSpeed\"", "\"firmwareType\": 3, \"hoverSpeed\"");
    assert!(refusal(&ardupilot).contains("plannedHomePosition"), "{}", refusal(&ardupilot));
}

#[test]
fn a_structure_scan_goes_round_in_layers() {
    let scan = format!(
        r#"{{"type": "ComplexItem", "complexItemType": "StructureScan", "version": 3, "EntranceAltitude": 12,
        "ScanBottomAlt": 4, "StructureHeight": 6, "StartFromTop": false, "Layers": 2, "GimbalPitch": 0,
        "CameraCalc": {{"DistanceToSurface": 5, "AdjustedFootprintFrontal": 3}}, "polygon": {}}}"#,
        corners(&[[20.0, 0.0], [30.0, 0.0], [30.0, 10.0], [20.0, 10.0]])
    );
    let places = route(&plan(&HOME, &[takeoff(12.0), scan]));
    assert_eq!(places.len(), 12);
    assert_eq!(places[..3], [[15.0, -5.0, 12.0], [15.0, -5.0, 5.5], [35.0, -5.0, 5.5]]);
    assert_eq!(places[10..], [[15.0, -5.0, 8.5], [15.0, -5.0, 12.0]]);
}

#[test]
fn every_element_is_accounted_for_and_reading_goes_on_after_a_refusal() {
    let items = [
        takeoff(5.0),
        waypoint(20.0, 5000.0, 5.0),
        item(206, 2, "5, 0, 0, 0, 0, 0, 0"),
        item(115, 2, "0, 0, 0, 0, 0, 0, 0"),
        item(208, 2, "2, 0, 0, 0, 0, 0, 0"),
        home(),
    ];
    let account = Account::read(&plan(&HOME, &items), "f.plan", None, Allowances::default()).unwrap();
    assert!(account.set.is_err());
    let verdicts: Vec<_> =
        account.elements.iter().filter(|e| e.what.contains("items")).map(|e| (e.line, e.verdict)).collect();
    use Verdict::{Harmless, Honoured, Refused};
    assert_eq!(
        verdicts,
        [(5, Honoured), (6, Refused), (7, Honoured), (8, Harmless), (9, Refused), (10, Honoured)]
    );
    assert!(account.elements.iter().any(|e| e.what == "mission.items[4]: 208 parachute"));
}

#[test]
fn a_mission_planner_file_is_read_by_its_text() {
    let text = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46.5\t7.25\t620\t1\n\
                1\t0\t3\t22\t15\t0\t0\t0\t0\t0\t5\t1\n\
                2\t0\t3\t16\t2\t0\t0\t0\t46.5\t7.25026054\t5\t1\n\
                3\t0\t0\t16\t0\t0\t0\t0\t46.50017992\t7.25\t626\t1\n\
                4\t0\t3\t177\t2\t1\t0\t0\t0\t0\t0\t1\n5\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1\n";
    for file in ["a.waypoints", "a.plan"] {
        let set = MissionSet::read(text, file, None).unwrap();
        let places: Vec<_> = set.missions[0].waypoints.iter().map(|w| w.position).collect();
        assert!(near(places[0], [20.0, 0.0, 5.0]) && near(places[1], [0.0, 20.0, 6.0]), "{places:?}");
        assert_eq!((places.len(), set.missions[0].waypoints[0].hold_s), (4, 2.0));
    }
    let wrong = |from: &str, to: &str| {
        MissionSet::read(&text.replacen(from, to, 1), "a.waypoints", None).expect_err("is wrong").to_string()
    };
    assert!(wrong("2\t0\t3\t16", "2\t0\t3\t4000").starts_with("a.waypoints:4: field `column 4, command`"));
    assert!(
        wrong("7.25026054\t5\t1", "7.25026054\t1")
            .starts_with("a.waypoints:4: field `row`: expected 12 columns")
    );
    assert!(wrong("7.25026054", "seven").contains("`column 10`: expected a number, found seven"));
    assert!(wrong("WPL 110", "WPL 100").contains("expected `QGC WPL 110`, found 100"));
}

#[test]
fn a_rally_point_outside_of_stated_bounds_is_refused() {
    let text = rally(&plan(&HOME, &[takeoff(5.0), waypoint(20.0, 0.0, 5.0), home()]), &[[90.0, 0.0, 5.0]]);
    let bounds = "[bounds]\nmin_m = [-30.0, -30.0, -1.0]\nmax_m = [30.0, 30.0, 12.0]\n";
    let error = scenario(&text, 1, bounds).expect_err("far out").to_string();
    assert!(error.starts_with("rally point (90.00, ") && error.contains("is outside the world"), "{error}");
    assert!(scenario(&text, 1, "").is_ok(), "bounds that nobody states hold it");
}

/// A flight of a plan over open ground, with the way of each vehicle in the air, second by second, and where it ended.
struct Flown {
    summary: Summary,
    ways: Vec<Vec<Vector3<f64>>>,
}

fn fly(text: &str, vehicles: usize, more: &str) -> Flown {
    let scenario = scenario(text, vehicles, more).unwrap();
    let mut ways = vec![Vec::new(); vehicles];
    let flown = Trial::new(&scenario, Controller::Bp).fly(&mut |swarm, _| {
        for (index, way) in ways.iter_mut().enumerate() {
            way.extend(swarm.simulation().vehicle(index).map(|vehicle| vehicle.motion.position));
        }
    });
    Flown { summary: flown.unwrap().summary, ways }
}

fn scenario(text: &str, vehicles: usize, more: &str) -> Result<Scenario, ScenarioError> {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, text).map(|()| path).unwrap()
    };
    put("p.plan", text);
    let file = put(
        "s.toml",
        &format!("generator = \"open\"\nvehicles = {vehicles}\nmission = [\"p.plan\"]\n{more}"),
    );
    Scenario::open(&file.to_string_lossy(), &Overrides::default(), 1)
}

#[test]
fn a_plan_is_flown_with_its_stays_and_each_leg_at_its_speed() {
    let speed = |m_s: f64| item(178, 2, &format!("1, {m_s}, -1, 0, 0, 0, 0"));
    let hold = item(16, 3, &format!("10, 0, 0, null, {}", at(&HOME, 20.0, 0.0, 5.0)));
    let items = [
        takeoff(5.0),
        speed(1.0),
        hold,
        speed(4.0),
        waypoint(20.0, 40.0, 5.0),
        item(93, 2, "20, 0, 0, 0, 0, 0, 0"),
        home(),
    ];
    let flown = fly(&plan(&HOME, &items), 1, "");
    assert_eq!(flown.summary.reason, None);
    let way = &flown.ways[0];
    let tick_s = flown.summary.sim_time_s / way.len() as f64;
    let near_s = |place: [f64; 2]| {
        let there = way.iter().filter(|at| (at.xy() - nalgebra::Vector2::from(place)).norm() < 0.6);
        there.count() as f64 * tick_s
    };
    assert!((9.5..14.0).contains(&near_s([20.0, 0.0])), "{}", near_s([20.0, 0.0]));
    assert!((19.5..24.0).contains(&near_s([20.0, 40.0])), "{}", near_s([20.0, 40.0]));
    let passes_s = |from: f64, to: f64, axis: usize| {
        let first = |beyond: f64| way.iter().position(|at| at[axis] > beyond).unwrap() as f64 * tick_s;
        (to - from) / (first(to) - first(from))
    };
    let (slow, fast) = (passes_s(5.0, 15.0, 0), passes_s(15.0, 25.0, 1));
    assert!((0.85..1.1).contains(&slow), "{slow} m/s");
    assert!((3.2..4.3).contains(&fast), "{fast} m/s");
}

#[test]
fn vehicles_that_return_land_at_the_nearest_rally_point_one_each() {
    let around = [waypoint(60.0, 0.0, 5.0), waypoint(60.0, 40.0, 5.0), waypoint(0.0, 40.0, 5.0)];
    let items = [vec![takeoff(5.0)], around.to_vec(), vec![home()]].concat();
    let points = [[58.0, 12.0, 5.0], [30.0, 45.0, 5.0]];
    let text = rally(&plan(&HOME, &items), &points);
    let flown = fly(&text, 2, "[[order]]\nat_s = 32.0\norder = \"return\"\n");
    let ends: Vec<_> = flown.ways.iter().map(|way| way[way.len() - 1]).collect();
    let at_point = |end: &Vector3<f64>| {
        points.iter().position(|p| (end.xy() - nalgebra::Vector2::new(p[0], p[1])).norm() < 1.0)
    };
    let mut had: Vec<_> = ends.iter().map(at_point).collect();
    had.sort_unstable();
    assert_eq!(had, [Some(0), Some(1)], "{ends:?} {:?}", flown.summary.reason);
    assert_eq!(flown.summary.collisions.vehicle, 0);
}

#[test]
fn a_plan_that_ends_with_a_return_ends_at_a_rally_point_if_that_is_nearer() {
    let text = rally(&plan(&HOME, &[takeoff(5.0), waypoint(60.0, 0.0, 5.0), home()]), &[[50.0, 9.0, 5.0]]);
    let flown = fly(&text, 1, "");
    assert_eq!(flown.summary.reason, None);
    assert!((flown.ways[0].last().unwrap().xy() - nalgebra::Vector2::new(50.0, 9.0)).norm() < 1.0);
}

#[test]
fn a_survey_is_flown_once_by_all_together() {
    let lines = [
        [10.0, 10.0, 5.0],
        [10.0, 50.0, 5.0],
        [20.0, 50.0, 5.0],
        [20.0, 10.0, 5.0],
        [30.0, 10.0, 5.0],
        [30.0, 50.0, 5.0],
        [40.0, 50.0, 5.0],
        [40.0, 10.0, 5.0],
    ];
    let text = plan(&HOME, &[takeoff(5.0), survey(&lines), home()]);
    let flown = fly(&text, 2, "");
    assert_eq!(flown.summary.reason, None);
    let passes = |way: &[Vector3<f64>], x: f64| {
        way.iter().any(|at| (at.x - x).abs() < 1.0 && (at.y - 30.0).abs() < 1.0)
    };
    for line in [10.0, 20.0, 30.0, 40.0] {
        let by = flown.ways.iter().filter(|way| passes(way, line)).count();
        assert_eq!(by, 1, "the line {line} m east");
    }
    let lengths: Vec<f64> =
        flown.ways.iter().map(|way| way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()).collect();
    assert!((lengths[0] - lengths[1]).abs() < 0.35 * lengths[0], "{lengths:?}");
}

#[test]
fn a_leg_is_flown_round_inside_the_fence_that_a_plan_draws() {
    let l: &[[f64; 2]] =
        &[[-10.0, -10.0], [60.0, -10.0], [60.0, 15.0], [15.0, 15.0], [15.0, 60.0], [-10.0, 60.0]];
    let text = inside(
        &plan(&HOME, &[takeoff(5.0), waypoint(50.0, 0.0, 5.0), waypoint(0.0, 50.0, 5.0), home()]),
        &[l],
    );
    let flown = fly(&text, 3, "");
    assert_eq!(flown.summary.reason, None);
    for at in flown.ways.iter().flatten() {
        assert!(at.x < 15.0 || at.y < 15.0, "{at}");
        assert!(at.x > -10.0 && at.y > -10.0 && at.x < 60.0 && at.y < 60.0, "{at}");
    }
}

/// Longitude and latitude, as maps have them.
fn map_place(x: f64, y: f64) -> [f64; 2] {
    let place = HOME.to_geodetic(&Vector3::new(x, y, 0.0));
    [place.longitude_rad.to_degrees(), place.latitude_rad.to_degrees()]
}

#[test]
fn polygons_and_lines_of_geojson_are_zones_and_routes() {
    let ring = |places: &[[f64; 2]]| places.iter().map(|[x, y]| map_place(*x, *y)).collect::<Vec<_>>();
    let square =
        |x: f64, size: f64| ring(&[[x, -size], [x + size, -size], [x + size, size], [x, size], [x, -size]]);
    let line: Vec<_> = ring(&[[0.0, 0.0], [30.0, 0.0], [30.0, 20.0]]);
    let collection = |line: serde_json::Value, mode: &str| {
        serde_json::json!({"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {"altitudeMode": mode}, "geometry": {"type": "LineString", "coordinates": line}},
            {"type": "Feature", "properties": {"inclusion": true}, "geometry": {"type": "Polygon", "coordinates": [square(-50.0, 150.0)]}},
            {"type": "Feature", "properties": null, "geometry": {"type": "Polygon", "coordinates": [square(50.0, 8.0)]}},
            {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": line[0]}},
        ]})
        .to_string()
    };
    let flat = collection(serde_json::json!(line), "");
    let set = MissionSet::read(&flat, "m.geojson", None).unwrap();
    let places: Vec<_> = set.missions[0].waypoints.iter().map(|w| w.position).collect();
    assert!(near(places[1], [30.0, 0.0, 5.0]) && near(places[2], [30.0, 20.0, 5.0]), "{places:?}");
    assert_eq!((set.airspace.stay_inside.len(), set.airspace.prisms.len(), set.warnings.len()), (1, 1, 2));
    let high: Vec<_> = line.iter().map(|[x, y]| [*x, *y, 7.0]).collect();
    let set =
        MissionSet::read(&collection(serde_json::json!(high), "relativeToGround"), "m.json", None).unwrap();
    assert_eq!(set.missions[0].waypoints[0].position.z, 7.0);
    let error =
        MissionSet::read(&collection(serde_json::json!(high), ""), "m.json", None).unwrap_err().to_string();
    assert!(error.contains("altitudeMode") && error.contains("a height of 7 m"), "{error}");
    let through = collection(serde_json::json!(ring(&[[0.0, 0.0], [54.0, 0.0]])), "");
    let error = MissionSet::read(&through, "m.json", None).unwrap_err().to_string();
    assert!(error.contains("outside the zones that `geoFence` excludes"), "{error}");
}

#[test]
fn placemarks_of_kml_are_zones_and_routes() {
    let words = |places: &[[f64; 2]], height: &str| {
        let place = |[x, y]: &[f64; 2]| {
            let [longitude, latitude] = map_place(*x, *y);
            format!("{longitude:.9},{latitude:.9}{height}")
        };
        places.iter().map(place).collect::<Vec<_>>().join(" ")
    };
    let kml = |mode: &str| {
        format!(
            "<?xml version=\"1.0\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document>\n\
             <Placemark><name>Way</name><LineString><altitudeMode>{mode}</altitudeMode>\n\
             <coordinates>{}</coordinates></LineString></Placemark>\n\
             <Placemark><name>Field</name><ExtendedData><Data name=\"inclusion\"><value>true</value></Data></ExtendedData>\n\
             <Polygon><outerBoundaryIs><LinearRing><coordinates>{}</coordinates></LinearRing></outerBoundaryIs>\n\
             <innerBoundaryIs><LinearRing><coordinates>{}</coordinates></LinearRing></innerBoundaryIs></Polygon></Placemark>\n\
             </Document></kml>",
            words(&[[0.0, 0.0], [30.0, 0.0], [30.0, 20.0]], ",6"),
            words(&[[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0], [-50.0, -50.0]], ""),
            words(&[[10.0, 10.0], [15.0, 10.0], [15.0, 15.0], [10.0, 10.0]], ""),
        )
    };
    let set = MissionSet::read(&kml("relativeToGround"), "m.kml", None).unwrap();
    assert!(near(set.missions[0].waypoints[2].position, [30.0, 20.0, 6.0]));
    assert_eq!(
        (set.airspace.stay_inside.len(), set.airspace.prisms.len()),
        (1, 1),
        "a hole is stayed out of"
    );
    let error = MissionSet::read(&kml("absolute"), "m.kml", None).unwrap_err().to_string();
    assert!(error.starts_with("m.kml:3: field `Way: LineString`: expected an altitudeMode"), "{error}");
    let broken = MissionSet::read("<kml><Placemark></kml>", "m.kml", None).unwrap_err().to_string();
    assert!(broken.starts_with("m.kml:1:"), "{broken}");
}

mod round_trip {
    use proptest::prelude::*;
    use skein_planning::airspace::{Airspace, Area, StayInside};
    use skein_sim::mission::write::{Surroundings, to_plan};
    use skein_sim::mission::{Ends, Mission, Payload, Waypoint};

    use super::*;

    fn position() -> impl Strategy<Value = Vector3<f64>> {
        (-90.0..90.0, -90.0..90.0, 1.0..60.0).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    fn payload() -> impl Strategy<Value = Vec<Payload>> {
        let one = (prop_oneof![Just(206), Just(2000), Just(183)], 0.0..9.0, any::<bool>()).prop_map(
            |(command, first, none)| {
                let fourth = if none { f64::NAN } else { 4.0 };
                Payload { command, params: [first, 1.0, 0.0, fourth, 0.0, 0.0, 0.0] }
            },
        );
        prop::collection::vec(one, 0..3)
    }

    fn mission() -> impl Strategy<Value = Mission> {
        let speed = || prop_oneof![Just(1.5), Just(4.0)];
        let waypoint = (position(), prop_oneof![Just(0.0), 0.5..40.0], payload()).prop_map(
            |(position, hold_s, payload)| Waypoint { position, hold_s, payload, ..Waypoint::default() },
        );
        let legs = prop::collection::vec((waypoint, speed()), 1..8);
        (legs, any::<bool>(), 1.0..9.0, payload(), any::<bool>()).prop_map(
            |(legs, back, takeoff_m, last_payload, slows)| {
                let waypoints = legs
                    .into_iter()
                    .map(|(leg, speed)| Waypoint { speed_m_s: slows.then_some(speed), ..leg });
                Mission {
                    waypoints: waypoints.collect(),
                    ends: if back { Ends::Return } else { Ends::Land },
                    takeoff_height_m: Some(takeoff_m),
                    delay_s: if back { 3.0 } else { 0.0 },
                    last_payload,
                    ..Mission::default()
                }
            },
        )
    }

    fn airspace() -> impl Strategy<Value = Airspace> {
        (0_usize..3, any::<bool>()).prop_map(|(areas, each)| {
            let area = |index: usize| Area::round(nalgebra::Vector2::new(index as f64, 0.0), 400.0);
            let all: Vec<_> = (0..areas).map(area).collect();
            let stay_inside = match (areas, each) {
                (0, _) => Vec::new(),
                (1, _) | (_, false) => vec![StayInside { any_of: all }],
                _ => all.into_iter().map(|one| StayInside { any_of: vec![one] }).collect(),
            };
            Airspace { stay_inside, ..Airspace::default() }
        })
    }

    fn is_same(one: &Mission, other: &Mission) -> bool {
        let same_leg = |(a, b): (&Waypoint, &Waypoint)| {
            (a.position - b.position).norm() < 1e-5
                && (a.hold_s, a.speed_m_s) == (b.hold_s, b.speed_m_s)
                && a.payload == b.payload
        };
        one.waypoints.len() == other.waypoints.len()
            && one.waypoints.iter().zip(&other.waypoints).all(same_leg)
            && (one.ends, one.takeoff_height_m, one.delay_s)
                == (other.ends, other.takeoff_height_m, other.delay_s)
            && one.last_payload == other.last_payload
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_as_the_same(mission in mission(), airspace in airspace(), rally in prop::collection::vec(position(), 0..3)) {
            let around = Surroundings { datum: &HOME, airspace: &airspace, rally: &rally };
            let text = to_plan(&mission, &around).unwrap();
            let set = MissionSet::read(&text, "w.plan", Some(HOME)).unwrap();
            prop_assert!(is_same(&mission, &set.missions[0]), "{mission:?} became {:?}", set.missions[0]);
            prop_assert!(set.rally.iter().zip(&rally).all(|(one, other)| (one - other).norm() < 1e-5));
            prop_assert_eq!(set.rally.len(), rally.len());
            let shape = |airspace: &Airspace| airspace.stay_inside.iter().map(|zone| zone.any_of.len()).collect::<Vec<_>>();
            prop_assert_eq!(shape(&set.airspace), shape(&airspace));
            prop_assert!(set.warnings.is_empty());
        }
    }

    #[test]
    fn what_is_written_keeps_to_qgroundcontrols_rules() {
        let waypoint = Waypoint { position: Vector3::new(9.0, 0.0, 5.0), ..Waypoint::default() };
        let mission = Mission { waypoints: vec![waypoint], ..Mission::default() };
        let around = Surroundings { datum: &HOME, airspace: &Airspace::default(), rally: &[] };
        let plan: serde_json::Value = serde_json::from_str(&to_plan(&mission, &around).unwrap()).unwrap();
        assert_eq!((plan["fileType"].as_str(), plan["version"].as_u64()), (Some("Plan"), Some(1)));
        assert!(plan["groundStation"].is_string());
        let versions = ["mission", "geoFence", "rallyPoints"].map(|part| plan[part]["version"].as_u64());
        assert_eq!(versions, [Some(2); 3]);
        for field in ["firmwareType", "vehicleType", "cruiseSpeed", "hoverSpeed"] {
            assert!(plan["mission"][field].is_number(), "{field}");
        }
        assert_eq!(plan["mission"]["plannedHomePosition"].as_array().map(Vec::len), Some(3));
        for (number, item) in (1..).zip(plan["mission"]["items"].as_array().unwrap()) {
            assert_eq!(
                (item["type"].as_str(), item["doJumpId"].as_u64()),
                (Some("SimpleItem"), Some(number))
            );
            assert!(item["autoContinue"].is_boolean() && item["params"].as_array().unwrap().len() == 7);
            let in_place = item["frame"] == 3;
            assert_eq!(in_place, item.get("Altitude").is_some() && item["AltitudeMode"] == 1, "{item}");
        }
    }

    #[test]
    fn a_scenarios_routes_are_written_and_flown_again() -> Result<(), Box<dyn std::error::Error>> {
        let lines = [[10.0, 10.0, 5.0], [10.0, 50.0, 5.0], [20.0, 50.0, 5.0], [20.0, 10.0, 5.0]];
        let hold = item(16, 3, &format!("7, 0, 0, null, {}", at(&HOME, 5.0, 0.0, 5.0)));
        let text = rally(&plan(&HOME, &[takeoff(5.0), hold, survey(&lines), home()]), &[[0.0, 130.0, 5.0]]);
        let scenario = scenario(&text, 2, "")?;
        for vehicle in &scenario.vehicles {
            let mission = scenario.mission_of(vehicle);
            assert_eq!(mission.ends, Ends::Return);
            assert_eq!(mission.waypoints[0].hold_s, 7.0);
            let again = MissionSet::read(
                &to_plan(&mission, &scenario.surroundings())?,
                "w.plan",
                Some(*scenario.scene.datum()),
            )?;
            assert!(is_same(&mission, &again.missions[0]), "{mission:?} became {:?}", again.missions[0]);
        }
        Ok(())
    }
}

#[test]
fn the_samples_are_sound_and_flown() {
    let samples = concat!(env!("CARGO_MANIFEST_DIR"), "/samples");
    for (plan, vehicles, world) in [("inspection.plan", 2, Some("yard.csv")), ("field.plan", 3, None)] {
        let missions = vec![PathBuf::from(format!("{samples}/{plan}"))];
        let world = world.map(|world| PathBuf::from(format!("{samples}/{world}")));
        let overrides = Overrides { vehicles: Some(vehicles), missions, world, ..Overrides::default() };
        let scenario = Scenario::open("open", &overrides, 1).unwrap();
        let summary = Trial::new(&scenario, Controller::Bp).fly(&mut |_, _| {}).unwrap().summary;
        assert_eq!((summary.reason, summary.collisions.obstacle), (None, 0), "{plan}");
    }
}

#[test]
fn a_plan_is_flown_high_above_where_it_takes_off_and_no_higher_than_maps_reach() {
    let items = [takeoff(3.0), waypoint(20.0, 0.0, 60.0), waypoint(20.0, 20.0, 90.0), home()];
    let flown = fly(&plan(&HOME, &items), 1, "");
    assert_eq!(flown.summary.reason, None);
    assert!(flown.ways[0].iter().any(|at| at.z > 89.0));
    let error =
        scenario(&plan(&HOME, &[takeoff(3.0), waypoint(20.0, 0.0, 200.0)]), 1, "").expect_err("too high");
    assert!(error.to_string().starts_with("a mission goes 200 m above its home"), "{error}");
}

#[test]
fn altitude_zero_in_a_waypoint_file_keeps_the_height_before_it() {
    let text = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46.5\t7.25\t620\t1\n\
                1\t0\t3\t22\t0\t0\t0\t0\t46.5\t7.25\t12\t1\n\
                2\t0\t3\t16\t0\t0\t0\t0\t46.5001\t7.25\t0\t1\n\
                3\t0\t3\t16\t0\t0\t0\t0\t46.5002\t7.25\t30\t1\n\
                4\t0\t0\t82\t0\t0\t0\t0\t46.5003\t7.25\t0\t1\n";
    let set = read(text);
    let heights: Vec<f64> = set.missions[0].waypoints.iter().map(|w| w.position.z).collect();
    assert_eq!(heights, [12.0, 30.0, 30.0]);
    let told = set.warnings.iter().filter(|warning| warning.message.contains("keeps the height")).count();
    assert_eq!(told, 2);
    let below = text.replace("7.25\t30\t1", "7.25\t-3\t1");
    assert!(refusal(&below).contains("f.plan:5: field `column 11, parameter 7`"));
}
