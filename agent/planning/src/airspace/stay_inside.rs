//! An area that nobody may leave.

use nalgebra::{Vector2, Vector3};

use super::{NoFlyPrism, NoFlyZone};

/// A part of the air that is stayed inside of; its heights count too.
#[derive(Clone, Debug, PartialEq)]
pub enum Area {
    Round(NoFlyZone),
    Cornered(NoFlyPrism),
}

impl Area {
    /// A circle at all heights; centre ENU, lengths in metres.
    pub fn round(centre: Vector2<f64>, radius_m: f64) -> Self {
        let (floor_m, ceiling_m) = (f64::NEG_INFINITY, f64::INFINITY);
        Self::Round(NoFlyZone { centre, radius_m, floor_m, ceiling_m })
    }

    /// A polygon at all heights, with its corners in order (ENU, metres).
    pub fn cornered(corners: Vec<Vector2<f64>>) -> Self {
        let (floor_m, ceiling_m) = (f64::NEG_INFINITY, f64::INFINITY);
        Self::Cornered(NoFlyPrism { corners, floor_m, ceiling_m })
    }

    /// Distance to its border, metres; negative outside.
    fn depth_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Round(zone) => -zone.off_m(point),
            Self::Cornered(zone) => -zone.off_m(point),
        }
    }

    /// Distance from it, metres; negative inside.
    pub(super) fn off_m(&self, point: &Vector3<f64>) -> f64 {
        -self.depth_m(point)
    }

    /// Its points that are nearest to `point`, which is outside: one, or one for each edge.
    pub(super) fn nearest(&self, point: &Vector3<f64>) -> Vec<Vector3<f64>> {
        match self {
            Self::Round(zone) => vec![zone.nearest(point)],
            Self::Cornered(zone) => zone.nearest(point),
        }
    }

    /// Points of its upright border that are nearest to `point`, at its height: one, or one for each edge.
    fn border(&self, point: &Vector3<f64>) -> Vec<Vector3<f64>> {
        match self {
            Self::Round(zone) => {
                let outwards = (point.xy() - zone.centre).try_normalize(1e-9).unwrap_or(Vector2::x());
                vec![(zone.centre + outwards * zone.radius_m).push(point.z)]
            }
            Self::Cornered(zone) => {
                zone.nearest_on_edges(point.xy()).map(|level| level.push(point.z)).collect()
            }
        }
    }
}

/// Everywhere outside of all these areas is closed: who is in one of them is inside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StayInside {
    pub any_of: Vec<Area>,
}

impl StayInside {
    /// Distance to the outside, metres: a lower bound. Negative outside.
    pub fn room_m(&self, point: &Vector3<f64>) -> f64 {
        self.any_of.iter().map(|area| area.depth_m(point)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The points of the border that are nearest to `point`, one for each edge and circle.
    pub(super) fn border(&self, point: &Vector3<f64>) -> Vec<Vector3<f64>> {
        let is_on_the_border = |(index, place): &(usize, Vector3<f64>)| {
            let mut others = self.any_of.iter().enumerate().filter(|(other, _)| other != index);
            others.all(|(_, area)| area.depth_m(place) <= 0.0)
        };
        let places = self
            .any_of
            .iter()
            .enumerate()
            .flat_map(|(index, area)| area.border(point).into_iter().map(move |place| (index, place)));
        places.filter(is_on_the_border).map(|(_, place)| place).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::airspace::{Airspace, KeepOut};

    fn corners(places: &[[f64; 2]]) -> Vec<Vector2<f64>> {
        places.iter().map(|place| Vector2::from(*place)).collect()
    }

    /// An L whose notch is north-east.
    fn l() -> StayInside {
        let outline = [[0.0, 0.0], [60.0, 0.0], [60.0, 20.0], [20.0, 20.0], [20.0, 60.0], [0.0, 60.0]];
        StayInside { any_of: vec![Area::cornered(corners(&outline))] }
    }

    fn keep_out(stay_inside: Vec<StayInside>) -> KeepOut {
        KeepOut::new(Airspace { stay_inside, ..Airspace::default() }, 1.0, 0.0)
    }

    #[test]
    fn outside_an_area_to_stay_inside_of_all_is_closed_and_next_to_its_border_too() {
        let room = |x, y| keep_out(vec![l()]).room_m(&Vector3::new(x, y, 5.0));
        assert_eq!((room(10.0, 30.0), room(10.0, 0.5), room(30.0, 30.0)), (9.0, -0.5, -11.0));
        let across =
            keep_out(vec![l()]).inside_m(&Vector3::new(50.0, 10.0, 5.0), &Vector3::new(10.0, 50.0, 5.0));
        assert!(across > 20.0, "the way over the notch: {across}");
    }

    #[test]
    fn of_areas_in_one_any_will_do_and_of_several_each_must_hold() {
        let west = || Area::round(Vector2::new(-5.0, 0.0), 10.0);
        let east = || Area::round(Vector2::new(5.0, 0.0), 10.0);
        let room = |zones: Vec<StayInside>, x| keep_out(zones).bare_room_m(&Vector3::new(x, 0.0, 5.0));
        let either = || vec![StayInside { any_of: vec![west(), east()] }];
        let both = || vec![StayInside { any_of: vec![west()] }, StayInside { any_of: vec![east()] }];
        assert_eq!((room(either(), 10.0), room(both(), 10.0), room(both(), 0.0)), (5.0, -5.0, 5.0));
        assert_eq!(room(vec![StayInside::default()], 0.0), f64::NEG_INFINITY, "none of none");
    }

    #[test]
    fn walls_are_on_the_border_and_none_inside_another_area() {
        let wall = keep_out(vec![l()]).walls(&Vector3::new(18.0, 40.0, 5.0), 4.0);
        assert_eq!(wall, vec![Vector3::new(20.0, 40.0, 5.0)]);
        let any_of = vec![
            Area::round(Vector2::new(0.0, 0.0), 10.0),
            Area::cornered(corners(&[[5.0, -3.0], [30.0, -3.0], [30.0, 3.0], [5.0, 3.0]])),
        ];
        let walls = keep_out(vec![StayInside { any_of }]).walls(&Vector3::new(8.0, 0.0, 5.0), 2.5);
        assert_eq!(walls, Vec::<Vector3<f64>>::new(), "the way from one to the other is free");
    }

    proptest! {
        #[test]
        fn room_is_negative_exactly_outside(x in -20.0..80.0_f64, y in -20.0..80.0_f64) {
            let is_inside = (0.0..60.0).contains(&x)
                && (0.0..60.0).contains(&y)
                && (x < 20.0 || y < 20.0);
            prop_assert_eq!(l().room_m(&Vector3::new(x, y, 3.0)) > 0.0, is_inside);
        }
    }
}
