//! The way home: back along the way out, cut short where the map lets it be.

use std::time::Duration;

use nalgebra::Vector3;

/// The way is looked at anew this often.
const EVERY: Duration = Duration::from_secs(1);
/// Turns that are kept at most; of more, every second one is forgotten.
const MOST_TURNS: usize = 200;

/// The turns of the way from home to the vehicle.
#[derive(Clone, Debug)]
pub struct WayHome {
    /// From above home outwards.
    turns: Vec<Vector3<f64>>,
    /// The vehicle's place when the way was looked at last, m ENU.
    last: Option<(Duration, Vector3<f64>)>,
}

impl WayHome {
    /// The way of a vehicle that is at home; `above_home` is where it ends, m ENU.
    pub fn new(above_home: Vector3<f64>) -> Self {
        Self { turns: vec![above_home], last: None }
    }

    /// The vehicle has come `here`, m ENU; `is_clear` tells whether it may fly straight from one place to another.
    pub fn follow(
        &mut self,
        now: Duration,
        here: Vector3<f64>,
        is_clear: impl Fn(&Vector3<f64>, &Vector3<f64>) -> bool,
    ) {
        let is_due = self.last.is_none_or(|(at, _)| now.saturating_sub(at) >= EVERY);
        if !is_due {
            return;
        }
        let last = self.last.replace((now, here));
        match (self.turns.iter().position(|turn| is_clear(turn, &here)), last) {
            (Some(seen), _) => self.turns.truncate(seen + 1),
            (None, Some((_, before))) => self.turns.push(before),
            (None, None) => {}
        }
        if self.turns.len() > MOST_TURNS {
            let mut keep = false;
            self.turns.retain(|_| {
                keep = !keep;
                keep
            });
        }
    }

    /// The places to pass from `here` to above home.
    pub fn from(&self, here: Vector3<f64>) -> impl Iterator<Item = Vector3<f64>> + '_ {
        std::iter::once(here).chain(self.turns.iter().rev().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: f64 = 3.0;

    /// The length of the way home after a flight past these corners, at 2 m/s, around a wall from (10, -5) northwards
    /// without end, if there is one.
    fn length_m(corners: &[[f64; 2]], has_wall: bool) -> f64 {
        let clear = |a: &Vector3<f64>, b: &Vector3<f64>| {
            let share = (10.0 - a.x) / (b.x - a.x);
            !has_wall || !(0.0..=1.0).contains(&share) || a.y + share * (b.y - a.y) < -5.0
        };
        let mut way = WayHome::new(Vector3::new(0.0, 0.0, UP));
        let mut here = Vector3::new(0.0, 0.0, UP);
        let mut now = Duration::ZERO;
        for corner in corners {
            let to = Vector3::new(corner[0], corner[1], UP);
            while here != to {
                now += Duration::from_secs(1);
                here += (to - here).cap_magnitude(2.0);
                way.follow(now, here, clear);
            }
        }
        let places: Vec<_> = way.from(here).collect();
        places.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
    }

    #[test]
    fn in_the_open_it_is_straight_however_long_the_way_out() {
        let survey: Vec<_> = (0..20).map(|n| [f64::from(n % 4 / 2) * 50.0, f64::from(n / 2)]).collect();
        let [x, y] = survey[19];
        assert!((length_m(&survey, false) - x.hypot(y)).abs() < 1e-9);
    }

    #[test]
    fn around_what_stands_in_the_way_it_is_as_long_as_it_must_be() {
        let around = [[0.0, -8.0], [20.0, -8.0], [20.0, 0.0]];
        let shortest_m = 2.0 * 10.0_f64.hypot(5.0);
        let found_m = length_m(&around, true);
        assert!((shortest_m..shortest_m + 5.0).contains(&found_m), "{found_m} for {shortest_m}");
        // Back again, it is straight again.
        let back = [around.as_slice(), &[[20.0, -8.0], [0.0, -8.0]]].concat();
        assert!((length_m(&back, true) - 8.0).abs() < 1e-9);
    }
}
