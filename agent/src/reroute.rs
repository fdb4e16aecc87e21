//! Whether a vehicle can fly a route that is sent to it.

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::airspace::KeepOut;
use skein_wire::event::ZoneKind;
use skein_wire::{Outline, Route, Zone};

use crate::config::AgentConfig;
use crate::living_airspace::closed_by;

/// Why the vehicle does not fly this route, if so. `drawn` are the zones that it has regard for; `ends` are the places
/// where others stay or mean to, metres ENU.
pub fn objection(
    route: &Route,
    config: &AgentConfig,
    drawn: &[Zone],
    ends: &[(NodeName, Vector3<f64>)],
) -> Option<String> {
    let zones = KeepOut::new(config.airspace.clone(), 0.0, 0.0);
    let points = (1..).zip(route.points());
    points
        .clone()
        .find_map(|(number, point)| {
            let why = if !config.fence.holds(point) {
                format!(
                    "is outside the fence, which reaches from {:?} to {:?}",
                    config.fence.min, config.fence.max
                )
            } else if zones.room_m(&(*point).into()) < 0.0 {
                "is in a zone or in the ground that it keeps out of".to_owned()
            } else if let Some(zone) = drawn.iter().find(|zone| keeps_out(zone, point)) {
                format!("is where the zone `{}` lets nobody fly", zone.name())
            } else {
                return None;
            };
            Some(format!("point {number} of the route, {point:?}, {why}"))
        })
        .or_else(|| ends_beside(points.last()?, config.envelope.separation_m, ends))
}

/// Those who stay, or mean to, nearer to where the route ends than the vehicle keeps.
fn ends_beside(
    (number, last): (usize, &[f64; 3]),
    kept_m: f64,
    ends: &[(NodeName, Vector3<f64>)],
) -> Option<String> {
    let off_m = |end: &Vector3<f64>| (end - Vector3::from(*last)).xy().norm();
    let (node, end) = ends.iter().find(|(_, end)| off_m(end) < kept_m)?;
    Some(format!(
        "point {number} of the route, {last:?}, where it would land, is {:.1} m beside the place of {node}: expected at \
         least {kept_m:.1} m",
        off_m(end)
    ))
}

fn keeps_out(zone: &Zone, point: &[f64; 3]) -> bool {
    let ([low_m, high_m], [.., z]) = (zone.heights_m(), *point);
    match (zone.outline(), zone.kind()) {
        (Outline::Everywhere, ZoneKind::NotAbove) => z > low_m,
        (Outline::Everywhere, _) => z < high_m,
        _ => KeepOut::new(closed_by(zone), 0.0, 0.0).room_m(&(*point).into()) < 0.0,
    }
}
