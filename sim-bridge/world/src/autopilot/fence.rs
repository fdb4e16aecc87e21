//! The geofence and the rally points that stations upload, as places in the world.

use nalgebra::{Vector2, Vector3};
use skein_mav::messages::MavCmd;
use skein_mav::{Datum, MissionItem};

/// Largest radius of a circle, m.
const WIDEST_M: f32 = 1e6;

/// Zones to stay inside and outside of, at all heights.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct GeoFence {
    inside: Vec<Zone>,
    outside: Vec<Zone>,
}

#[derive(Debug, Clone, PartialEq)]
enum Zone {
    /// Centre and radius, ENU, m.
    Circle(Vector2<f64>, f64),
    /// Corners in order, ENU, m.
    Polygon(Vec<Vector2<f64>>),
}

impl GeoFence {
    /// The zones of uploaded items; `None` if these are none: polygons are as many corners in a row as each
    /// of them says.
    pub(super) fn read(mut items: &[MissionItem], datum: &Datum) -> Option<Self> {
        let mut fence = Self::default();
        while let Some(first) = items.first() {
            let (count, includes) = match first.command {
                MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION => (first.params[0] as usize, true),
                MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION => (first.params[0] as usize, false),
                MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION => (1, true),
                MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION => (1, false),
                _ => return None,
            };
            let (zone, rest) = items.split_at_checked(count)?;
            let zone = if count == 1 { circle(first, datum)? } else { polygon(zone, datum)? };
            if includes {
                fence.inside.push(zone)
            } else {
                fence.outside.push(zone)
            }
            items = rest;
        }
        Some(fence)
    }

    /// Whether a place is in a zone to stay outside of, or in none to stay inside of though there are such.
    pub(super) fn is_left_at(&self, place: &Vector3<f64>) -> bool {
        let place = place.xy();
        let holds = |zones: &[Zone]| zones.iter().any(|zone| zone.holds(&place));
        holds(&self.outside) || !self.inside.is_empty() && !holds(&self.inside)
    }
}

impl Zone {
    fn holds(&self, place: &Vector2<f64>) -> bool {
        match self {
            Self::Circle(centre, radius_m) => (place - centre).norm() <= *radius_m,
            Self::Polygon(corners) => {
                let next = corners.iter().cycle().skip(1);
                let crossed = corners.iter().zip(next).filter(|(from, to)| {
                    let (low, high) = (from.y - place.y, to.y - place.y);
                    (low > 0.0) != (high > 0.0) && place.x < from.x + (to.x - from.x) * low / (low - high)
                });
                crossed.count() % 2 == 1
            }
        }
    }
}

fn circle(item: &MissionItem, datum: &Datum) -> Option<Zone> {
    let [radius_m, ..] = item.params;
    (radius_m > 0.0 && radius_m <= WIDEST_M).then_some(Zone::Circle(item.ground(datum)?, f64::from(radius_m)))
}

fn polygon(items: &[MissionItem], datum: &Datum) -> Option<Zone> {
    let first = items.first()?;
    let is_of_it = |item: &MissionItem| item.command == first.command && item.params[0] == first.params[0];
    let corners = items.iter().filter(|item| is_of_it(item)).map(|item| item.ground(datum));
    let corners: Vec<_> = corners.collect::<Option<_>>()?;
    (corners.len() > 2 && corners.len() == items.len()).then_some(Zone::Polygon(corners))
}

/// Places to return to, ENU, m, at the height of home; `None` if the items are none.
pub(super) fn rally_points(items: &[MissionItem], datum: &Datum) -> Option<Vec<Vector2<f64>>> {
    let is_point = |item: &&MissionItem| item.command == MavCmd::MAV_CMD_NAV_RALLY_POINT;
    let points = items.iter().map(|item| Some(item).filter(is_point).and_then(|item| item.ground(datum)));
    points.collect()
}

/// Whether a list is a geofence, wherever the world is.
pub(super) fn accepts_fence(items: &[MissionItem]) -> bool {
    GeoFence::read(items, &anywhere()).is_some()
}

/// Whether a list is one of rally points.
pub(super) fn accepts_rally(items: &[MissionItem]) -> bool {
    rally_points(items, &anywhere()).is_some()
}

fn anywhere() -> Datum {
    Datum::from_degrees(0.0, 0.0, 0.0)
}

#[cfg(test)]
mod tests {
    use skein_mav::messages::MavFrame;

    use super::*;

    fn datum() -> Datum {
        Datum::from_degrees(47.4, 8.5, 400.0)
    }

    fn item(command: MavCmd, param1: f32, x: f64, y: f64) -> MissionItem {
        let waypoint = MissionItem::waypoint(&datum(), &Vector3::new(x, y, 0.0), param1);
        MissionItem { command, frame: MavFrame::MAV_FRAME_GLOBAL, z: 0.0, ..waypoint }
    }

    #[test]
    fn a_place_is_left_in_a_zone_to_stay_out_of_or_in_none_to_stay_in() {
        let corner = |x, y| item(MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, 4.0, x, y);
        let mut items =
            [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)].map(|(x, y)| corner(x, y)).to_vec();
        items.push(item(MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, 5.0, 10.0, 0.0));
        let fence = GeoFence::read(&items, &datum()).unwrap();
        let left = |x, y| fence.is_left_at(&Vector3::new(x, y, 3.0));
        assert_eq!(
            [left(0.0, 0.0), left(10.0, 3.0), left(10.0, 6.0), left(0.0, 25.0)],
            [false, true, false, true]
        );
        items.push(item(MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 5.0, 0.0, 25.0));
        assert!(
            !GeoFence::read(&items, &datum()).unwrap().is_left_at(&Vector3::new(0.0, 25.0, 3.0)),
            "either will do"
        );
        assert!(!GeoFence::default().is_left_at(&Vector3::new(1e4, 0.0, 3.0)));
    }

    #[test]
    fn what_is_no_fence_is_refused() {
        let corner = |count| item(MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, count, 1.0, 1.0);
        assert!(!accepts_fence(&[corner(3.0), corner(3.0)]), "a corner is missing");
        assert!(!accepts_fence(&[corner(2.0), corner(2.0)]), "two corners");
        assert!(!accepts_fence(&[corner(0.0)]) && !accepts_fence(&[corner(f32::NAN)]));
        assert!(!accepts_fence(&[item(MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0.0, 0.0, 0.0)]));
        assert!(!accepts_fence(&[item(MavCmd::MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 0.0)]));
        assert!(accepts_fence(&[]) && accepts_rally(&[item(MavCmd::MAV_CMD_NAV_RALLY_POINT, 0.0, 3.0, 4.0)]));
        assert!(!accepts_rally(&[item(MavCmd::MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 0.0)]));
    }
}
