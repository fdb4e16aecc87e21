//! The field: where the lines of a coverage may lead.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use skein_planning::airspace::{Airspace, Area, KeepOut, NoFlyPrism};

/// Distance of lines from what is closed, metres: a vehicle's stray, its hull, and what it keeps itself.
const CLOSED_MARGIN_M: f64 = 1.5;
/// Steps along a way are no shorter than this, metres.
const STEP_M: f64 = 0.02;
/// Room that is less than none by no more than this is rounding, metres.
const ROUNDING_M: f64 = 1e-6;
/// A way around a corner turns this much further off it than it must, as a share.
const WIDER: f64 = 1.1;
/// Places around a corner, and around a round zone, where a way may turn.
const TURNS: usize = 8;
/// Places along the longer side of an area that are looked at to tell how much of it is seen.
const SAMPLES: f64 = 64.0;

/// A polygon less a margin at its border, and less what is closed at the height of flight.
#[derive(Debug)]
pub struct Field<'a> {
    /// The area: its inside is what a zone's would be.
    area: NoFlyPrism,
    height_m: f64,
    airspace: &'a Airspace,
    closed: KeepOut,
    margin_m: f64,
}

impl<'a> Field<'a> {
    /// The area with these corners (ENU, metres), flown at `height_m`, with nothing taken off at its border
    /// yet.
    pub fn new(corners: &[Vector2<f64>], height_m: f64, airspace: &'a Airspace) -> Self {
        let (floor_m, ceiling_m) = (f64::NEG_INFINITY, f64::INFINITY);
        Self {
            area: NoFlyPrism { corners: corners.to_vec(), floor_m, ceiling_m },
            height_m,
            airspace,
            closed: KeepOut::new(airspace.clone(), CLOSED_MARGIN_M, CLOSED_MARGIN_M),
            margin_m: 0.0,
        }
    }

    /// Takes a margin off at the border of the area, metres.
    pub fn set_margin(&mut self, margin_m: f64) {
        self.margin_m = margin_m;
    }

    pub fn corners(&self) -> &[Vector2<f64>] {
        &self.area.corners
    }

    /// Distance to where no line may lead, metres; negative there.
    fn room_m(&self, place: &Vector2<f64>) -> f64 {
        let inside_m = -self.area.off_outline_m(*place) - self.margin_m;
        inside_m.min(self.closed.room_m(&place.push(self.height_m)))
    }

    /// The parts of the straight way between two places that are open, as distances from its beginning,
    /// metres.
    pub fn open_parts(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> Vec<[f64; 2]> {
        let length_m = (to - from).norm();
        let (mut parts, mut open, mut at_m) = (Vec::new(), None, 0.0);
        loop {
            let share = if length_m > 0.0 { at_m / length_m } else { 0.0 };
            let room_m = self.room_m(&from.lerp(to, share));
            if room_m >= -ROUNDING_M {
                open.get_or_insert([at_m, at_m])[1] = at_m;
            } else {
                parts.extend(open.take());
            }
            if at_m >= length_m {
                break;
            }
            at_m = (at_m + room_m.abs().max(STEP_M)).min(length_m);
        }
        parts.extend(open);
        parts
    }

    pub fn is_open(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        let whole_m = (to - from).norm();
        matches!(self.open_parts(from, to)[..], [[from_m, to_m]] if from_m == 0.0 && to_m == whole_m)
    }

    /// Places all over the area that are to be seen: not what is closed itself.
    pub fn places(&self) -> Vec<Vector2<f64>> {
        let corners = self.corners();
        let low = corners.iter().copied().reduce(|a, b| a.inf(&b)).unwrap_or_default();
        let size = corners.iter().copied().reduce(|a, b| a.sup(&b)).unwrap_or_default() - low;
        let step_m = size.max() / SAMPLES;
        let count = |axis: usize| (size[axis] / step_m).ceil() as usize;
        let places = (0..count(0)).flat_map(|i| {
            (0..count(1)).map(move |j| low + Vector2::new(i as f64 + 0.5, j as f64 + 0.5) * step_m)
        });
        let is_seen = |place: &Vector2<f64>| {
            self.area.off_outline_m(*place) < 0.0
                && self.closed.bare_room_m(&place.push(self.height_m)) >= 0.0
        };
        places.filter(is_seen).collect()
    }

    /// Open places where the shortest ways in the field turn: around its reflex corners, and around zones.
    pub fn turns(&self) -> Vec<Vector2<f64>> {
        let Airspace { threats, no_fly, prisms, stay_inside, .. } = self.airspace;
        let bordered = stay_inside.iter().flat_map(|zone| &zone.any_of).filter_map(|area| match area {
            Area::Cornered(zone) => Some(zone),
            Area::Round(_) => None,
        });
        let off_m = (self.margin_m * WIDER).max(STEP_M);
        let own = self.reflex_corners().into_iter().map(|corner| (corner, off_m));
        let cornered = prisms.iter().chain(bordered).flat_map(|zone| &zone.corners);
        let zones = cornered.map(|corner| (*corner, CLOSED_MARGIN_M * WIDER));
        let round = no_fly.iter().map(|zone| (zone.centre, (zone.radius_m + CLOSED_MARGIN_M) * WIDER));
        let domes = threats.iter().map(|zone| {
            let reach_m = zone.radius_m + CLOSED_MARGIN_M;
            (zone.centre, (reach_m.powi(2) - self.height_m.powi(2)).max(0.0).sqrt() * WIDER)
        });
        let rings = own.chain(zones).chain(round).chain(domes).flat_map(|(centre, radius_m)| {
            (0..TURNS).map(move |k| {
                let (sin, cos) = (TAU * (k as f64 + 0.5) / TURNS as f64).sin_cos();
                centre + Vector2::new(cos, sin) * radius_m
            })
        });
        rings.filter(|place| self.room_m(place) >= 0.0).collect()
    }

    /// Corners at which the area's inside takes up more than half a turn.
    fn reflex_corners(&self) -> Vec<Vector2<f64>> {
        let corners = self.corners();
        let around = |k: usize| {
            let at = |j: usize| corners[j % corners.len()];
            [at(k), at(k + 1), at(k + 2)]
        };
        let area: f64 = (0..corners.len()).map(|k| around(k)[0].perp(&around(k)[1])).sum();
        let bends_out =
            |[before, at, after]: &[Vector2<f64>; 3]| (at - before).perp(&(after - at)) * area < 0.0;
        (0..corners.len()).map(around).filter(bends_out).map(|[_, at, _]| at).collect()
    }
}
