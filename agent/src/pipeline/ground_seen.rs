//! Ground seen: where the range finder that looks down has seen the ground, and whether something else is
//! below now.

use std::collections::VecDeque;

use nalgebra::Vector3;

/// What is so much higher than the ground is not the ground, m: a slope between home and here may be as much.
const COVER_M: f64 = 1.0;
/// Places are remembered this far apart, m, and so many.
const APART_M: f64 = 1.0;
const MOST: usize = 64;

/// The ground on the way so far.
#[derive(Clone, Debug, Default)]
pub struct GroundSeen {
    /// The newest last, m ENU.
    places: VecDeque<Vector3<f64>>,
    is_covered: bool,
}

impl GroundSeen {
    /// Takes in how far below `position` something is, m, where the ground should be at `ground_m`; m ENU.
    pub fn look(&mut self, position: &Vector3<f64>, ground_m: f64, down_m: Option<f64>) {
        self.is_covered = down_m.is_some_and(|down_m| down_m < position.z - ground_m - COVER_M);
        let is_new = self.places.back().is_none_or(|last| (last - position).xy().norm() >= APART_M);
        if down_m.is_some() && !self.is_covered && is_new {
            if self.places.len() == MOST {
                self.places.pop_front();
            }
            self.places.push_back(*position);
        }
    }

    /// Whether something is between the vehicle and the ground.
    pub fn is_covered(&self) -> bool {
        self.is_covered
    }

    /// Where the ground has been seen, the places nearest to `point` first, at its height.
    pub fn places(&self, point: &Vector3<f64>) -> Vec<Vector3<f64>> {
        let away_m = |place: &Vector3<f64>| (place - point).xy().norm();
        let mut places: Vec<_> = self.places.iter().map(|place| place.xy().push(point.z)).collect();
        places.sort_by(|a, b| away_m(a).total_cmp(&away_m(b)));
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flown along x at 6 m, over ground up to 10 m and over a deck at 4 m beyond.
    fn flown_over_a_deck() -> GroundSeen {
        let mut seen = GroundSeen::default();
        for step in 0..150 {
            let x = f64::from(step) * 0.1;
            let down_m = if x < 10.0 { 6.1 } else { 2.0 };
            seen.look(&Vector3::new(x, 0.0, 6.0), 0.0, Some(down_m));
        }
        seen
    }

    #[test]
    fn over_a_deck_the_ground_is_covered_and_was_seen_before_it() {
        let seen = flown_over_a_deck();
        assert!(seen.is_covered());
        let places = seen.places(&Vector3::new(15.0, 0.0, 6.2));
        assert!((8.0..10.0).contains(&places[0].x) && places[0].z == 6.2, "{:?}", places[0]);
        assert!(places.is_sorted_by(|a, b| a.x > b.x));
    }

    #[test]
    fn what_is_not_seen_is_neither_ground_nor_cover() {
        let mut seen = GroundSeen::default();
        seen.look(&Vector3::new(0.0, 0.0, 30.0), 0.0, None);
        assert!(!seen.is_covered() && seen.places(&Vector3::zeros()).is_empty());
        seen.look(&Vector3::new(0.0, 0.0, 6.0), 0.0, Some(5.2));
        assert!(!seen.is_covered(), "a slope");
    }

    #[test]
    fn what_was_seen_long_ago_is_forgotten() {
        let mut seen = GroundSeen::default();
        (0..1000).for_each(|x| seen.look(&Vector3::new(f64::from(x), 0.0, 6.0), 0.0, Some(6.0)));
        assert_eq!(seen.places(&Vector3::zeros()).len(), MOST);
    }
}
