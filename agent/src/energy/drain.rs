//! Drain: how fast the battery empties, from a charge that is told in whole per cents.

use std::collections::VecDeque;
use std::time::Duration;

/// A charge is known to within one such step.
const STEP: f64 = 0.01;
/// The drain of this long counts by itself, if it is greater than that of the whole flight.
const RECENT: Duration = Duration::from_secs(60);
/// Over less than this no drain is measured: until then as if it had lasted so long.
const LEAST: Duration = Duration::from_secs(10);

/// The charges of one flight.
#[derive(Clone, Debug, Default)]
pub struct Drain {
    first: Option<(Duration, f64)>,
    /// Each charge of late that differs from the one before, with when it was told; one of them may be older.
    recent: VecDeque<(Duration, f64)>,
}

impl Drain {
    /// Takes in a charge, 0 to 1.
    pub fn take_in(&mut self, now: Duration, charge: f64) {
        self.first.get_or_insert((now, charge));
        if self.recent.back().is_none_or(|(_, last)| *last != charge) {
            self.recent.push_back((now, charge));
        }
        while self.recent.get(1).is_some_and(|(at, _)| now.saturating_sub(*at) >= RECENT) {
            self.recent.pop_front();
        }
    }

    /// The greatest share of the battery per second that the charges leave possible, over the whole flight or of
    /// late; `None` before the first charge.
    pub fn worst_per_s(&self, now: Duration) -> Option<f64> {
        let (_, last) = *self.recent.back()?;
        let since = |&(at, charge): &(Duration, f64)| {
            let lasted = now.saturating_sub(at).max(LEAST);
            (charge - last + STEP).max(0.0) / lasted.as_secs_f64()
        };
        let long_enough = |(at, _): &&(Duration, f64)| now.saturating_sub(*at) >= RECENT;
        let recent = self.recent.front().filter(long_enough);
        self.first.iter().chain(recent).map(since).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: Duration = Duration::from_secs(1);

    /// The drain after so many seconds that each take `drain_per_s`, told in whole per cents.
    fn flown(drain: &mut Drain, from_s: u32, to_s: u32, mut charge: f64, drain_per_s: f64) -> (f64, f64) {
        for second in from_s..to_s {
            charge -= drain_per_s;
            drain.take_in(S * second, (charge * 100.0).round() / 100.0);
        }
        (charge, drain.worst_per_s(S * (to_s - 1)).unwrap())
    }

    #[test]
    fn it_is_never_less_than_what_was_drained_and_soon_near_it() {
        for per_s in [0.0005, 0.001, 0.0057] {
            for seconds in [30, 60, 150] {
                let (_, worst) = flown(&mut Drain::default(), 0, seconds, 0.97, per_s);
                let slack = 0.012 / f64::from(seconds.min(60));
                assert!((per_s..per_s + 2.0 * slack).contains(&worst), "{per_s} in {seconds} s: {worst}");
            }
        }
    }

    #[test]
    fn what_is_drained_of_late_counts_if_it_is_more() {
        let mut drain = Drain::default();
        let (charge, slow) = flown(&mut drain, 0, 120, 0.97, 0.001);
        let (charge, fast) = flown(&mut drain, 120, 200, charge, 0.004);
        assert!(slow < 0.0013 && (0.004..0.0043).contains(&fast), "{slow}, {fast}");
        let (_, after) = flown(&mut drain, 200, 300, charge, 0.001);
        assert!((0.0018..0.0019).contains(&after), "the whole flight: {after}");
    }

    #[test]
    fn before_it_is_measured_a_step_in_ten_seconds_is_assumed() {
        let mut drain = Drain::default();
        assert_eq!(drain.worst_per_s(S), None);
        drain.take_in(S, 0.9);
        assert_eq!(drain.worst_per_s(S), Some(0.001));
    }
}
