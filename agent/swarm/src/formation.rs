//! Flying in formation: places around a leader, and routes that keep them.

use nalgebra::{Rotation2, Vector2, Vector3};

/// A formation: the places of vehicles that fly together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Formation {
    pub shape: Shape,
    /// Distance between neighbours, metres.
    pub spacing_m: f64,
}

/// The shape of a formation. The leader, the first vehicle, is at its head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One behind another.
    Column,
    /// Side by side: second to the left of the leader, third to its right, and so on.
    Line,
    /// A wedge, as geese fly: two arms that trail the leader at 45 degrees, left first.
    Wedge,
}

impl Formation {
    /// The place of a vehicle, 0 the leader, relative to the leader: ahead and to the left, metres.
    pub fn offset(&self, vehicle: usize) -> Vector2<f64> {
        let rank = vehicle.div_ceil(2) as f64;
        let side = if vehicle.is_multiple_of(2) { -1.0 } else { 1.0 };
        let offset = match self.shape {
            Shape::Column => Vector2::new(-(vehicle as f64), 0.0),
            Shape::Line => Vector2::new(0.0, side * rank),
            Shape::Wedge => Vector2::new(-rank, side * rank) * std::f64::consts::FRAC_1_SQRT_2,
        };
        offset * self.spacing_m
    }

    /// The places of so many vehicles (ENU, metres), with the leader at `leader`, heading along `heading_rad`
    /// (counter-clockwise from east). All at the leader's height.
    pub fn places(&self, leader: &Vector3<f64>, heading_rad: f64, vehicles: usize) -> Vec<Vector3<f64>> {
        let turn = Rotation2::new(heading_rad);
        let place = |vehicle| {
            let offset = turn * self.offset(vehicle);
            leader + Vector3::new(offset.x, offset.y, 0.0)
        };
        (0..vehicles).map(place).collect()
    }

    /// The routes of so many vehicles whose leader flies along `leader` (ENU, metres), the leader's first. The
    /// formation heads along the leader's first leg that leads anywhere over ground, and is shifted without being
    /// turned: all routes are the leader's, moved aside. So all are equally long, and vehicles that set out together
    /// and are equally fast keep their places, around corners too.
    pub fn routes(&self, leader: &[Vector3<f64>], vehicles: usize) -> Vec<Vec<Vector3<f64>>> {
        let mut legs = leader.windows(2).map(|leg| (leg[1] - leg[0]).xy());
        let ahead = legs.find(|leg| *leg != Vector2::zeros()).unwrap_or_else(Vector2::x);
        let places = self.places(&Vector3::zeros(), ahead.y.atan2(ahead.x), vehicles);
        places.iter().map(|place| leader.iter().map(|point| point + place).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SHAPES: [Shape; 3] = [Shape::Column, Shape::Line, Shape::Wedge];

    #[test]
    fn geese_fly_in_a_wedge() {
        let wedge = Formation { shape: Shape::Wedge, spacing_m: 2.0_f64.sqrt() };
        let places = wedge.places(&Vector3::new(10.0, 0.0, 5.0), std::f64::consts::FRAC_PI_2, 3);
        let expected = [[10.0, 0.0, 5.0], [9.0, -1.0, 5.0], [11.0, -1.0, 5.0]].map(Vector3::from);
        assert!(
            places.iter().zip(expected).all(|(place, expected)| (place - expected).norm() < 1e-9),
            "{places:?}"
        );
    }

    /// Where one who flies along a route at 1 m/s is after so many seconds.
    fn after(route: &[Vector3<f64>], mut seconds: f64) -> Vector3<f64> {
        for leg in route.windows(2) {
            let length_m = (leg[1] - leg[0]).norm();
            if seconds <= length_m {
                return leg[0] + (leg[1] - leg[0]) * (seconds / length_m);
            }
            seconds -= length_m;
        }
        route[route.len() - 1]
    }

    proptest! {
        #[test]
        fn no_two_places_are_closer_than_the_spacing(
            shape in prop::sample::select(SHAPES.to_vec()),
            heading_rad in -4.0..4.0_f64,
            vehicles in 1..12_usize,
        ) {
            let places = Formation { shape, spacing_m: 3.0 }.places(&Vector3::zeros(), heading_rad, vehicles);
            prop_assert_eq!(places[0], Vector3::zeros());
            for (k, one) in places.iter().enumerate() {
                for other in &places[..k] {
                    prop_assert!((one - other).norm() > 3.0 - 1e-9);
                }
            }
        }

        #[test]
        fn who_flies_the_routes_keeps_its_place_at_all_times(
            shape in prop::sample::select(SHAPES.to_vec()),
            legs in prop::collection::vec((-20.0..20.0_f64, -20.0..20.0_f64, -2.0..2.0_f64), 1..6),
            seconds in 0.0..120.0_f64,
        ) {
            let mut leader = vec![Vector3::new(3.0, 4.0, 30.0)];
            for (x, y, z) in legs {
                leader.push(leader[leader.len() - 1] + Vector3::new(x, y, z));
            }
            let formation = Formation { shape, spacing_m: 3.0 };
            let ahead = leader[1] - leader[0];
            let routes = formation.routes(&leader, 7);
            prop_assert_eq!(&routes[0], &leader);
            let places = formation.places(&after(&leader, seconds), ahead.y.atan2(ahead.x), 7);
            for (route, place) in routes.iter().zip(places) {
                prop_assert!((after(route, seconds) - place).norm() < 1e-6);
            }
        }
    }
}
