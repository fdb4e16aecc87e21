//! Hard brakes of the safety filter: for what was seen too late to stop gently.

use std::time::Duration;

use nalgebra::Vector3;

use super::local::TICK_S;

/// A deceleration beyond this is hard, m/s^2: that of a tilt of 5 degrees.
const HARD_M_S2: f64 = 0.858;
/// Set-points that follow within this belong to the same stop.
const SAME_STOP: Duration = Duration::from_secs(2);

/// Counts the stops that the filter, not the planner, asked for and that tilt the vehicle by more than 5 degrees.
#[derive(Clone, Copy, Debug, Default)]
pub struct HardBrakes {
    pub count: u64,
    last: Option<Duration>,
    /// The set-point before (ENU, m/s).
    before: Vector3<f64>,
}

impl HardBrakes {
    /// Takes in the velocity that was desired, and what the filter made of it.
    pub fn take_in(&mut self, now: Duration, desired: &Vector3<f64>, flown: &Vector3<f64>) {
        let before = std::mem::replace(&mut self.before, *flown).xy().norm();
        let brakes = |velocity: &Vector3<f64>| before - velocity.xy().norm() > HARD_M_S2 * TICK_S;
        if !brakes(flown) || brakes(desired) {
            return;
        }
        if self.last.is_none_or(|last| now.saturating_sub(last) > SAME_STOP) {
            self.count += 1;
        }
        self.last = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(set_points: impl IntoIterator<Item = (u64, f64, f64)>) -> u64 {
        let mut brakes = HardBrakes::default();
        for (ms, desired, flown) in set_points {
            let [desired, flown] = [desired, flown].map(|speed| Vector3::new(speed, 0.0, 0.0));
            brakes.take_in(Duration::from_millis(ms), &desired, &flown);
        }
        brakes.count
    }

    #[test]
    fn a_stop_counts_once_and_the_next_one_again() {
        let stop = |from_ms: u64| {
            (0..20_u32).map(move |k| (from_ms + 20 * u64::from(k), 5.0, 5.0 - 0.07 * f64::from(k)))
        };
        assert_eq!(counted(stop(0)), 1);
        assert_eq!(counted(stop(0).chain(stop(5000))), 2);
    }

    #[test]
    fn what_the_planner_asks_for_itself_and_what_is_gentle_do_not_count() {
        assert_eq!(counted([(0, 5.0, 5.0), (20, 4.0, 4.0)]), 0);
        assert_eq!(counted((0..50_u32).map(|k| (20 * u64::from(k), 5.0, 5.0 - 0.01 * f64::from(k)))), 0);
    }
}
