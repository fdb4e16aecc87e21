//! Ways: the shortest between places in a field, around its notches and what is closed in it.

use nalgebra::Vector2;

use super::field::Field;

/// The places where ways begin, end and turn, and how far it is straight from one to another.
#[derive(Debug)]
pub struct Ways {
    places: Vec<Vector2<f64>>,
    /// Row by row, metres; infinite where it is not open.
    straight_m: Vec<f64>,
}

/// The shortest ways from one place to all.
#[derive(Debug)]
pub struct From {
    pub length_m: Vec<f64>,
    before: Vec<usize>,
}

impl Ways {
    /// Ways between `ends`, which keep their numbers.
    pub fn new(field: &Field<'_>, ends: Vec<Vector2<f64>>) -> Self {
        let mut places = ends;
        places.extend(field.turns());
        let count = places.len();
        let mut straight_m = vec![f64::INFINITY; count * count];
        for one in 0..count {
            for other in 0..one {
                if field.is_open(&places[one], &places[other]) {
                    let length_m = (places[one] - places[other]).norm();
                    straight_m[one * count + other] = length_m;
                    straight_m[other * count + one] = length_m;
                }
            }
        }
        Self { places, straight_m }
    }

    /// The shortest ways from a place (Dijkstra 1959), `O(places^2)`.
    pub fn from(&self, start: usize) -> From {
        let count = self.places.len();
        let (mut length_m, mut before) = (vec![f64::INFINITY; count], vec![start; count]);
        let mut is_open = vec![true; count];
        length_m[start] = 0.0;
        let nearest = |length_m: &[f64], is_open: &[bool]| {
            let open = (0..count).filter(|place| is_open[*place] && length_m[*place].is_finite());
            open.min_by(|one, other| length_m[*one].total_cmp(&length_m[*other]))
        };
        while let Some(at) = nearest(&length_m, &is_open) {
            is_open[at] = false;
            for to in 0..count {
                let through_m = length_m[at] + self.straight_m[at * count + to];
                if through_m < length_m[to] {
                    (length_m[to], before[to]) = (through_m, at);
                }
            }
        }
        From { length_m, before }
    }

    /// The places between the beginning of a way and its end.
    pub fn between(&self, from: &From, to: usize) -> Vec<Vector2<f64>> {
        let mut way = Vec::new();
        let mut at = from.before[to];
        while from.length_m[at] > 0.0 {
            way.push(self.places[at]);
            at = from.before[at];
        }
        way.reverse();
        way
    }
}
