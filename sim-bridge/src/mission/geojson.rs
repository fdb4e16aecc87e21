//! GeoJSON (RFC 7946).

use skein_mav::Datum;

use super::features::{self, Feature, Shape};
use super::json::Node;
use super::{Account, Allowances, MissionError};

/// Types of which a file's outermost value is one.
const TYPES: [&str; 9] = [
    "FeatureCollection",
    "Feature",
    "Point",
    "MultiPoint",
    "LineString",
    "MultiLineString",
    "Polygon",
    "MultiPolygon",
    "GeometryCollection",
];
/// `altitudeMode` of heights above the ground, as in KML.
const ABOVE_GROUND: &str = "relativeToGround";
/// Geometries within geometries, at most.
const DEEPEST: usize = 8;

/// Whether a document is GeoJSON.
pub fn is_geojson(root: &Node<'_>) -> bool {
    root.optional("type").and_then(|kind| kind.text().ok()).is_some_and(|kind| TYPES.contains(&kind))
}

/// Zones and routes of a document; see [`MissionSet::read`](super::MissionSet::read) for the `datum`.
pub fn read(root: &Node<'_>, datum: Option<Datum>, allowances: Allowances) -> Result<Account, MissionError> {
    let mut found = Vec::new();
    match root.optional("features") {
        Some(list) => {
            let lines = list.element_lines();
            for ((index, node), line) in list.elements()?.iter().enumerate().zip(lines) {
                feature(node, &format!("features[{index}]"), line, &mut found)?;
            }
        }
        None => feature(root, "feature", 1, &mut found)?,
    }
    Ok(features::read(found, root.file(), datum, allowances))
}

/// What a feature's properties say.
#[derive(Clone, Copy)]
struct Said {
    includes: bool,
    above_ground: bool,
}

fn feature(node: &Node<'_>, what: &str, line: usize, found: &mut Vec<Feature>) -> Result<(), MissionError> {
    let property = |name| node.optional("properties").and_then(|properties| properties.optional(name));
    let said = Said {
        includes: property("inclusion").map(|flag| flag.truth()).transpose()?.unwrap_or(false),
        above_ground: property("altitudeMode").and_then(|mode| mode.text().ok()) == Some(ABOVE_GROUND),
    };
    match node.optional("geometry") {
        Some(geometry) => add(&geometry, what, line, said, DEEPEST, found),
        None => add(node, what, line, said, DEEPEST, found),
    }
}

fn add(
    node: &Node<'_>,
    what: &str,
    line: usize,
    said: Said,
    depth: usize,
    found: &mut Vec<Feature>,
) -> Result<(), MissionError> {
    let kind = node.member("type")?;
    let name = kind.text()?;
    if let ("GeometryCollection", Some(below)) = (name, depth.checked_sub(1)) {
        let inner = node.member("geometries")?.elements()?;
        return inner.iter().try_for_each(|geometry| add(geometry, what, line, said, below, found));
    }
    let coordinates = || node.member("coordinates");
    let shapes = match name {
        "Point" | "MultiPoint" => vec![Shape::Mark],
        "LineString" => vec![route(&coordinates()?, said)?],
        "MultiLineString" => {
            coordinates()?.elements()?.iter().map(|line| route(line, said)).collect::<Result<_, _>>()?
        }
        "Polygon" => vec![polygon(&coordinates()?)?],
        "MultiPolygon" => coordinates()?.elements()?.iter().map(polygon).collect::<Result<_, _>>()?,
        _ => return Err(kind.mismatch("a geometry: a Polygon, a LineString, several of them, or a Point")),
    };
    let includes = said.includes;
    found.extend(shapes.into_iter().map(|shape| {
        let what = format!("{what}: {name}");
        Feature { what, line, shape, includes }
    }));
    Ok(())
}

fn route(list: &Node<'_>, said: Said) -> Result<Shape, MissionError> {
    let mut places = Vec::new();
    for node in list.elements()? {
        let (place, height_m) = place(&node)?;
        match height_m.filter(|height_m| *height_m != 0.0) {
            Some(height_m) if !said.above_ground => {
                let expected = "a property `altitudeMode` that is `relativeToGround`, or no heights: those of GeoJSON \
                                count from an ellipsoid";
                return Ok(Shape::Wrong(expected.to_owned(), format!("a height of {height_m} m")));
            }
            height_m => places.push((place, height_m)),
        }
    }
    Ok(Shape::line(places))
}

fn polygon(list: &Node<'_>) -> Result<Shape, MissionError> {
    let ring = |node: &Node<'_>| {
        node.elements()?.iter().map(|node| place(node).map(|(place, _)| place)).collect::<Result<Vec<_>, _>>()
    };
    Ok(Shape::polygon(list.elements()?.iter().map(ring).collect::<Result<_, _>>()?))
}

fn place(node: &Node<'_>) -> Result<([f64; 2], Option<f64>), MissionError> {
    let numbers = node.elements()?.iter().map(Node::number).collect::<Result<Vec<_>, _>>()?;
    match numbers[..] {
        [longitude, latitude] => Ok(([longitude, latitude], None)),
        [longitude, latitude, height_m, ..] => Ok(([longitude, latitude], Some(height_m))),
        _ => Err(node.mismatch("[longitude, latitude] or [longitude, latitude, height]")),
    }
}
