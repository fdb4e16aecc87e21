//! Whether vehicles that fly their routes at their own pace come too near to one another.

use nalgebra::Vector3;

use super::weights::RouteCost;

/// The places of a vehicle over time: it stays at the first before, and at the last after.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    /// Places (ENU, metres), each with its time, s, in order.
    points: Vec<(f64, Vector3<f64>)>,
}

/// Two vehicles that come too near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conflict {
    /// The numbers of the two, from 0.
    pub who: [usize; 2],
    /// When they are nearest, s.
    pub at_s: f64,
    /// Their distance then, metres.
    pub distance_m: f64,
    /// Where the first of them is then (ENU, metres).
    pub place: Vector3<f64>,
}

impl Flight {
    /// Along these points from time 0, at cruise or so many times slower.
    pub fn along(route: &[Vector3<f64>], cost: &RouteCost, slowed: f64) -> Self {
        let mut at_s = 0.0;
        let mut points: Vec<_> = route.first().map(|start| (at_s, *start)).into_iter().collect();
        for leg in route.windows(2) {
            at_s += cost.leg_s(&(leg[1] - leg[0])) * slowed;
            points.push((at_s, leg[1]));
        }
        Self { points }
    }

    /// Its place at a time, s; the origin if it has none.
    fn at(&self, time_s: f64) -> Vector3<f64> {
        let next = self.points.partition_point(|(at_s, _)| *at_s <= time_s);
        let before = next.checked_sub(1).map(|index| self.points[index]);
        match (before, self.points.get(next)) {
            (Some((from_s, from)), Some((to_s, to))) => from.lerp(to, (time_s - from_s) / (to_s - from_s)),
            (Some((_, place)), None) | (None, Some(&(_, place))) => place,
            (None, None) => Vector3::zeros(),
        }
    }

    /// When this one and another are nearest, s, and their distance then, metres.
    fn nearest(&self, other: &Self) -> (f64, f64) {
        let mut times_s: Vec<f64> = self.points.iter().chain(&other.points).map(|(at_s, _)| *at_s).collect();
        times_s.sort_by(f64::total_cmp);
        let apart = |at_s: f64| self.at(at_s) - other.at(at_s);
        let mut least = (0.0, apart(0.0).norm());
        for part in times_s.windows(2) {
            let (before, after) = (apart(part[0]), apart(part[1]));
            let way = after - before;
            let squared = way.norm_squared();
            let share = if squared > 0.0 { (-before.dot(&way) / squared).clamp(0.0, 1.0) } else { 0.0 };
            let distance_m = (before + way * share).norm();
            if distance_m < least.1 {
                least = (part[0] + (part[1] - part[0]) * share, distance_m);
            }
        }
        least
    }
}

/// Every two of the flights that come nearer than `least_m`, metres, at their nearest moment.
pub fn conflicts(flights: &[Flight], least_m: f64) -> Vec<Conflict> {
    let mut found = Vec::new();
    for (one, flight) in flights.iter().enumerate() {
        for (other, beside) in flights.iter().enumerate().skip(one + 1) {
            let (at_s, distance_m) = flight.nearest(beside);
            if distance_m < least_m {
                found.push(Conflict { who: [one, other], at_s, distance_m, place: flight.at(at_s) });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(points: [[f64; 3]; 2], slowed: f64) -> Flight {
        Flight::along(
            &points.map(Vector3::from),
            &RouteCost { cruise_m_s: 2.0, ..RouteCost::default() },
            slowed,
        )
    }

    #[test]
    fn those_who_cross_at_one_moment_are_told_with_place_and_distance() {
        let east = flight([[0.0, 10.0, 5.0], [20.0, 10.0, 5.0]], 1.0);
        let north = flight([[10.0, 0.0, 6.0], [10.0, 20.0, 6.0]], 1.0);
        let found = conflicts(&[east.clone(), north], 2.0);
        let place = Vector3::new(10.0, 10.0, 5.0);
        assert_eq!(found, [Conflict { who: [0, 1], at_s: 5.0, distance_m: 1.0, place }]);
        let later = flight([[10.0, 0.0, 6.0], [10.0, 20.0, 6.0]], 3.0);
        assert!(conflicts(&[east.clone(), later], 2.0).is_empty(), "it has passed by then");
        let standing = Flight::along(&[Vector3::new(20.0, 11.0, 5.0)], &RouteCost::default(), 1.0);
        assert_eq!(conflicts(&[standing, east], 2.0)[0].distance_m, 1.0, "it stays where the other arrives");
    }
}
