//! An airspace that is known beforehand: terrain, threats and no-fly zones.

mod height_grid;
mod keep_out;
mod keeping_off;
mod prism;
mod stay_inside;
mod table;

use nalgebra::{Vector2, Vector3};

pub use height_grid::{HeightGrid, HeightGridError};
pub use keep_out::{KeepOut, places_around};
pub use prism::NoFlyPrism;
pub use stay_inside::{Area, StayInside};
pub use table::{AirspaceError, AirspaceTable};

/// Beyond this many slopes from its peak a mountain has ended: 2 mm are left there of 400 m.
const FOOT_SLOPES: f64 = 3.5;

/// A mountain on flat ground: `z = h exp(-((x - xi) / sx)^2 - ((y - yi) / sy)^2)` (P3, with its centre's
/// coordinates put right).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mountain {
    /// Where its peak is (ENU, metres).
    pub centre: Vector2<f64>,
    /// Height `h` of its peak, metres.
    pub height_m: f64,
    /// Slopes `sx` and `sy`: how far from the peak, along each axis, the height has fallen to `h / e`, metres.
    pub slope_m: Vector2<f64>,
}

/// A place that is seen or shot at from the ground: a hemisphere, `(x - xi)^2 + (y - yi)^2 + z^2 = ri^2`,
/// `z >= 0` (P3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreatZone {
    /// Its centre on the ground (ENU, metres).
    pub centre: Vector2<f64>,
    /// Its radius `ri`, metres.
    pub radius_m: f64,
}

/// A place where nobody may fly: an upright cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoFlyZone {
    /// Its axis (ENU, metres).
    pub centre: Vector2<f64>,
    pub radius_m: f64,
    /// Height of its lower end, metres.
    pub floor_m: f64,
    /// Height of its upper end, metres.
    pub ceiling_m: f64,
}

/// A box of air over flat ground at height 0 (ENU, metres), with what stands in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Airspace {
    pub lower: Vector3<f64>,
    pub upper: Vector3<f64>,
    /// The terrain; where mountains overlap, their heights add up.
    pub mountains: Vec<Mountain>,
    /// Heights that mountains stand on, if the ground under them is not flat.
    pub heights: Option<HeightGrid>,
    /// Threat zones; they are avoided as no-fly zones are.
    pub threats: Vec<ThreatZone>,
    /// No-fly zones that are round.
    pub no_fly: Vec<NoFlyZone>,
    /// No-fly zones over polygons.
    pub prisms: Vec<NoFlyPrism>,
    /// Areas to stay inside of: in each of these.
    pub stay_inside: Vec<StayInside>,
    /// Air that is too low to fly in, but to take off and to land.
    pub low: Vec<Area>,
}

impl Mountain {
    fn height_at_m(&self, x: f64, y: f64) -> f64 {
        let (east, north) = ((x - self.centre.x) / self.slope_m.x, (y - self.centre.y) / self.slope_m.y);
        let slopes_squared = east * east + north * north;
        if slopes_squared < FOOT_SLOPES * FOOT_SLOPES { self.height_m * (-slopes_squared).exp() } else { 0.0 }
    }

    /// Its greatest height in a rectangle, metres: that at the point nearest to its peak.
    fn most_in_m(&self, lower: &Vector2<f64>, upper: &Vector2<f64>) -> f64 {
        let nearest = self.centre.sup(lower).inf(upper);
        self.height_at_m(nearest.x, nearest.y)
    }

    /// Its steepest slope: `h / s sqrt(2 / e)`, at `s / sqrt(2)` from the peak.
    fn steepest(&self) -> f64 {
        self.height_m.abs() / self.slope_m.min() * (2.0 / std::f64::consts::E).sqrt()
    }
}

impl ThreatZone {
    /// Share of the straight way from one point to another that is inside, 0 to 1.
    fn share_inside(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let offset = from - Vector3::new(self.centre.x, self.centre.y, 0.0);
        let way = to - from;
        let ball = within(way.norm_squared(), offset.dot(&way), offset.norm_squared(), self.radius_m);
        overlap(ball, between(from.z, way.z, 0.0, f64::INFINITY))
    }
}

impl NoFlyZone {
    /// Share of the straight way from one point to another that is inside, 0 to 1.
    fn share_inside(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let (offset, way) = (from.xy() - self.centre, to - from);
        let flat = way.xy();
        let disc = within(flat.norm_squared(), offset.dot(&flat), offset.norm_squared(), self.radius_m);
        overlap(disc, between(from.z, way.z, self.floor_m, self.ceiling_m))
    }
}

impl Airspace {
    /// Adds what stands in another one; its heights take the place of this one's, if it has any. The box stays.
    pub fn include(&mut self, other: Airspace) {
        self.mountains.extend(other.mountains);
        self.threats.extend(other.threats);
        self.no_fly.extend(other.no_fly);
        self.prisms.extend(other.prisms);
        self.stay_inside.extend(other.stay_inside);
        self.low.extend(other.low);
        self.heights = other.heights.or(self.heights.take());
    }

    /// Height of the terrain at a place, metres.
    pub fn terrain_m(&self, x: f64, y: f64) -> f64 {
        let ground_m = self.heights.as_ref().map_or(0.0, |heights| heights.height_m(x, y));
        self.mountains.iter().map(|mountain| mountain.height_at_m(x, y)).sum::<f64>() + ground_m
    }

    /// A slope that the terrain does not exceed.
    fn steepest(&self) -> f64 {
        let mountains = self.mountains.iter().map(Mountain::steepest).sum::<f64>();
        self.heights.as_ref().map_or(0.0, HeightGrid::steepest) + mountains
    }

    /// Height of a point above the terrain, metres.
    pub fn clearance_m(&self, point: &Vector3<f64>) -> f64 {
        point.z - self.terrain_m(point.x, point.y)
    }

    /// A height that the terrain under the box between two points does not exceed, metres.
    pub fn terrain_bound_m(&self, one: &Vector3<f64>, other: &Vector3<f64>) -> f64 {
        let (lower, upper) = (one.xy().inf(&other.xy()), one.xy().sup(&other.xy()));
        let ground_m = self.heights.as_ref().map_or(0.0, |heights| heights.most_in_m(&lower, &upper));
        self.mountains.iter().map(|mountain| mountain.most_in_m(&lower, &upper)).sum::<f64>() + ground_m
    }

    /// The length of the straight way between two points in threat and no-fly zones, metres; where zones
    /// overlap, it counts for each. Areas to stay inside of count for nothing here.
    pub fn intrusion_m(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let threats: f64 = self.threats.iter().map(|zone| zone.share_inside(from, to)).sum();
        let no_fly: f64 = self.no_fly.iter().map(|zone| zone.share_inside(from, to)).sum();
        let prisms: f64 = self.prisms.iter().map(|zone| zone.share_inside(from, to)).sum();
        let share = threats + no_fly + prisms;
        if share > 0.0 { share * (to - from).norm() } else { 0.0 }
    }

    /// The point of the box that is nearest to a point.
    pub fn nearest_inside(&self, point: &Vector3<f64>) -> Vector3<f64> {
        point.sup(&self.lower).inf(&self.upper)
    }
}

/// The part of `0..=1` in which `a t^2 + 2 b t + c < r^2`, as its ends.
fn within(a: f64, b: f64, c: f64, r: f64) -> (f64, f64) {
    let outside = c - r * r;
    if a == 0.0 {
        return if outside < 0.0 { (0.0, 1.0) } else { (0.0, 0.0) };
    }
    let discriminant = b * b - a * outside;
    if discriminant <= 0.0 {
        return (0.0, 0.0);
    }
    let half = discriminant.sqrt();
    (((-b - half) / a).clamp(0.0, 1.0), ((-b + half) / a).clamp(0.0, 1.0))
}

/// The part of `0..=1` in which `low < start + change t < high`, as its ends.
fn between(start: f64, change: f64, low: f64, high: f64) -> (f64, f64) {
    if change == 0.0 {
        return if low <= start && start <= high { (0.0, 1.0) } else { (0.0, 0.0) };
    }
    let (one, other) = ((low - start) / change, (high - start) / change);
    (one.min(other).clamp(0.0, 1.0), one.max(other).clamp(0.0, 1.0))
}

fn overlap(one: (f64, f64), other: (f64, f64)) -> f64 {
    (one.1.min(other.1) - one.0.max(other.0)).max(0.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        (-100.0..100.0, -100.0..100.0, -20.0..100.0).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    /// The share of a way's many points at which something holds.
    fn sampled(from: &Vector3<f64>, to: &Vector3<f64>, holds: impl Fn(Vector3<f64>) -> bool) -> f64 {
        const SAMPLES: usize = 2000;
        let inside = |k: &usize| holds(from + (to - from) * ((*k as f64 + 0.5) / SAMPLES as f64));
        (0..SAMPLES).filter(inside).count() as f64 / SAMPLES as f64
    }

    #[test]
    fn a_mountain_is_the_papers() {
        let mountain = Mountain {
            centre: Vector2::new(500.0, 1500.0),
            height_m: 400.0,
            slope_m: Vector2::new(100.0, 200.0),
        };
        let airspace = Airspace { mountains: vec![mountain], ..Airspace::default() };
        assert_eq!(airspace.terrain_m(500.0, 1500.0), 400.0);
        assert!((airspace.terrain_m(600.0, 1500.0) - 400.0 / std::f64::consts::E).abs() < 1e-9);
        assert!((airspace.terrain_m(600.0, 1700.0) - 400.0 * (-2.0_f64).exp()).abs() < 1e-9);
        assert_eq!(airspace.clearance_m(&Vector3::new(500.0, 1500.0, 410.0)), 10.0);
    }

    #[test]
    fn a_way_over_the_middle_of_a_hemisphere_intrudes_by_its_chord() {
        let threats = vec![ThreatZone { centre: Vector2::new(1000.0, 1000.0), radius_m: 400.0 }];
        let airspace = Airspace { threats, ..Airspace::default() };
        let way = |z| airspace.intrusion_m(&Vector3::new(0.0, 1000.0, z), &Vector3::new(2000.0, 1000.0, z));
        assert!((way(0.0) - 800.0).abs() < 1e-9);
        assert!((way(240.0) - 640.0).abs() < 1e-9, "3, 4, 5");
        assert_eq!(way(400.0), 0.0);
        assert_eq!(way(-1.0), 0.0, "there is no zone below the ground");
    }

    proptest! {
        #[test]
        fn the_share_inside_a_zone_is_what_counting_points_says(from in point(), to in point()) {
            let threat = ThreatZone { centre: Vector2::new(10.0, -5.0), radius_m: 60.0 };
            let in_threat = sampled(&from, &to, |p| {
                p.z >= 0.0 && (p - Vector3::new(10.0, -5.0, 0.0)).norm() < 60.0
            });
            prop_assert!((threat.share_inside(&from, &to) - in_threat).abs() < 2e-3);
            let zone = NoFlyZone { centre: Vector2::new(-8.0, 3.0), radius_m: 40.0, floor_m: 10.0, ceiling_m: 50.0 };
            let in_zone = sampled(&from, &to, |p| {
                (10.0..50.0).contains(&p.z) && (p.xy() - zone.centre).norm() < 40.0
            });
            prop_assert!((zone.share_inside(&from, &to) - in_zone).abs() < 2e-3);
        }

        #[test]
        fn no_terrain_rises_above_the_bound(from in point(), to in point(), share in 0.0..1.0_f64) {
            let mountain = |x, height_m| Mountain {
                centre: Vector2::new(x, 0.0),
                height_m,
                slope_m: Vector2::new(12.0, 8.0),
            };
            let mountains = vec![mountain(-40.0, 30.0), mountain(40.0, 50.0)];
            let airspace = Airspace { mountains, ..Airspace::default() };
            let under = from + (to - from) * share;
            prop_assert!(airspace.terrain_m(under.x, under.y) <= airspace.terrain_bound_m(&from, &to));
        }
    }
}
