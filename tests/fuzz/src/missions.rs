//! Missions: plans of QGroundControl, and those of LSC.

use skein_mav::Datum;
use skein_sim::mission::MissionSet;

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "missions", allowed: Allowed { bytes: 16 << 10, per_byte: 300 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    let datum = Datum::from_degrees(47.4, 8.5, 488.0);
    let Ok(set) = MissionSet::read(text, "fuzzed.plan", Some(datum)) else { return Reached::Refused };
    for mission in &set.missions {
        let places = mission.waypoints.iter().map(|waypoint| waypoint.position).chain([mission.home]);
        places.for_each(|place| assert!(place.iter().all(|part| part.is_finite()), "{place:?}"));
        assert!(mission.waypoints.iter().all(|waypoint| waypoint.hold_s.is_finite()));
    }
    Reached::read(set.missions.iter().any(|mission| mission.waypoints.len() == 5))
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

const LSC: &str = r#"{"quadrotors": {"small": {"radius": 0.15, "max_vel": [1, 1, 1], "max_acc": [2, 2, 2], "downwash": 2}},
"world": [{"dimension": [-5, -5, 0, 5, 5, 3]}], # metres
"agents": [{"type": "small", "start": [0, 0, 1], "goal": [4, 0, 1]}, {"type": "small", "start": [4, 1, 1], "goal": [0, 1, 1]}]}
"#;

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    vec![("plan", PLAN.into()), ("lsc", LSC.into())]
}
