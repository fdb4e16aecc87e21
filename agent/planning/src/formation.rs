//! Flying in formation: places around a leader, and the velocity that keeps one.

use nalgebra::{Rotation2, Vector2, Vector3};

/// How vehicles fly together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Formation {
    /// Its shape.
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
    #[must_use]
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
    #[must_use]
    pub fn places(&self, leader: &Vector3<f64>, heading_rad: f64, vehicles: usize) -> Vec<Vector3<f64>> {
        let turn = Rotation2::new(heading_rad);
        let place = |vehicle| {
            let offset = turn * self.offset(vehicle);
            leader + Vector3::new(offset.x, offset.y, 0.0)
        };
        (0..vehicles).map(place).collect()
    }
}

/// The velocity that brings a vehicle to its place and keeps it there: `place_velocity + gain (place - position)`, at most
/// `max_m_s` fast. The distance falls by `1 / e` in each `1 / gain` seconds, while the bound is not met.
///
/// Positions ENU, metres; velocities m/s; `gain` 1/s.
#[must_use]
pub fn keep(
    position: &Vector3<f64>,
    place: &Vector3<f64>,
    place_velocity: &Vector3<f64>,
    gain: f64,
    max_m_s: f64,
) -> Vector3<f64> {
    (place_velocity + (place - position) * gain).cap_magnitude(max_m_s)
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

    #[test]
    fn the_distance_to_the_place_falls_as_stated() {
        let (gain, step_s) = (0.8, 0.001);
        let velocity = Vector3::new(3.0, 1.0, 0.0);
        let (mut place, mut position) = (Vector3::zeros(), Vector3::new(0.0, 2.0, 1.0));
        let before_m = (place - position).norm();
        for _ in 0..2500 {
            position += keep(&position, &place, &velocity, gain, 10.0) * step_s;
            place += velocity * step_s;
        }
        let share = (place - position).norm() / before_m;
        assert!((share - (-0.8 * 2.5_f64).exp()).abs() < 1e-3, "{share}");
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
        fn nobody_is_asked_to_fly_faster_than_allowed(x in -50.0..50.0_f64, v in -20.0..20.0_f64) {
            let velocity = keep(&Vector3::new(x, 0.0, 0.0), &Vector3::zeros(), &Vector3::new(v, 0.0, 0.0), 1.0, 5.0);
            prop_assert!(velocity.norm() <= 5.0 + 1e-9);
        }
    }
}
