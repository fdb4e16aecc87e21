//! KML (OGC 12-007): its placemarks.

use roxmltree::{Document, Node};
use skein_mav::Datum;

use super::features::{self, Feature, Shape};
use super::{Account, Allowances, MissionError};

/// Geometries of a placemark.
const GEOMETRIES: [&str; 7] =
    ["Point", "LineString", "LinearRing", "Polygon", "Model", "Track", "MultiTrack"];

/// Whether a text is of markup.
pub fn is_markup(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}

/// Zones and routes of a document; see [`MissionSet::read`](super::MissionSet::read) for the `datum`.
pub fn read(
    text: &str,
    file: &str,
    datum: Option<Datum>,
    allowances: Allowances,
) -> Result<Account, MissionError> {
    let document = Document::parse(text).map_err(|error| {
        let (line, column) = (error.pos().row as usize, error.pos().col as usize);
        MissionError::Syntax { file: file.to_owned(), line, column, message: error.to_string() }
    })?;
    if document.root_element().tag_name().name() != "kml" {
        return Err(MissionError::Unknown { file: file.to_owned() });
    }
    let mut found = Vec::new();
    for placemark in document.descendants().filter(|node| is(node, "Placemark")) {
        let includes = data(&placemark, "inclusion").is_some_and(|flag| flag == "true" || flag == "1");
        let geometries = placemark.descendants().filter(|node| GEOMETRIES.iter().any(|name| is(node, name)));
        let is_outermost = |node: &Node<'_, '_>| !node.ancestors().skip(1).any(|above| is(&above, "Polygon"));
        for node in geometries.filter(is_outermost) {
            let line = document.text_pos_at(node.range().start).row as usize;
            let name = child(&placemark, "name").and_then(|name| name.text()).unwrap_or("Placemark");
            let what = format!("{}: {}", name.trim(), node.tag_name().name());
            found.push(Feature { what, line, shape: shape(&node), includes });
        }
    }
    Ok(features::read(found, file, datum, allowances))
}

fn is(node: &Node<'_, '_>, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

fn child<'a, 'i>(node: &Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| is(child, name))
}

/// The value of an `ExtendedData` field of that name.
fn data<'a>(placemark: &Node<'a, '_>, name: &str) -> Option<&'a str> {
    let mut fields = placemark.descendants().filter(|node| is(node, "Data") || is(node, "SimpleData"));
    let field = fields.find(|node| node.attribute("name") == Some(name))?;
    child(&field, "value").unwrap_or(field).text().map(str::trim)
}

fn shape(node: &Node<'_, '_>) -> Shape {
    match node.tag_name().name() {
        "LineString" => line(node),
        "Polygon" => {
            let rings = ["outerBoundaryIs", "innerBoundaryIs"].into_iter().flat_map(|boundary| {
                let boundaries = node.children().filter(move |child| is(child, boundary));
                boundaries.filter_map(|boundary| child(&boundary, "LinearRing"))
            });
            let ring = |ring: Node<'_, '_>| {
                let places = coordinates(&ring)?;
                Ok(places.into_iter().map(|(place, _)| place).collect())
            };
            match rings.map(ring).collect::<Result<Vec<_>, String>>() {
                Ok(rings) => Shape::polygon(rings),
                Err(found) => wrong(found),
            }
        }
        "Point" => Shape::Mark,
        other => Shape::Wrong("a Polygon, a LineString or a Point".to_owned(), other.to_owned()),
    }
}

fn line(node: &Node<'_, '_>) -> Shape {
    let mode = child(node, "altitudeMode").and_then(|mode| mode.text()).map_or("clampToGround", str::trim);
    let places = match coordinates(node) {
        Ok(places) => places,
        Err(found) => return wrong(found),
    };
    match mode {
        "relativeToGround" => Shape::line(places),
        "clampToGround" => Shape::line(places.into_iter().map(|(place, _)| (place, None)).collect()),
        mode => {
            Shape::Wrong("an altitudeMode of relativeToGround or clampToGround".to_owned(), mode.to_owned())
        }
    }
}

fn wrong(found: String) -> Shape {
    Shape::Wrong("coordinates `longitude,latitude` or `longitude,latitude,height`".to_owned(), found)
}

/// Longitude and latitude in degrees, and the height in metres where there is one.
type Coordinates = ([f64; 2], Option<f64>);

/// The coordinates of a line or ring; else the words at fault.
fn coordinates(node: &Node<'_, '_>) -> Result<Vec<Coordinates>, String> {
    let text = child(node, "coordinates").and_then(|node| node.text()).unwrap_or_default();
    let place = |words: &str| {
        let numbers: Option<Vec<f64>> = words.split(',').map(|word| word.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some([longitude, latitude]) => Ok(([*longitude, *latitude], None)),
            Some([longitude, latitude, height_m]) if height_m.is_finite() => {
                Ok(([*longitude, *latitude], Some(*height_m)))
            }
            _ => Err(words.to_owned()),
        }
    };
    text.split_whitespace().map(place).collect()
}
