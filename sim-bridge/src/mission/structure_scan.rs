//! QGroundControl's structure scan: level rounds of a structure, one above another. Plans hold its sizes, and
//! not the waypoints.

use nalgebra::{Vector2, Vector3};
use skein_mav::Datum;

use super::MissionError;
use super::command::WAYPOINT;
use super::item::{Item, Origin};
use super::json::Node;

const MOST_LAYERS: f64 = 1000.0;
/// `MAV_FRAME_GLOBAL_RELATIVE_ALT`.
const ABOVE_HOME: u64 = 3;

/// The waypoints of a scan: from its entrance, layer by layer around, and back.
pub fn items<'a>(
    node: &Node<'a>,
    first: u64,
    element: usize,
    scan: usize,
) -> Result<Vec<Item<'a>>, MissionError> {
    let number = |name| node.member(name)?.number_in(0.0, 1e4, "metres");
    let camera = node.member("CameraCalc")?;
    let away_m = camera.member("DistanceToSurface")?.number_in(0.0, 1e4, "metres")?;
    let layer_m = camera.member("AdjustedFootprintFrontal")?.number_in(0.0, 1e4, "metres")?;
    let layers = node.member("Layers")?.number_in(1.0, MOST_LAYERS, "layers")? as u32;
    let (entrance_m, bottom_m) = (number("EntranceAltitude")?, number("ScanBottomAlt")?);
    let top_m = bottom_m + number("StructureHeight")?;
    let from_top = node.optional("StartFromTop").map(|flag| flag.truth()).transpose()?.unwrap_or(false);
    let (datum, around) = rounds(&node.member("polygon")?, away_m)?;
    let height = |layer: u32| {
        let off_m = layer_m * (f64::from(layer) + 0.5);
        if from_top { top_m - off_m } else { bottom_m + off_m }
    };
    let entrance = around.first().map(|corner| corner.push(entrance_m));
    let rounds = (0..layers)
        .flat_map(|layer| around.iter().chain(around.first()).map(move |corner| corner.push(height(layer))));
    let places = entrance.into_iter().chain(rounds).chain(entrance);
    Ok(places.zip(first..).map(|(place, number)| item(node, &datum, &place, number, element, scan)).collect())
}

/// The corners of a round this far outside of a structure, metres, and where on earth they count from.
fn rounds(polygon: &Node<'_>, away_m: f64) -> Result<(Datum, Vec<Vector2<f64>>), MissionError> {
    let corners: Vec<[f64; 2]> =
        polygon.elements()?.iter().map(|corner| corner.numbers::<2>()).collect::<Result<_, _>>()?;
    let [latitude, longitude] = *corners.first().ok_or_else(|| polygon.mismatch("three corners or more"))?;
    let datum = Datum::from_degrees(latitude, longitude, 0.0);
    let level = |[latitude, longitude]: &[f64; 2]| {
        datum.to_enu(&Datum::from_degrees(*latitude, *longitude, 0.0).place()).xy()
    };
    let outline: Vec<_> = corners.iter().map(level).collect();
    let round = widened(&outline, away_m);
    let round = round.ok_or_else(|| polygon.mismatch("three corners or more that enclose something"))?;
    Ok((datum, round))
}

/// A polygon whose edges are this far further out, metres.
fn widened(corners: &[Vector2<f64>], by_m: f64) -> Option<Vec<Vector2<f64>>> {
    let at = |k: usize| corners[k % corners.len()];
    let area: f64 = (0..corners.len()).map(|k| at(k).perp(&at(k + 1))).sum();
    if corners.len() < 3 || !area.is_finite() || area.abs() < 1e-6 {
        return None;
    }
    let outwards = |k: usize| {
        let along = (at(k + 1) - at(k)).try_normalize(1e-9).unwrap_or_default();
        Vector2::new(along.y, -along.x) * area.signum()
    };
    let corner = |k: usize| {
        let (before, after) = (outwards(k + corners.len() - 1), outwards(k));
        let middle = before + after;
        // Where both edges meet; a very sharp corner is cut off.
        at(k) + middle * (2.0 * by_m / middle.norm_squared().max(0.5))
    };
    Some((0..corners.len()).map(corner).collect())
}

fn item<'a>(
    node: &Node<'a>,
    datum: &Datum,
    place: &Vector3<f64>,
    number: u64,
    element: usize,
    scan: usize,
) -> Item<'a> {
    let at = datum.to_geodetic(&place.xy().push(0.0));
    let (latitude, longitude) = (at.latitude_rad.to_degrees(), at.longitude_rad.to_degrees());
    Item {
        origin: Origin::Json(node.clone()),
        command: WAYPOINT,
        frame: ABOVE_HOME,
        params: [0.0, 0.0, 0.0, f64::NAN, latitude, longitude, place.z],
        number,
        element,
        scan: Some(scan),
        follows_terrain: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_is_as_far_out_as_asked_whichever_way_the_corners_go() {
        let square = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]].map(Vector2::from);
        let wider = [[-2.0, -2.0], [12.0, -2.0], [12.0, 12.0], [-2.0, 12.0]].map(Vector2::from);
        let near = |round: Vec<Vector2<f64>>, expected: &[Vector2<f64>]| {
            round.iter().zip(expected).all(|(one, other)| (one - other).norm() < 1e-9)
        };
        assert!(near(widened(&square, 2.0).unwrap(), &wider));
        let reversed = |corners: [Vector2<f64>; 4]| corners.into_iter().rev().collect::<Vec<_>>();
        assert!(near(widened(&reversed(square), 2.0).unwrap(), &reversed(wider)));
        assert_eq!(widened(&square[..2], 2.0), None);
    }
}
