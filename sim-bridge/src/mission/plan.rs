//! QGroundControl's `.plan`: the MAVLink mission items that move a multirotor.

use nalgebra::{Vector2, Vector3};
use skein_mav::{Datum, Geodetic};
use skein_planning::airspace::{Airspace, KeepOut, NoFlyPrism, NoFlyZone};

use super::json::Node;
use super::{Ends, Mission, MissionError, MissionSet, Warning, Waypoint};

/// Distance from the world's datum up to which a plan's home means that place, in metres.
const SAME_PLACE_M: f64 = 10_000.0;
/// A take-off item this near to home takes off from home, in metres.
const AT_HOME_M: f64 = 1.0;

/// `MAV_CMD`: what an item asks for. Numbers below 112 move the vehicle, those above switch something.
mod command {
    pub const WAYPOINT: u64 = 16;
    pub const LOITER_UNLIMITED: u64 = 17;
    pub const LOITER_TURNS: u64 = 18;
    pub const LOITER_TIME: u64 = 19;
    pub const RETURN_TO_LAUNCH: u64 = 20;
    pub const LAND: u64 = 21;
    pub const TAKEOFF: u64 = 22;
    pub const SPLINE_WAYPOINT: u64 = 82;
    pub const DELAY: u64 = 93;
    pub const FIRST_WITHOUT_MOTION: u64 = 112;
    pub const JUMP: u64 = 177;
    pub const CHANGE_SPEED: u64 = 178;
}

/// Warnings that are listed: to know the line of each takes a walk through the file.
const MOST_WARNINGS: usize = 100;

/// Reads the plan under `root`; see [`MissionSet::read`] for the `datum`.
pub fn read(root: &Node<'_>, datum: Option<Datum>) -> Result<MissionSet, MissionError> {
    let mission = root.member("mission")?;
    let mut reader = Reader::new(&mission.member("plannedHomePosition")?, datum)?;
    if let Some(fence) = root.optional("geoFence") {
        reader.geofence(&fence)?;
    }
    let zones = KeepOut::new(reader.airspace.clone(), 0.0, 0.0);
    let items = mission.member("items")?;
    for item in items.elements()? {
        let before = reader.mission.waypoints.len();
        reader.item(&item)?;
        reader.check_zones(&item, before, &zones)?;
    }
    if reader.mission.waypoints.is_empty() {
        return Err(items.error("at least one waypoint (command 16)", "none"));
    }
    if let Some(points) = root.optional("rallyPoints").and_then(|rally| rally.optional("points"))
        && !points.is_empty()
    {
        reader.warn(&points, "is not read");
    }
    Ok(MissionSet {
        missions: vec![reader.mission],
        warnings: reader.warnings,
        airspace: reader.airspace,
        datum: Some(reader.datum),
    })
}

struct Reader {
    datum: Datum,
    home: Geodetic,
    mission: Mission,
    speed_m_s: Option<f64>,
    /// A landing or a return has been read: nothing flies after it.
    ended: bool,
    /// The zones of the geofence.
    airspace: Airspace,
    warnings: Vec<Warning>,
}

impl Reader {
    fn new(home: &Node<'_>, known: Option<Datum>) -> Result<Self, MissionError> {
        let [latitude, longitude, height_m] = home.numbers::<3>()?;
        if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
            return Err(home.mismatch("[latitude, longitude, height] within 90 and 180 degrees"));
        }
        let at_home = Datum::from_degrees(latitude, longitude, height_m);
        let home = at_home.place();
        let near = |datum: &Datum| datum.to_enu(&home).xy().norm() <= SAME_PLACE_M;
        let datum = known.filter(near).unwrap_or(at_home);
        let ground = datum.to_enu(&home);
        let mission = Mission {
            home: Vector3::new(ground.x, ground.y, 0.0),
            waypoints: Vec::new(),
            ends: Ends::Land,
            takeoff_height_m: None,
            model: None,
            exact: false,
        };
        let (airspace, warnings) = (Airspace::default(), Vec::new());
        Ok(Self { datum, home, mission, speed_m_s: None, ended: false, airspace, warnings })
    }

    /// The circles and polygons that exclude; they have no heights. Those that include are not read: the scenario's
    /// bounds are the fence.
    fn geofence(&mut self, fence: &Node<'_>) -> Result<(), MissionError> {
        let (floor_m, ceiling_m) = (f64::NEG_INFINITY, f64::INFINITY);
        for list in ["circles", "polygons"] {
            let Some(list) = fence.optional(list) else { continue };
            for zone in list.elements()? {
                if zone.member("inclusion")?.truth()? {
                    self.warn(&zone, "a zone to stay inside of is not read");
                } else if let Some(circle) = zone.optional("circle") {
                    let centre = self.corner(&circle.member("center")?)?;
                    let radius = circle.member("radius")?;
                    let radius_m = radius.number_in(f64::MIN_POSITIVE, 1e6, "metres")?;
                    self.airspace.no_fly.push(NoFlyZone { centre, radius_m, floor_m, ceiling_m });
                } else {
                    let polygon = zone.member("polygon")?;
                    let corners = polygon.elements()?;
                    if corners.len() < 3 {
                        return Err(polygon.mismatch("three corners or more"));
                    }
                    let corners =
                        corners.iter().map(|corner| self.corner(corner)).collect::<Result<_, _>>()?;
                    self.airspace.prisms.push(NoFlyPrism { corners, floor_m, ceiling_m });
                }
            }
        }
        Ok(())
    }

    /// The place of a latitude and a longitude.
    fn corner(&self, node: &Node<'_>) -> Result<Vector2<f64>, MissionError> {
        let [latitude, longitude] = node.numbers::<2>()?;
        if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
            return Err(node.mismatch("[latitude, longitude] within 90 and 180 degrees"));
        }
        let place = Datum::from_degrees(latitude, longitude, self.home.height_m).place();
        Ok(self.datum.to_enu(&place).xy())
    }

    /// Refuses an item that leads into a zone; `before` is how many waypoints there were before it.
    fn check_zones(&self, item: &Node<'_>, before: usize, zones: &KeepOut) -> Result<(), MissionError> {
        let added = self.mission.waypoints.get(before..).unwrap_or_default();
        match added.iter().find(|waypoint| zones.room_m(&waypoint.position) < 0.0) {
            None => Ok(()),
            Some(Waypoint { position: at, .. }) => Err(item.error(
                "a place outside the zones that `geoFence` excludes",
                format!("one inside, {:.1} m east and {:.1} m north of the origin", at.x, at.y),
            )),
        }
    }

    fn item(&mut self, item: &Node<'_>) -> Result<(), MissionError> {
        let kind = item.member("type")?;
        if kind.text()? != "SimpleItem" {
            return Err(kind.mismatch("\"SimpleItem\" (surveys and structure scans are not flown)"));
        }
        let command_node = item.member("command")?;
        let command = command_node.whole_number()?;
        if self.ended && command < command::FIRST_WITHOUT_MOTION {
            self.warn(&command_node, "comes after the landing or return and is not flown");
            return Ok(());
        }
        match command {
            command::WAYPOINT => self.waypoint(item),
            command::SPLINE_WAYPOINT => {
                self.warn(&command_node, "a spline waypoint is flown as a plain one");
                self.waypoint(item)
            }
            command::LOITER_TIME => self.waypoint(item),
            command::LOITER_TURNS => {
                self.warn(&command_node, "loiter turns are flown as a waypoint");
                self.fly_to(item, 0.0)
            }
            command::LOITER_UNLIMITED => {
                self.warn(&command_node, "an unlimited loiter is flown as a waypoint with a landing");
                self.ended = true;
                self.fly_to(item, 0.0)
            }
            command::TAKEOFF => self.takeoff(item),
            command::LAND => self.land(item),
            command::RETURN_TO_LAUNCH => {
                self.mission.ends = Ends::Return;
                self.ended = true;
                Ok(())
            }
            command::DELAY => self.delay(item),
            command::CHANGE_SPEED => self.change_speed(item),
            command::JUMP => Err(command_node.mismatch("a command that goes forward; jumps are not flown")),
            0..command::FIRST_WITHOUT_MOTION => Err(command_node.mismatch(
                "a command that moves a multirotor: 16 waypoint, 17 to 19 loiter, 20 return, 21 land, 22 take-off",
            )),
            other => {
                self.warn(&command_node, format!("command {other} does not move the vehicle and is left out"));
                Ok(())
            }
        }
    }

    /// A waypoint, at which the first parameter says how long to stay.
    fn waypoint(&mut self, item: &Node<'_>) -> Result<(), MissionError> {
        let hold = parameter(item, 0)?;
        let hold_s = if hold.is_null() { 0.0 } else { hold.number_in(0.0, 86_400.0, "seconds")? };
        self.fly_to(item, hold_s)
    }

    fn fly_to(&mut self, item: &Node<'_>, hold_s: f64) -> Result<(), MissionError> {
        let place = self.place(item)?;
        let ground = place.ok_or_else(|| missing_place(item))?;
        let position = Vector3::new(ground.x, ground.y, self.height(item)?);
        self.push(position, hold_s);
        Ok(())
    }

    /// The place of the item's latitude and longitude (height 0); `None` where it gives none, which means "here".
    fn place(&self, item: &Node<'_>) -> Result<Option<Vector3<f64>>, MissionError> {
        let (latitude, longitude) = (parameter(item, 4)?, parameter(item, 5)?);
        if latitude.is_null() || longitude.is_null() {
            return Ok(None);
        }
        let latitude_deg = latitude.number_in(-90.0, 90.0, "degrees")?;
        let longitude_deg = longitude.number_in(-180.0, 180.0, "degrees")?;
        let place = Datum::from_degrees(latitude_deg, longitude_deg, self.home.height_m).place();
        let enu = self.datum.to_enu(&place);
        Ok(Some(Vector3::new(enu.x, enu.y, 0.0)))
    }

    /// Height above home, in metres. The ground is flat, so that a height above terrain is one above home.
    fn height(&self, item: &Node<'_>) -> Result<f64, MissionError> {
        let (frame, altitude) = (item.member("frame")?, parameter(item, 6)?);
        let height = match frame.whole_number()? {
            0 | 5 => altitude.number()? - self.home.height_m,
            3 | 6 | 10 | 11 => altitude.number()?,
            _ => return Err(frame.mismatch("0 (above sea level), 3 or 6 (above home) or 10 (above terrain)")),
        };
        if height > 0.0 {
            return Ok(height);
        }
        Err(altitude.mismatch("an altitude above home's ground"))
    }

    fn takeoff(&mut self, item: &Node<'_>) -> Result<(), MissionError> {
        let height = self.height(item)?;
        self.mission.takeoff_height_m.get_or_insert(height);
        if let Some(ground) = self.given_place(item)?
            && (ground - self.mission.home).xy().norm() > AT_HOME_M
        {
            self.push(Vector3::new(ground.x, ground.y, height), 0.0);
        }
        Ok(())
    }

    fn land(&mut self, item: &Node<'_>) -> Result<(), MissionError> {
        self.ended = true;
        let Some(ground) = self.given_place(item)? else { return Ok(()) };
        let last = self.mission.waypoints.last().map(|w| w.position.z);
        let Some(height) = last.or(self.mission.takeoff_height_m) else {
            return Err(item.error("a take-off or a waypoint before the landing", "none"));
        };
        self.push(Vector3::new(ground.x, ground.y, height), 0.0);
        Ok(())
    }

    /// The place of a take-off or landing, for which null and 0, 0 both mean "here".
    fn given_place(&self, item: &Node<'_>) -> Result<Option<Vector3<f64>>, MissionError> {
        let zero = |i: usize| -> Result<bool, MissionError> {
            let node = parameter(item, i)?;
            Ok(!node.is_null() && node.number()? == 0.0)
        };
        if zero(4)? && zero(5)? {
            return Ok(None);
        }
        self.place(item)
    }

    fn delay(&mut self, item: &Node<'_>) -> Result<(), MissionError> {
        let delay_s = parameter(item, 0)?.number_in(0.0, 86_400.0, "seconds")?;
        if let Some(last) = self.mission.waypoints.last_mut() {
            last.hold_s += delay_s;
        }
        Ok(())
    }

    fn change_speed(&mut self, item: &Node<'_>) -> Result<(), MissionError> {
        let speed = parameter(item, 1)?;
        // MAVLink: -1 means "as it is", -2 "as the autopilot likes".
        if !speed.is_null() && speed.number()? > 0.0 {
            self.speed_m_s = Some(speed.number()?);
        }
        Ok(())
    }

    fn push(&mut self, position: Vector3<f64>, hold_s: f64) {
        self.mission.waypoints.push(Waypoint { position, hold_s, speed_m_s: self.speed_m_s });
    }

    fn warn(&mut self, node: &Node<'_>, message: impl std::fmt::Display) {
        match self.warnings.len() {
            ..MOST_WARNINGS => self.warnings.push(node.warning(message)),
            MOST_WARNINGS => self.warnings.push(node.warning("from here on, warnings are not listed")),
            _ => {}
        }
    }
}

/// One of the seven parameters of an item.
fn parameter<'a>(item: &Node<'a>, index: usize) -> Result<Node<'a>, MissionError> {
    let parameters = item.member("params")?;
    let elements = parameters.elements()?;
    elements.into_iter().nth(index).ok_or_else(|| parameters.mismatch("7 parameters"))
}

fn missing_place(item: &Node<'_>) -> MissionError {
    match parameter(item, 4) {
        Ok(latitude) => latitude.error("a latitude and a longitude", "null"),
        Err(error) => error,
    }
}
