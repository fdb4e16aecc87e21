//! Where a vehicle must not fly though nothing stands there: zones and the air next to the ground, as distances.

use nalgebra::{Vector2, Vector3};

use super::{Airspace, NoFlyPrism, NoFlyZone, ThreatZone};

/// Steps along a line are no shorter than this, metres: what a line cuts off a zone by less counts for nothing.
const STEP_M: f64 = 0.05;
/// For slopes of the terrain, metres.
const DIFFERENCE_M: f64 = 0.05;
/// A place outside is searched for in rings this far apart, metres.
const RING_M: f64 = 0.5;
/// No further than this, metres.
const FURTHEST_M: f64 = 100.0;

/// An [`Airspace`]'s zones, and what is outside of areas to stay inside of, with a margin around them, and the air over
/// its terrain up to a clearance.
///
/// Threats are closed as no-fly zones are, and not merely dear: being seen for a moment is enough, and no detour is
/// so long that it is worth that. Below the ground a threat goes on, as a ball. The airspace's box counts for nothing
/// here.
///
/// Distances are lower bounds that change by no more than a metre per metre, so a line is searched in long steps far
/// away from all zones. The time an answer takes grows with the number of zones and their corners.
#[derive(Clone, Debug, PartialEq)]
pub struct KeepOut {
    airspace: Airspace,
    margin_m: f64,
    terrain_clearance_m: f64,
    has_terrain: bool,
    /// `sqrt(1 + slope^2)` of the steepest slope.
    steepness: f64,
}

impl KeepOut {
    /// The zones of `airspace` with `margin_m` around them, and what is lower than `terrain_clearance_m` above its
    /// terrain, if it has any.
    pub fn new(airspace: Airspace, margin_m: f64, terrain_clearance_m: f64) -> KeepOut {
        let steepness = airspace.steepest().hypot(1.0);
        let has_terrain = !airspace.mountains.is_empty() || airspace.heights.is_some();
        KeepOut { airspace, margin_m, terrain_clearance_m, has_terrain, steepness }
    }

    /// Other margins for the same places.
    pub fn set_margins(&mut self, margin_m: f64, terrain_clearance_m: f64) {
        (self.margin_m, self.terrain_clearance_m) = (margin_m, terrain_clearance_m);
    }

    /// Distance to the nearest place that is closed, margin and clearance included, metres: a lower bound. Negative
    /// inside.
    pub fn room_m(&self, point: &Vector3<f64>) -> f64 {
        let zones_m = self.off_zones_m(point) - self.margin_m;
        zones_m.min(self.off_terrain_m(point, self.terrain_clearance_m))
    }

    /// Distance to the nearest zone or the ground itself, without margin, metres: a lower bound. Negative inside.
    pub fn bare_room_m(&self, point: &Vector3<f64>) -> f64 {
        self.off_zones_m(point).min(self.off_terrain_m(point, 0.0))
    }

    fn off_zones_m(&self, point: &Vector3<f64>) -> f64 {
        let low = self.airspace.low.iter().map(|zone| zone.off_m(point));
        low.fold(self.off_columns_m(point), f64::min)
    }

    /// The same of what a vehicle that goes straight up or down must not pass through either.
    fn off_columns_m(&self, point: &Vector3<f64>) -> f64 {
        let Airspace { threats, no_fly, prisms, stay_inside, .. } = &self.airspace;
        let threats = threats.iter().map(|zone| zone.off_m(point));
        let no_fly = no_fly.iter().map(|zone| zone.off_m(point));
        let prisms = prisms.iter().map(|zone| zone.off_m(point));
        let inside = stay_inside.iter().map(|zone| zone.room_m(point));
        threats.chain(no_fly).chain(prisms).chain(inside).fold(f64::INFINITY, f64::min)
    }

    fn off_terrain_m(&self, point: &Vector3<f64>, clearance_m: f64) -> f64 {
        if !self.has_terrain {
            return f64::INFINITY;
        }
        (self.airspace.clearance_m(point) - clearance_m) / self.steepness
    }

    /// The length of the straight way between two points that is closed, metres; what it cuts off by less than some
    /// centimetres is not counted.
    pub fn inside_m(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let length_m = (to - from).norm();
        let (mut at_m, mut inside_m) = (0.0, 0.0);
        while at_m < length_m {
            let room_m = self.room_m(&from.lerp(to, at_m / length_m));
            let step_m = room_m.abs().max(STEP_M).min(length_m - at_m);
            inside_m += if room_m < 0.0 { step_m } else { 0.0 };
            at_m += step_m;
        }
        inside_m
    }

    /// The points of zones and ground, without margin, that are nearest to `point`, of those within `reach_m`: one
    /// for each zone, one for each edge of a polygon. What keeps clear of the points keeps clear of the zones. None
    /// from inside a zone, so that they do not hold back who leaves it.
    pub fn walls(&self, point: &Vector3<f64>, reach_m: f64) -> Vec<Vector3<f64>> {
        let Airspace { threats, no_fly, prisms, stay_inside, .. } = &self.airspace;
        if !(0.0..reach_m).contains(&self.bare_room_m(point)) {
            return Vec::new();
        }
        let threats = threats.iter().filter_map(|zone| zone.nearest(point));
        let no_fly = no_fly.iter().map(|zone| zone.nearest(point));
        let prisms = prisms.iter().flat_map(|zone| zone.nearest(point));
        let borders = stay_inside.iter().flat_map(|zone| zone.border(point));
        let low = self.airspace.low.iter().flat_map(|zone| zone.nearest(point));
        let zones =
            threats.chain(no_fly).chain(prisms).chain(low).chain(borders).chain(self.ground_near(point));
        zones.filter(|wall| (wall - point).norm() < reach_m).collect()
    }

    /// About the nearest point of the ground.
    fn ground_near(&self, point: &Vector3<f64>) -> Option<Vector3<f64>> {
        let slope = |axis: Vector3<f64>| {
            let (one, other) = (point - axis * DIFFERENCE_M, point + axis * DIFFERENCE_M);
            (self.airspace.clearance_m(&other) - self.airspace.clearance_m(&one)) / (2.0 * DIFFERENCE_M)
        };
        let upwards = Vector3::new(slope(Vector3::x()), slope(Vector3::y()), 1.0);
        let height_m = self.airspace.clearance_m(point);
        self.has_terrain.then(|| point - upwards * (height_m / upwards.norm_squared()))
    }

    /// The view of the zones of a lidar at `origin`, if they could be seen: where each of so many level rays, evenly
    /// around, meets one within `reach_m`. Nothing from inside.
    pub fn seen_from(&self, origin: &Vector3<f64>, rays: usize, reach_m: f64) -> Vec<Vector3<f64>> {
        if !(0.0..reach_m).contains(&self.bare_room_m(origin)) {
            return Vec::new();
        }
        let ray = |number: usize| {
            let (sin, cos) = (number as f64 / rays as f64 * std::f64::consts::TAU).sin_cos();
            let mut at_m = 0.0;
            while at_m < reach_m {
                let point = origin + Vector3::new(cos, sin, 0.0) * at_m;
                let room_m = self.bare_room_m(&point);
                if room_m < STEP_M {
                    return Some(point);
                }
                at_m += room_m;
            }
            None
        };
        (0..rays).filter_map(ray).collect()
    }

    /// A place near `point`, at its height, that is open and that `accepts` takes: `point` itself if it is one, else
    /// about the nearest.
    pub fn nearest_open(
        &self,
        point: &Vector3<f64>,
        accepts: impl Fn(&Vector3<f64>) -> bool,
    ) -> Option<Vector3<f64>> {
        let is_open = |place: &Vector3<f64>| self.room_m(place) >= 0.0 && accepts(place);
        places_around(point, FURTHEST_M).find(is_open)
    }

    /// Where whoever is at `point` leaves what is closed by about the shortest way, to its side, up or down; of the
    /// places that `accepts` takes, no further than 100 m away. `point` itself if it is open.
    pub fn way_out(
        &self,
        point: &Vector3<f64>,
        accepts: impl Fn(&Vector3<f64>) -> bool,
    ) -> Option<Vector3<f64>> {
        let upright = [1.0, -1.0].into_iter().filter_map(|up| self.out_along(point, up * Vector3::z()));
        let upright =
            upright.filter(&accepts).min_by(|a, b| (a.z - point.z).abs().total_cmp(&(b.z - point.z).abs()));
        let upright_m = upright.map_or(FURTHEST_M, |place| (place.z - point.z).abs());
        let is_open = |place: &Vector3<f64>| self.room_m(place) >= 0.0 && accepts(place);
        places_around(point, upright_m.min(FURTHEST_M)).find(is_open).or(upright)
    }

    /// The first open place in a direction.
    fn out_along(&self, point: &Vector3<f64>, direction: Vector3<f64>) -> Option<Vector3<f64>> {
        let mut at_m = 0.0;
        while at_m < FURTHEST_M {
            let place = point + direction * at_m;
            match self.room_m(&place) {
                room_m if room_m >= 0.0 => return Some(place),
                room_m => at_m += room_m.abs().max(STEP_M),
            }
        }
        None
    }

    /// Least distance to a zone, margin included, of the way straight down from `point` to the ground, metres:
    /// negative where it leads through one. The ground is at `ground_m`, or is the terrain.
    pub fn room_below_m(&self, point: &Vector3<f64>, ground_m: f64) -> f64 {
        let mut below = *point;
        let mut room_m = f64::INFINITY;
        while below.z >= ground_m && self.off_terrain_m(&below, 0.0) >= 0.0 {
            let here_m = self.off_columns_m(&below) - self.margin_m;
            room_m = room_m.min(here_m);
            below.z -= here_m.abs().max(STEP_M);
        }
        room_m
    }
}

/// `point`, and places around it at its height up to `furthest_m` away, metres, the nearest first, half a metre apart.
pub fn places_around(point: &Vector3<f64>, furthest_m: f64) -> impl Iterator<Item = Vector3<f64>> {
    let point = *point;
    let rings = (1..=(furthest_m / RING_M) as u32).map(|ring| f64::from(ring) * RING_M);
    let places = rings.flat_map(move |radius_m| {
        // No two neighbours on a ring are much further apart than rings are.
        let count = (std::f64::consts::TAU * radius_m / RING_M).ceil() as u32;
        (0..count).map(move |k| {
            let (sin, cos) = (f64::from(k) / f64::from(count) * std::f64::consts::TAU).sin_cos();
            point + Vector3::new(cos, sin, 0.0) * radius_m
        })
    });
    std::iter::once(point).chain(places)
}

impl ThreatZone {
    fn off_m(&self, point: &Vector3<f64>) -> f64 {
        (point - self.middle()).norm() - self.radius_m
    }

    fn nearest(&self, point: &Vector3<f64>) -> Option<Vector3<f64>> {
        let outwards = (point - self.middle()).try_normalize(1e-9)?;
        Some(self.middle() + outwards * self.radius_m)
    }

    fn middle(&self) -> Vector3<f64> {
        self.centre.push(0.0)
    }
}

impl NoFlyZone {
    pub(super) fn off_m(&self, point: &Vector3<f64>) -> f64 {
        let level_m = (point.xy() - self.centre).norm() - self.radius_m;
        upright(level_m, off_band_m(point.z, self.floor_m, self.ceiling_m))
    }

    pub(super) fn nearest(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let offset = point.xy() - self.centre;
        let level = self.centre + offset * (self.radius_m / offset.norm()).min(1.0);
        at_height(level, point.z, self.floor_m, self.ceiling_m)
    }
}

impl NoFlyPrism {
    pub(super) fn off_m(&self, point: &Vector3<f64>) -> f64 {
        upright(self.off_outline_m(point.xy()), off_band_m(point.z, self.floor_m, self.ceiling_m))
    }

    /// Of each edge; straight above or below the zone, of the whole.
    pub(super) fn nearest(&self, point: &Vector3<f64>) -> Vec<Vector3<f64>> {
        let onto = |level| at_height(level, point.z, self.floor_m, self.ceiling_m);
        if self.off_outline_m(point.xy()) < 0.0 {
            return vec![onto(point.xy())];
        }
        self.nearest_on_edges(point.xy()).map(onto).collect()
    }
}

fn at_height(level: Vector2<f64>, height_m: f64, floor_m: f64, ceiling_m: f64) -> Vector3<f64> {
    level.push(height_m.max(floor_m).min(ceiling_m))
}

/// The distance of a height from a band of heights, metres; negative inside.
fn off_band_m(height_m: f64, floor_m: f64, ceiling_m: f64) -> f64 {
    (floor_m - height_m).max(height_m - ceiling_m)
}

/// Distance from an upright body, given those from its outline and from its heights, metres; negative inside.
fn upright(level_m: f64, height_m: f64) -> f64 {
    if level_m > 0.0 && height_m > 0.0 { level_m.hypot(height_m) } else { level_m.max(height_m) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::airspace::{Area, HeightGrid, Mountain};

    /// One of each kind: a threat, a cylinder, an L, and a hill.
    fn airspace() -> Airspace {
        let corner = |[x, y]: [f64; 2]| Vector2::new(x, y);
        let outline =
            [[-30.0, -30.0], [-10.0, -30.0], [-10.0, -20.0], [-20.0, -20.0], [-20.0, -10.0], [-30.0, -10.0]];
        let (floor_m, ceiling_m) = (2.0, 12.0);
        Airspace {
            threats: vec![ThreatZone { centre: Vector2::new(20.0, 20.0), radius_m: 8.0 }],
            no_fly: vec![NoFlyZone { centre: Vector2::new(-20.0, 20.0), radius_m: 5.0, floor_m, ceiling_m }],
            prisms: vec![NoFlyPrism { corners: outline.map(corner).to_vec(), floor_m, ceiling_m }],
            mountains: vec![Mountain {
                centre: Vector2::new(20.0, -20.0),
                height_m: 10.0,
                slope_m: Vector2::new(5.0, 8.0),
            }],
            ..Airspace::default()
        }
    }

    fn keep_out() -> KeepOut {
        KeepOut::new(airspace(), 1.0, 1.5)
    }

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        (-40.0..40.0, -40.0..40.0, 0.0..20.0).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    #[test]
    fn the_margin_is_around_zones_and_the_clearance_above_the_ground() {
        let room = |x, y, z| keep_out().room_m(&Vector3::new(x, y, z));
        assert!((room(-20.0, 27.0, 5.0) - 1.0).abs() < 1e-9, "beside the cylinder");
        assert!((room(-20.0, 20.0, 15.0) - 2.0).abs() < 1e-9, "above it");
        assert!((room(-15.0, -15.0, 11.0) - 4.0).abs() < 1e-9, "in the notch of the L");
        assert!(room(-25.0, -15.0, 7.0) < -5.0, "in its arm");
        assert!(room(20.0, -20.0, 11.4) < 0.0 && room(20.0, -20.0, 11.6) > 0.0, "over the peak");
        assert!(room(20.0, 20.0, 9.1) > 0.0 && room(20.0, 20.0, 8.9) < 0.0, "over the threat");
        assert_eq!(KeepOut::new(Airspace::default(), 1.0, 1.0).room_m(&Vector3::zeros()), f64::INFINITY);
    }

    #[test]
    fn heights_on_a_grid_close_the_air_over_them() {
        let heights = HeightGrid::new(Vector2::zeros(), 10.0, &[vec![0.0, 8.0], vec![0.0, 8.0]]).ok();
        let keep_out = KeepOut::new(Airspace { heights, ..Airspace::default() }, 1.0, 2.0);
        assert!(keep_out.room_m(&Vector3::new(5.0, 5.0, 5.9)) < 0.0);
        assert!(keep_out.room_m(&Vector3::new(5.0, 5.0, 6.1)) > 0.0);
    }

    #[test]
    fn a_place_inside_has_an_open_one_near() {
        let (keep_out, inside) = (keep_out(), Vector3::new(-20.0, 22.0, 5.0));
        let open = keep_out.nearest_open(&inside, |_| true).unwrap();
        assert!(keep_out.room_m(&open) >= 0.0 && (open - inside).norm() < 4.7, "{open}");
        let south = keep_out.nearest_open(&inside, |place| place.y < 18.0).unwrap();
        assert!(south.y < 18.0 && keep_out.room_m(&south) >= 0.0);
        let outside = Vector3::new(0.0, 0.0, 5.0);
        assert_eq!(keep_out.nearest_open(&outside, |_| true), Some(outside));
    }

    #[test]
    fn the_way_out_is_the_shortest_also_if_it_leads_up_or_down() {
        let out = |x, y, z, accepts: fn(&Vector3<f64>) -> bool| {
            let from = Vector3::new(x, y, z);
            keep_out().way_out(&from, accepts).map(|to| to - from)
        };
        let up = out(-20.0, 20.0, 11.5, |_| true).unwrap();
        assert!(up.xy().norm() < 1e-9 && (up.z - 1.5).abs() < 0.1, "{up}");
        let beneath = out(-20.0, 20.0, 2.5, |_| true).unwrap();
        assert!(beneath.z == 0.0 && (beneath.norm() - 6.0).abs() < 0.6, "too near to the ground: {beneath}");
        let aside = out(-20.0, 24.0, 7.0, |_| true).unwrap();
        assert!(aside.z == 0.0 && aside.norm() < 2.6, "{aside}");
        assert!(
            out(-20.0, 20.0, 11.5, |place| place.z < 12.0).unwrap().z.abs() < 1e-9,
            "where that is not accepted"
        );
        assert_eq!(out(0.0, 0.0, 5.0, |_| true), Some(Vector3::zeros()));
        let nowhere =
            Airspace { stay_inside: vec![super::super::StayInside::default()], ..Airspace::default() };
        assert_eq!(KeepOut::new(nowhere, 1.0, 0.0).way_out(&Vector3::zeros(), |_| true), None);
    }

    #[test]
    fn who_lands_or_takes_off_passes_through_what_is_too_low_to_fly_in() {
        let low = vec![Area::Round(NoFlyZone {
            centre: Vector2::zeros(),
            radius_m: f64::INFINITY,
            floor_m: f64::NEG_INFINITY,
            ceiling_m: 4.0,
        })];
        let keep_out = KeepOut::new(Airspace { low, ..Airspace::default() }, 1.0, 0.0);
        let (above, in_it) = (Vector3::new(3.0, 0.0, 7.0), Vector3::new(3.0, 0.0, 2.0));
        assert_eq!((keep_out.room_m(&above), keep_out.room_m(&in_it)), (2.0, -3.0));
        assert_eq!(keep_out.walls(&above, 9.0), [Vector3::new(3.0, 0.0, 4.0)]);
        assert_eq!(keep_out.room_below_m(&above, 0.0), f64::INFINITY);
        assert_eq!(keep_out.way_out(&in_it, |_| true), Some(Vector3::new(3.0, 0.0, 5.0)));
    }

    #[test]
    fn rays_meet_what_cannot_be_seen() {
        let origin = Vector3::new(-20.0, 12.0, 5.0);
        let seen = keep_out().seen_from(&origin, 360, 6.0);
        let nearest = seen.iter().map(|point| (point - origin).norm()).fold(f64::INFINITY, f64::min);
        assert!((nearest - 3.0).abs() < 2.0 * STEP_M, "{nearest}");
        assert!(keep_out().seen_from(&Vector3::new(-20.0, 20.0, 5.0), 360, 6.0).is_empty(), "inside");
    }

    proptest! {
        #[test]
        fn room_changes_by_no_more_than_the_way(from in point(), to in point()) {
            let keep_out = keep_out();
            let change = (keep_out.room_m(&from) - keep_out.room_m(&to)).abs();
            prop_assert!(change <= (to - from).norm() + 1e-3, "a mountain ends with a step of less");
        }

        #[test]
        fn the_way_inside_is_what_counting_points_says(from in point(), to in point()) {
            const SAMPLES: usize = 4000;
            let keep_out = keep_out();
            let at = |k: usize| from.lerp(&to, (k as f64 + 0.5) / SAMPLES as f64);
            let inside = (0..SAMPLES).filter(|k| keep_out.room_m(&at(*k)) < 0.0).count();
            let counted_m = inside as f64 / SAMPLES as f64 * (to - from).norm();
            prop_assert!((keep_out.inside_m(&from, &to) - counted_m).abs() < 0.6);
        }

        #[test]
        fn the_way_down_leads_through_a_zone_if_a_point_of_it_is_inside(point in point()) {
            let keep_out = keep_out();
            let heights = (0..2000).map(|k| point.z * f64::from(k) / 2000.0);
            let above_ground = heights
                .map(|height| Vector3::new(point.x, point.y, height))
                .filter(|below| keep_out.airspace.clearance_m(below) >= 0.0);
            let least_m = above_ground.map(|below| keep_out.off_zones_m(&below) - 1.0).fold(f64::INFINITY, f64::min);
            let told_m = keep_out.room_below_m(&point, 0.0);
            prop_assert!(told_m.is_sign_negative() == least_m.is_sign_negative() || least_m.abs() < STEP_M);
            prop_assert!(least_m < 0.0 || told_m >= least_m - STEP_M);
        }

        #[test]
        fn walls_are_where_zones_begin(point in point()) {
            let keep_out = keep_out();
            let walls = keep_out.walls(&point, 50.0);
            let room_m = keep_out.bare_room_m(&point);
            prop_assert_eq!(walls.is_empty(), room_m < 0.0);
            for wall in &walls {
                prop_assert!((wall - point).norm() >= room_m - 1e-9);
            }
        }

        #[test]
        fn the_share_in_a_prism_is_what_counting_points_says(from in point(), to in point()) {
            const SAMPLES: usize = 2000;
            let zone = &airspace().prisms[0];
            let at = |k: usize| from.lerp(&to, (k as f64 + 0.5) / SAMPLES as f64);
            let counted = (0..SAMPLES).filter(|k| zone.off_m(&at(*k)) < 0.0).count();
            let share = counted as f64 / SAMPLES as f64;
            prop_assert!((zone.share_inside(&from, &to) - share).abs() < 4e-3);
        }
    }
}
