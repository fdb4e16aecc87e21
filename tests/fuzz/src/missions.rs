//! Missions: plans of QGroundControl, `QGC WPL 110` files, KML, GeoJSON, and missions of LSC.

use skein_mav::Datum;
use skein_sim::mission::write::{Surroundings, to_plan};
use skein_sim::mission::{Account, Allowances, MissionSet};

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "missions", allowed: Allowed { bytes: 8 << 20, per_byte: 500 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    let datum = Datum::from_degrees(47.4, 8.5, 488.0);
    let Ok(set) = MissionSet::read(text, "fuzzed.plan", Some(datum)) else { return Reached::Refused };
    for mission in &set.missions {
        let places = mission.waypoints.iter().map(|waypoint| waypoint.position).chain([mission.home]);
        places.for_each(|place| assert!(place.iter().all(|part| part.is_finite()), "{place:?}"));
        assert!(mission.waypoints.iter().all(|waypoint| waypoint.hold_s.is_finite()));
    }
    write_again(&set);
    Reached::read(set.missions.iter().any(|mission| mission.waypoints.len() == 5))
}

/// What is written of a mission is read as a mission again, unless a plan cannot hold what is around it.
fn write_again(set: &MissionSet) {
    let Some(datum) = &set.datum else { return };
    let around = Surroundings { datum, airspace: &set.airspace, rally: &set.rally };
    for mission in &set.missions {
        let Ok(text) = to_plan(mission, &around) else { continue };
        let allowances = Allowances { long_legs: true, mixed_heights: true };
        let again =
            Account::read(&text, "again.plan", Some(*datum), allowances).and_then(|account| account.set);
        if let Ok(again) = again {
            assert_eq!(again.missions[0].waypoints.len(), mission.waypoints.len());
        }
    }
}

const PLAN: &str = r#"{"fileType": "Plan", "mission": {"plannedHomePosition": [47.4, 8.5, 488],
"hoverSpeed": 5, "cruiseSpeed": 15, "items": [
{"type": "SimpleItem", "command": 22, "frame": 3, "params": [0, 0, 0, null, 47.4, 8.5, 4]},
{"type": "SimpleItem", "command": 178, "frame": 2, "params": [1, 2.5, -1, 0, 0, 0, 0]},
{"type": "SimpleItem", "command": 16, "frame": 3, "params": [3, 0, 0, null, 47.4001, 8.5002, 5]},
{"type": "SimpleItem", "command": 19, "frame": 0, "params": [2, 0, 0, null, 47.4002, 8.5001, 494]},
{"type": "SimpleItem", "command": 21, "frame": 3, "params": [0, 0, 0, null, 47.4002, 8.5, 0]}]},
"geoFence": {"circles": [{"circle": {"center": [47.401, 8.501], "radius": 20}, "inclusion": false}],
"polygons": [{"polygon": [[47.402, 8.5], [47.402, 8.501], [47.403, 8.5]], "inclusion": false}], "version": 2},
"rallyPoints": {"points": []}}
"#;

const SCANS: &str = r#"{"fileType": "Plan", "version": 1, "mission": {"version": 2, "firmwareType": 3,
"plannedHomePosition": [47.4, 8.5, null], "items": [
{"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": [
{"type": "SimpleItem", "command": 16, "doJumpId": 1, "frame": 3, "params": [0, 0, 0, null, 47.4001, 8.5002, 5]},
{"type": "SimpleItem", "command": 206, "doJumpId": 2, "frame": 2, "params": [6, 0, 1, 0, 0, 0, 0]}]}},
{"type": "ComplexItem", "complexItemType": "StructureScan", "EntranceAltitude": 9, "ScanBottomAlt": 2, "StructureHeight": 4,
"StartFromTop": true, "Layers": 1, "CameraCalc": {"DistanceToSurface": 3, "AdjustedFootprintFrontal": 2},
"polygon": [[47.4003, 8.5], [47.4003, 8.5001], [47.4004, 8.5]]},
{"type": "SimpleItem", "command": 18, "doJumpId": 9, "frame": 3, "params": [1, 0, 4, null, 0, 0, 5]},
{"type": "SimpleItem", "command": 177, "doJumpId": 10, "frame": 2, "params": [9, 1, 0, 0, 0, 0, 0]},
{"type": "SimpleItem", "command": 20, "doJumpId": 11, "frame": 2, "params": [0, 0, 0, 0, 0, 0, 0]}]},
"geoFence": {"circles": [{"circle": {"center": [47.4, 8.5], "radius": 500}, "inclusion": true}], "polygons": []},
"rallyPoints": {"points": [[47.4001, 8.5, 5]]}}
"#;

const WAYPOINTS: &str = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.5\t488\t1\n\
1\t0\t3\t16\t2\t0\t0\t0\t47.4001\t8.5002\t5\t1\n2\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1\n";

const KML: &str = r#"<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><name>Way</name><LineString>
<altitudeMode>relativeToGround</altitudeMode><coordinates>8.5,47.4,6 8.5002,47.4001,6</coordinates></LineString></Placemark>
<Placemark><ExtendedData><Data name="inclusion"><value>true</value></Data></ExtendedData><Polygon><outerBoundaryIs>
<LinearRing><coordinates>8.49,47.39 8.51,47.39 8.5,47.41 8.49,47.39</coordinates></LinearRing></outerBoundaryIs></Polygon>
</Placemark></Document></kml>
"#;

const GEOJSON: &str = r#"{"type": "FeatureCollection", "features": [
{"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [[8.5, 47.4], [8.5002, 47.4001]]}},
{"type": "Feature", "properties": {"inclusion": false}, "geometry": {"type": "Polygon", "coordinates":
[[[8.501, 47.401], [8.502, 47.401], [8.501, 47.402], [8.501, 47.401]]]}}]}
"#;

const LSC: &str = r#"{"quadrotors": {"small": {"radius": 0.15, "max_vel": [1, 1, 1], "max_acc": [2, 2, 2], "downwash": 2}},
"world": [{"dimension": [-5, -5, 0, 5, 5, 3]}], # metres
"agents": [{"type": "small", "start": [0, 0, 1], "goal": [4, 0, 1]}, {"type": "small", "start": [4, 1, 1], "goal": [0, 1, 1]}]}
"#;

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("plan", PLAN.into()),
        ("scans", SCANS.into()),
        ("waypoints", WAYPOINTS.into()),
        ("kml", KML.into()),
        ("geojson", GEOJSON.into()),
        ("lsc", LSC.into()),
    ]
}
