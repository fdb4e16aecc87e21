//! QGroundControl's `.plan`: its mission, its geofence and its rally points.

use nalgebra::Vector2;
use skein_mav::Datum;
use skein_planning::airspace::{Area, StayInside};

use super::item::{Item, Origin};
use super::json::Node;
use super::route::Draft;
use super::structure_scan;
use super::{Account, Allowances, MissionError, command};
use crate::element::Verdict;

/// `MAV_AUTOPILOT` of ArduPilot, whose vehicles stay inside of every zone that includes; others of any.
const ARDUPILOT: f64 = 3.0;
/// Largest radius of a circle, in metres.
const WIDEST_M: f64 = 1e6;

/// Reads the plan under `root`; see [`MissionSet::read`](super::MissionSet::read) for the `datum`.
pub fn read(root: &Node<'_>, datum: Option<Datum>, allowances: Allowances) -> Result<Account, MissionError> {
    let mission = root.member("mission")?;
    check_version(root, 1)?;
    check_version(&mission, 2)?;
    let home = mission.member("plannedHomePosition")?;
    let mut draft = begin(&home, datum, allowances)?;
    let at_home = draft.element("mission.plannedHomePosition".to_owned(), home.line(), Verdict::Honoured, "");
    if let Some(fence) = root.optional("geoFence") {
        let every = mission.optional("firmwareType").and_then(|f| f.number().ok()) == Some(ARDUPILOT);
        geofence(&mut draft, &fence, every);
        draft.check_home(at_home, |expected| home.error(expected, "one where it does not"));
    }
    if let Some(points) = root.optional("rallyPoints").and_then(|rally| rally.optional("points")) {
        rally_points(&mut draft, &points)?;
    }
    let nodes = mission.member("items")?;
    let items = items(&mut draft, &nodes)?;
    draft.fly(&items);
    estimates(&mut draft, &mission);
    let (draft, flown) = draft.finish(|| nodes.error("at least one waypoint (command 16)", "none"));
    Ok(Account::of(draft, vec![flown]))
}

/// A newer version may mean other things.
fn check_version(node: &Node<'_>, newest: u64) -> Result<(), MissionError> {
    match node.optional("version") {
        Some(version) if version.whole_number()? > newest => {
            Err(version.mismatch(format!("a version of at most {newest}")))
        }
        _ => Ok(()),
    }
}

fn begin(home: &Node<'_>, datum: Option<Datum>, allowances: Allowances) -> Result<Draft, MissionError> {
    let places = home.elements()?;
    let [latitude, longitude, height] = &places[..] else {
        return Err(home.error("3 numbers", places.len().to_string()));
    };
    let height_m = if height.is_null() { None } else { Some(height.number()?) };
    let (latitude, longitude) = (latitude.number()?, longitude.number()?);
    if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
        return Err(home.mismatch("[latitude, longitude, height] within 90 and 180 degrees"));
    }
    Ok(Draft::new(latitude, longitude, height_m, datum, allowances))
}

/// Members that QGroundControl works out how long a flight takes from.
fn estimates(draft: &mut Draft, mission: &Node<'_>) {
    for name in ["cruiseSpeed", "hoverSpeed", "vehicleType"] {
        if let Some(member) = mission.optional(name) {
            const WHY: &str = "QGroundControl estimates the flight's time by it";
            draft.element(format!("mission.{name}"), member.line(), Verdict::Harmless, WHY);
        }
    }
}

/// The circles and polygons; they have no heights.
fn geofence(draft: &mut Draft, fence: &Node<'_>, every: bool) {
    let mut inside = Vec::new();
    for (name, member) in fence.members() {
        match name {
            "circles" | "polygons" => zones(draft, name, &member, &mut inside),
            "version" => {}
            "breachReturn" if !member.is_null() => {
                const WHY: &str = "a vehicle outside goes back to its home or the nearest rally point";
                draft.element("geoFence.breachReturn".to_owned(), member.line(), Verdict::Harmless, WHY);
                draft.warn(|| member.warning(WHY));
            }
            _ if member.is_null() || member.is_empty() => {}
            // Before there were several zones, the polygon was one to stay inside of.
            "polygon" => zone(draft, "geoFence.polygon".to_owned(), member.line(), |draft| {
                inside.push(Area::cornered(corners(draft, &member)?));
                Ok(())
            }),
            _ => {
                let element = draft.element(format!("geoFence.{name}"), member.line(), Verdict::Refused, "");
                draft.refuse(element, member.mismatch("`circles` and `polygons` alone"));
            }
        }
    }
    if every {
        draft.airspace.stay_inside.extend(inside.into_iter().map(|area| StayInside { any_of: vec![area] }));
    } else if !inside.is_empty() {
        draft.airspace.stay_inside.push(StayInside { any_of: inside });
    }
}

fn zones(draft: &mut Draft, name: &str, list: &Node<'_>, inside: &mut Vec<Area>) {
    let lines = list.element_lines();
    let count = match list.count() {
        Ok(count) => count,
        Err(error) => {
            let element = draft.element(format!("geoFence.{name}"), list.line(), Verdict::Refused, "");
            return draft.refuse(element, error);
        }
    };
    for (index, line) in lines.into_iter().enumerate().take(count) {
        let Some(node) = list.element(index).filter(|_| !draft.is_hopeless()) else { break };
        zone(draft, format!("geoFence.{name}[{index}]"), line, |draft| {
            let includes = node.member("inclusion")?.truth()?;
            let area = area(draft, &node)?;
            match area {
                area if includes => inside.push(area),
                Area::Round(zone) => draft.airspace.no_fly.push(zone),
                Area::Cornered(zone) => draft.airspace.prisms.push(zone),
            }
            Ok(())
        });
    }
}

fn zone(
    draft: &mut Draft,
    what: String,
    line: usize,
    read: impl FnOnce(&mut Draft) -> Result<(), MissionError>,
) {
    let element = draft.element(what, line, Verdict::Honoured, "");
    if let Err(error) = read(draft) {
        draft.refuse(element, error);
    }
}

fn area(draft: &Draft, node: &Node<'_>) -> Result<Area, MissionError> {
    if let Some(circle) = node.optional("circle") {
        let centre = corner(draft, &circle.member("center")?)?;
        let radius_m = circle.member("radius")?.number_in(f64::MIN_POSITIVE, WIDEST_M, "metres")?;
        return Ok(Area::round(centre, radius_m));
    }
    Ok(Area::cornered(corners(draft, &node.member("polygon")?)?))
}

fn corners(draft: &Draft, polygon: &Node<'_>) -> Result<Vec<Vector2<f64>>, MissionError> {
    let corners = polygon.elements()?;
    if corners.len() < 3 {
        return Err(polygon.mismatch("three corners or more"));
    }
    corners.iter().map(|node| corner(draft, node)).collect()
}

/// The place of a latitude and a longitude.
fn corner(draft: &Draft, node: &Node<'_>) -> Result<Vector2<f64>, MissionError> {
    let [latitude, longitude] = node.numbers::<2>()?;
    if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
        return Err(node.mismatch("[latitude, longitude] within 90 and 180 degrees"));
    }
    Ok(draft.ground(latitude, longitude).xy())
}

/// Rally points: latitude, longitude, and height above home.
fn rally_points(draft: &mut Draft, points: &Node<'_>) -> Result<(), MissionError> {
    let lines = points.element_lines();
    for (index, line) in lines.into_iter().enumerate().take(points.count()?) {
        let Some(point) = points.element(index).filter(|_| !draft.is_hopeless()) else { break };
        zone(draft, format!("rallyPoints.points[{index}]"), line, |draft| {
            let [latitude, longitude, height_m] = point.numbers::<3>()?;
            if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
                return Err(point.mismatch("[latitude, longitude, height] within 90 and 180 degrees"));
            }
            let ground = draft.ground(latitude, longitude);
            draft
                .add_rally_point(ground.xy().push(height_m))
                .map_err(|expected| point.error(expected, "one elsewhere"))
        });
    }
    Ok(())
}

/// The items of the mission, those of surveys and scans among them.
fn items<'a>(draft: &mut Draft, nodes: &Node<'a>) -> Result<Vec<Item<'a>>, MissionError> {
    let lines = nodes.element_lines();
    let (mut items, mut scans) = (Vec::new(), 0);
    for (index, line) in lines.into_iter().enumerate().take(nodes.count()?) {
        let Some(node) = nodes.element(index).filter(|_| !draft.is_hopeless()) else { break };
        let element = draft.element(format!("mission.items[{index}]"), line, Verdict::Harmless, "");
        let number = items.len() as u64 + 1;
        let kind = match node.member("type").and_then(|kind| kind.text().map(|text| (kind, text))) {
            Ok(kind) => kind,
            Err(error) => {
                draft.refuse(element, error);
                continue;
            }
        };
        match kind {
            (_, "SimpleItem") => match simple(&node, number, element, None) {
                Ok(item) => {
                    draft.elements[element].what.push_str(&format!(": {}", command::in_words(item.command)));
                    items.push(item);
                }
                Err(error) => draft.refuse(element, error),
            },
            (_, "ComplexItem") => {
                scans += 1;
                let kind =
                    node.optional("complexItemType").and_then(|kind| kind.text().ok()).unwrap_or_default();
                draft.elements[element].what.push_str(&format!(": {kind}"));
                match complex(&node, kind, number, element, scans) {
                    Ok(inner) => items.extend(inner),
                    Err(error) => draft.refuse(element, error),
                }
            }
            (kind, _) => draft.refuse(element, kind.mismatch("\"SimpleItem\" or \"ComplexItem\"")),
        }
    }
    Ok(items)
}

/// The items that a survey or a scan is flown as.
fn complex<'a>(
    node: &Node<'a>,
    kind: &str,
    first: u64,
    element: usize,
    scan: usize,
) -> Result<Vec<Item<'a>>, MissionError> {
    let transects = node.optional("TransectStyleComplexItem");
    let stored =
        transects.and_then(|transects| transects.optional("Items")).or_else(|| node.optional("Items"));
    match (kind, stored) {
        ("survey" | "CorridorScan" | "StructureScan", Some(stored)) => {
            let numbered = (first..).zip(stored.elements()?);
            numbered.map(|(number, inner)| simple(&inner, number, element, Some(scan))).collect()
        }
        ("StructureScan", None) => structure_scan::items(node, first, element, scan),
        ("survey" | "CorridorScan", None) => {
            let expected = "a member `TransectStyleComplexItem.Items` with the lines; save the plan anew with \
                            QGroundControl 4";
            Err(node.error(expected, "none"))
        }
        _ => {
            let kind = node.optional("complexItemType").unwrap_or_else(|| node.clone());
            Err(kind.mismatch("\"survey\", \"CorridorScan\" or \"StructureScan\""))
        }
    }
}

fn simple<'a>(
    node: &Node<'a>,
    number: u64,
    element: usize,
    scan: Option<usize>,
) -> Result<Item<'a>, MissionError> {
    let command = node.member("command")?.whole_number()?;
    let params = parameters(node)?;
    let frame = node.member("frame")?.whole_number()?;
    let given = node.optional("doJumpId").and_then(|number| number.whole_number().ok());
    // QGroundControl's `CalcAboveTerrain`.
    let mode = node.optional("AltitudeMode").and_then(|mode| mode.number().ok());
    Ok(Item {
        origin: Origin::Json(node.clone()),
        command,
        frame,
        params,
        number: given.unwrap_or(number),
        element,
        scan,
        follows_terrain: mode == Some(3.0),
    })
}

/// The seven parameters; in files of former years the last three are a member of their own.
fn parameters(node: &Node<'_>) -> Result<[f64; 7], MissionError> {
    let params = node.member("params")?;
    let mut nodes = params.elements()?;
    if let (4, Some(place)) = (nodes.len(), node.optional("coordinate")) {
        nodes.extend(place.elements()?);
    }
    if nodes.len() != 7 {
        return Err(params.mismatch("7 parameters"));
    }
    let mut values = [f64::NAN; 7];
    for (value, node) in values.iter_mut().zip(nodes) {
        if !node.is_null() {
            *value = node.number()?;
        }
    }
    Ok(values)
}
