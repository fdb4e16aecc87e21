//! Missions and zones as a `.plan` that QGroundControl opens.

use nalgebra::{Vector2, Vector3};
use serde_json::{Value, json};
use skein_mav::Datum;
use skein_planning::airspace::{Airspace, Area, StayInside};
use thiserror::Error;

use super::command::{CHANGE_SPEED, DELAY, LAND, RETURN_TO_LAUNCH, TAKEOFF, WAYPOINT};
use super::{Ends, Mission, Payload};

/// `MAV_FRAME_MISSION`, of what has no place, and `MAV_FRAME_GLOBAL_RELATIVE_ALT`.
const NO_FRAME: u64 = 2;
const ABOVE_HOME: u64 = 3;
/// `MAV_AUTOPILOT` of PX4, whose vehicles stay inside of any zone that includes, and of ArduPilot: of each.
const PX4: u64 = 12;
const ARDUPILOT: u64 = 3;
/// Take-off height where a mission names none, in metres.
const TAKEOFF_HEIGHT_M: f64 = 3.0;
/// Speeds by which QGroundControl estimates the time of a flight, in m/s.
const ESTIMATED_M_S: f64 = 5.0;

/// Where on earth a mission is flown, within what, and where else it may land.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    pub datum: &'a Datum,
    pub airspace: &'a Airspace,
    /// ENU, metres.
    pub rally: &'a [Vector3<f64>],
}

/// Parts that a plan cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum WriteError {
    #[error("a plan holds no terrain: expected an airspace without mountains and heights of the ground")]
    Terrain,
    #[error("a plan holds no zone that ends at a height: expected zones for all heights")]
    Heights,
    #[error(
        "a plan holds areas to stay inside of, any one of them or all: expected either, and not both mixed"
    )]
    Mixed,
}

/// The text of a plan.
///
/// # Errors
/// Parts of the surroundings that a plan cannot hold.
pub fn to_plan(mission: &Mission, around: &Surroundings<'_>) -> Result<String, WriteError> {
    if !around.airspace.mountains.is_empty() || around.airspace.heights.is_some() {
        return Err(WriteError::Terrain);
    }
    let (inside, firmware) = inside(&around.airspace.stay_inside)?;
    let writer = Writer { datum: around.datum };
    let home = around.datum.to_geodetic(&mission.home);
    let rally: Vec<_> = around.rally.iter().map(|point| writer.rally_point(point)).collect();
    let plan = json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": firmware,
            "vehicleType": 2,
            "globalPlanAltitudeMode": 1,
            "cruiseSpeed": ESTIMATED_M_S,
            "hoverSpeed": ESTIMATED_M_S,
            "plannedHomePosition": [home.latitude_rad.to_degrees(), home.longitude_rad.to_degrees(), home.height_m],
            "items": writer.items(mission),
        },
        "geoFence": writer.fence(around.airspace, inside)?,
        "rallyPoints": { "version": 2, "points": rally },
    });
    Ok(format!("{plan:#}\n"))
}

/// The areas to stay inside of, and the autopilot whose rule for several of them is meant.
fn inside(zones: &[StayInside]) -> Result<(Vec<&Area>, u64), WriteError> {
    let areas = zones.iter().flat_map(|zone| &zone.any_of).collect();
    match zones {
        [] | [_] => Ok((areas, PX4)),
        _ if zones.iter().all(|zone| zone.any_of.len() == 1) => Ok((areas, ARDUPILOT)),
        _ => Err(WriteError::Mixed),
    }
}

struct Writer<'a> {
    datum: &'a Datum,
}

impl Writer<'_> {
    fn items(&self, mission: &Mission) -> Vec<Value> {
        let mut items = Vec::new();
        let takeoff_m = mission.takeoff_height_m.unwrap_or(TAKEOFF_HEIGHT_M);
        self.fly_to(&mut items, TAKEOFF, &mission.home.xy().push(takeoff_m), 0.0);
        if mission.delay_s > 0.0 {
            order(&mut items, DELAY, [mission.delay_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
        let mut speed_m_s = None;
        for waypoint in &mission.waypoints {
            if let Some(wanted_m_s) = waypoint.speed_m_s.filter(|_| waypoint.speed_m_s != speed_m_s) {
                speed_m_s = Some(wanted_m_s);
                order(&mut items, CHANGE_SPEED, [1.0, wanted_m_s, -1.0, 0.0, 0.0, 0.0, 0.0]);
            }
            tell(&mut items, &waypoint.payload);
            self.fly_to(&mut items, WAYPOINT, &waypoint.position, waypoint.hold_s);
        }
        tell(&mut items, &mission.last_payload);
        match (mission.ends, mission.waypoints.last()) {
            (Ends::Land, Some(last)) => self.fly_to(&mut items, LAND, &last.position.xy().push(0.0), 0.0),
            _ => order(&mut items, RETURN_TO_LAUNCH, [0.0; 7]),
        }
        items
    }

    fn fly_to(&self, items: &mut Vec<Value>, command: u64, place: &Vector3<f64>, hold_s: f64) {
        let [latitude, longitude] = self.degrees(&place.xy());
        let mut item =
            item(items, command, ABOVE_HOME, [hold_s, 0.0, 0.0, f64::NAN, latitude, longitude, place.z]);
        item["Altitude"] = json!(place.z);
        item["AltitudeMode"] = json!(1);
        item["AMSLAltAboveTerrain"] = Value::Null;
        items.push(item);
    }

    fn fence(&self, airspace: &Airspace, inside: Vec<&Area>) -> Result<Value, WriteError> {
        let (mut circles, mut polygons) = (Vec::new(), Vec::new());
        let mut add = |area: &Area, inclusion: bool| {
            let (floor_m, ceiling_m) = match area {
                Area::Round(zone) => (zone.floor_m, zone.ceiling_m),
                Area::Cornered(zone) => (zone.floor_m, zone.ceiling_m),
            };
            if floor_m.is_finite() || ceiling_m.is_finite() {
                return Err(WriteError::Heights);
            }
            match area {
                Area::Round(zone) => circles.push(json!({
                    "circle": { "center": self.degrees(&zone.centre), "radius": zone.radius_m },
                    "inclusion": inclusion,
                    "version": 1,
                })),
                Area::Cornered(zone) => polygons.push(json!({
                    "polygon": zone.corners.iter().map(|corner| self.degrees(corner)).collect::<Vec<_>>(),
                    "inclusion": inclusion,
                    "version": 1,
                })),
            }
            Ok(())
        };
        inside.into_iter().try_for_each(|area| add(area, true))?;
        airspace.no_fly.iter().try_for_each(|zone| add(&Area::Round(*zone), false))?;
        airspace.prisms.iter().try_for_each(|zone| add(&Area::Cornered(zone.clone()), false))?;
        // A dome is kept out of at all heights, which is more than it asks.
        airspace.threats.iter().try_for_each(|dome| add(&Area::round(dome.centre, dome.radius_m), false))?;
        Ok(json!({ "version": 2, "circles": circles, "polygons": polygons }))
    }

    fn rally_point(&self, point: &Vector3<f64>) -> Value {
        let [latitude, longitude] = self.degrees(&point.xy());
        json!([latitude, longitude, point.z])
    }

    /// Latitude and longitude of a place.
    fn degrees(&self, place: &Vector2<f64>) -> [f64; 2] {
        let place = self.datum.to_geodetic(&place.push(0.0));
        [place.latitude_rad.to_degrees(), place.longitude_rad.to_degrees()]
    }
}

fn tell(items: &mut Vec<Value>, payload: &[Payload]) {
    for one in payload {
        order(items, one.command, one.params);
    }
}

fn order(items: &mut Vec<Value>, command: u64, params: [f64; 7]) {
    items.push(item(items, command, NO_FRAME, params));
}

/// What is no number becomes null.
fn item(before: &[Value], command: u64, frame: u64, params: [f64; 7]) -> Value {
    json!({
        "type": "SimpleItem",
        "autoContinue": true,
        "command": command,
        "doJumpId": before.len() + 1,
        "frame": frame,
        "params": params,
    })
}

#[cfg(test)]
mod tests {
    use skein_planning::airspace::{NoFlyPrism, NoFlyZone, ThreatZone};

    use super::*;

    fn written(airspace: Airspace) -> Result<String, WriteError> {
        let datum = Datum::from_degrees(47.4, 8.5, 400.0);
        let around = Surroundings { datum: &datum, airspace: &airspace, rally: &[] };
        to_plan(&Mission::default(), &around)
    }

    #[test]
    fn what_a_plan_cannot_hold_is_said() {
        let (centre, radius_m) = (Vector2::new(9.0, 0.0), 3.0);
        let low = NoFlyZone { centre, radius_m, floor_m: f64::NEG_INFINITY, ceiling_m: 9.0 };
        assert_eq!(written(Airspace { no_fly: vec![low], ..Airspace::default() }), Err(WriteError::Heights));
        let corners = vec![Vector2::zeros(); 3];
        let high = NoFlyPrism { corners, floor_m: 2.0, ceiling_m: f64::INFINITY };
        assert_eq!(written(Airspace { prisms: vec![high], ..Airspace::default() }), Err(WriteError::Heights));
        let two = || StayInside { any_of: vec![Area::round(centre, radius_m), Area::round(centre, 2.0)] };
        let stay_inside = vec![two(), two()];
        assert_eq!(written(Airspace { stay_inside, ..Airspace::default() }), Err(WriteError::Mixed));
        let threats = vec![ThreatZone { centre, radius_m }];
        assert!(written(Airspace { threats, ..Airspace::default() }).unwrap().contains("\"radius\": 3.0"));
    }
}
