//! An airspace as a planner of points sees it: zones grown by the distance that is kept from them.

use nalgebra::{Vector2, Vector3};

use super::{Airspace, NoFlyPrism, NoFlyZone, ThreatZone};

/// Steps along a line are no shorter than this share of its length: what a line cuts off by less counts for nothing.
const SHORTEST: f64 = 0.01;

impl Airspace {
    /// The same with its threats and no-fly zones grown by a margin, and its box shrunk by it, metres. Terrain stays,
    /// and so do areas to stay inside of.
    #[must_use]
    pub fn keeping_off(&self, margin_m: f64) -> Airspace {
        let inset = Vector3::repeat(margin_m);
        let threat = |zone: &ThreatZone| ThreatZone { radius_m: zone.radius_m + margin_m, ..*zone };
        let outlines = self.prisms.iter().flat_map(|prism| prism.corners.iter().map(move |at| (prism, at)));
        let corner = |(prism, at): (&NoFlyPrism, &Vector2<f64>)| NoFlyZone {
            centre: *at,
            radius_m: 0.0,
            floor_m: prism.floor_m,
            ceiling_m: prism.ceiling_m,
        };
        let round = self.no_fly.iter().copied().chain(outlines.map(corner));
        Airspace {
            lower: self.lower + inset,
            upper: self.upper - inset,
            threats: self.threats.iter().map(threat).collect(),
            no_fly: round.map(|zone| zone.grown(margin_m)).collect(),
            prisms: self.prisms.iter().flat_map(|prism| prism.grown_but_for_corners(margin_m)).collect(),
            ..self.clone()
        }
    }

    /// The length of the straight way between two points that is outside of areas to stay inside of, or nearer to their
    /// border than so many metres; where several are left, it counts once. Metres.
    pub fn outside_m(&self, from: &Vector3<f64>, to: &Vector3<f64>, margin_m: f64) -> f64 {
        if self.stay_inside.is_empty() {
            return 0.0;
        }
        let length_m = (to - from).norm();
        let (mut at_m, mut outside_m) = (0.0, 0.0);
        while at_m < length_m {
            let point = from.lerp(to, at_m / length_m);
            let rooms = self.stay_inside.iter().map(|area| area.room_m(&point) - margin_m);
            let room_m = rooms.fold(f64::INFINITY, f64::min);
            let step_m = room_m.abs().max(SHORTEST * length_m).min(length_m - at_m);
            outside_m += if room_m < 0.0 { step_m } else { 0.0 };
            at_m += step_m;
        }
        outside_m
    }
}

impl NoFlyZone {
    fn grown(&self, margin_m: f64) -> Self {
        Self {
            radius_m: self.radius_m + margin_m,
            floor_m: self.floor_m - margin_m,
            ceiling_m: self.ceiling_m + margin_m,
            ..*self
        }
    }
}

impl NoFlyPrism {
    /// The prism and, beyond each edge, as much as the margin; around its corners there is more.
    fn grown_but_for_corners(&self, margin_m: f64) -> Vec<Self> {
        let (floor_m, ceiling_m) = (self.floor_m - margin_m, self.ceiling_m + margin_m);
        let beside = self.edges().filter_map(|(from, to)| {
            let along = (to - from).try_normalize(1e-9)?;
            let aside = Vector2::new(-along.y, along.x) * margin_m;
            Some(vec![from + aside, to + aside, to - aside, from - aside])
        });
        std::iter::once(self.corners.clone())
            .chain(beside)
            .map(|corners| Self { corners, floor_m, ceiling_m })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{Area, KeepOut, StayInside};
    use super::*;

    fn corners() -> Vec<Vector2<f64>> {
        [[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [10.0, 4.0], [0.0, 10.0]].map(Vector2::from).to_vec()
    }

    proptest! {
        #[test]
        fn a_point_is_in_a_grown_zone_if_it_is_nearer_than_the_margin(
            x in -8.0..28.0_f64, y in -8.0..18.0_f64, z in 0.0..30.0_f64
        ) {
            let airspace = Airspace {
                threats: vec![ThreatZone { centre: Vector2::new(-5.0, 15.0), radius_m: 6.0 }],
                no_fly: vec![NoFlyZone { centre: Vector2::new(25.0, -5.0), radius_m: 3.0, floor_m: 5.0, ceiling_m: 9.0 }],
                prisms: vec![NoFlyPrism { corners: corners(), floor_m: 2.0, ceiling_m: 12.0 }],
                ..Airspace::default()
            };
            let (at, beside) = (Vector3::new(x, y, z), Vector3::new(x + 1e-6, y, z));
            let room_m = KeepOut::new(airspace.clone(), 0.0, 0.0).bare_room_m(&at);
            let is_inside = airspace.keeping_off(2.0).intrusion_m(&at, &beside) > 0.0;
            // Above and beside at once, the grown zone has an edge where the distance is round.
            if room_m < 1.9 {
                prop_assert!(is_inside, "{room_m} m");
            } else if room_m > 2.0 * 2.0_f64.sqrt() + 0.1 {
                prop_assert!(!is_inside, "{room_m} m");
            }
        }
    }

    #[test]
    fn who_leaves_an_area_or_comes_near_its_border_is_outside_for_so_long() {
        let yard = StayInside { any_of: vec![Area::round(Vector2::zeros(), 50.0)] };
        let airspace = Airspace { stay_inside: vec![yard], ..Airspace::default() };
        let way =
            |to: f64, margin_m| airspace.outside_m(&Vector3::zeros(), &Vector3::new(to, 0.0, 5.0), margin_m);
        assert_eq!(way(45.0, 0.0), 0.0);
        assert!((way(100.0, 0.0) - 50.0).abs() < 2.0);
        assert!((way(100.0, 10.0) - 60.0).abs() < 2.0);
        assert_eq!(Airspace::default().outside_m(&Vector3::zeros(), &Vector3::new(9.0, 0.0, 0.0), 1.0), 0.0);
    }
}
