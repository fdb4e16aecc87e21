//! When a vehicle is stuck in a local minimum of its potential field.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Vector3;

/// A vehicle that does not mean to move for longer than this waits; for less, it is only told late that it may.
const WAITS: Duration = Duration::from_secs(1);

/// When to call a vehicle stuck, and how long to let it escape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscapeConfig {
    /// Progress is judged over this long.
    pub window: Duration,
    /// Least progress over the window, along the path and from place to place, metres.
    pub min_progress_m: f64,
    /// The duration of an escape once begun.
    pub escape_for: Duration,
    /// Share of the attraction that is left during an escape (Wang 2023: the attractive gain is reduced).
    pub attraction: f64,
}

impl Default for EscapeConfig {
    fn default() -> Self {
        EscapeConfig {
            window: Duration::from_secs(3),
            min_progress_m: 0.5,
            escape_for: Duration::from_secs(3),
            attraction: 0.5,
        }
    }
}

/// The detector's verdict on the last window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The vehicle gets on, or it is too early to tell.
    Progressing,
    /// It does not: plan anew. Said once per escape.
    Stuck,
    /// An escape is on: the attraction is reduced.
    Escaping,
}

/// Watches progress along a path; a state machine without a clock. A new path is no progress: a vehicle that finds
/// one after another and stays where it is is stuck.
///
/// ```
/// use std::time::Duration;
/// use nalgebra::Vector3;
/// use skein_planning::local::escape::{EscapeConfig, EscapeDetector, Verdict};
///
/// let mut detector = EscapeDetector::new(EscapeConfig::default());
/// let here = Vector3::new(1.0, 2.0, 3.0);
/// let verdicts: Vec<_> = (0..40).map(|k| detector.update(Duration::from_millis(100 * k), 7.0, &here)).collect();
/// assert_eq!(verdicts[29], Verdict::Progressing);
/// assert_eq!(verdicts[30], Verdict::Stuck);
/// assert_eq!(verdicts[31], Verdict::Escaping);
/// ```
#[derive(Clone, Debug)]
pub struct EscapeDetector {
    config: EscapeConfig,
    /// Time, way along all paths, and place, within the window and one before it.
    progress: VecDeque<(Duration, f64, Vector3<f64>)>,
    /// The way along all paths so far, m.
    along_m: f64,
    /// The station on the newest path.
    station_m: f64,
    escaping_until: Option<Duration>,
}

impl EscapeDetector {
    /// A detector that has seen nothing.
    pub fn new(config: EscapeConfig) -> EscapeDetector {
        let progress = VecDeque::new();
        EscapeDetector { config, progress, along_m: 0.0, station_m: 0.0, escaping_until: None }
    }

    /// The vehicle has got another path; an escape ends.
    pub fn begin_path(&mut self) {
        self.station_m = 0.0;
        self.escaping_until = None;
    }

    /// Takes in how far along its path the vehicle is, metres, and where, at `now` since the run began. Call it while
    /// the vehicle means to move, not while it waits or holds, and [`EscapeDetector::reset`] when it has arrived.
    pub fn update(&mut self, now: Duration, station_m: f64, position: &Vector3<f64>) -> Verdict {
        if self.progress.back().is_some_and(|(last, ..)| now.saturating_sub(*last) > WAITS) {
            self.reset();
        }
        self.along_m += station_m - std::mem::replace(&mut self.station_m, station_m);
        if let Some(until) = self.escaping_until {
            if now < until {
                return Verdict::Escaping;
            }
            self.reset();
        }
        self.progress.push_back((now, self.along_m, *position));
        while let Some((second, ..)) = self.progress.get(1)
            && *second + self.config.window <= now
        {
            self.progress.pop_front();
        }
        let Some((since, from_m, from)) = self.progress.front().copied() else { return Verdict::Progressing };
        let made_m = (self.along_m - from_m).min((position - from).norm());
        if since + self.config.window > now || made_m >= self.config.min_progress_m {
            return Verdict::Progressing;
        }
        self.progress.clear();
        self.escaping_until = Some(now + self.config.escape_for);
        Verdict::Stuck
    }

    /// Forgets what it has seen, and ends an escape.
    pub fn reset(&mut self) {
        self.progress.clear();
        self.escaping_until = None;
    }

    /// The factor for the attraction now: 1, or less during an escape.
    pub fn attraction(&self) -> f64 {
        if self.escaping_until.is_some() { self.config.attraction } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn slow_but_steady_progress_is_progress() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        for k in 0..200 {
            let along_m = 0.02 * k as f64;
            let verdict = detector.update(at(100 * k), along_m, &Vector3::new(along_m, 0.0, 0.0));
            assert_eq!(verdict, Verdict::Progressing);
        }
    }

    #[test]
    fn swinging_back_and_forth_is_not() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let stuck = (0..60)
            .map(|k| if k % 2 == 0 { 5.0 } else { 5.3 })
            .zip(0..)
            .any(|(x, k)| detector.update(at(100 * k), x, &Vector3::new(x, 0.0, 0.0)) == Verdict::Stuck);
        assert!(stuck);
    }

    #[test]
    fn one_new_path_after_another_is_no_progress_for_who_stays_where_it_is() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let stuck = |k: &u64| {
            detector.begin_path();
            // It makes a little way along each, and back again when the next begins.
            let x = if k.is_multiple_of(2) { 0.0 } else { 0.2 };
            let verdicts = [
                detector.update(at(100 * k), 0.0, &Vector3::zeros()),
                detector.update(at(100 * k + 50), x, &Vector3::new(x, 0.0, 0.0)),
            ];
            verdicts.contains(&Verdict::Stuck)
        };
        let stuck: Vec<_> = (0..100).filter(stuck).collect();
        assert_eq!(stuck.len(), 3, "once in each window: {stuck:?}");
    }

    #[test]
    fn a_vehicle_that_gets_on_by_one_new_path_after_another_is_not_stuck() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        for k in 0..100 {
            detector.begin_path();
            let x = 0.1 * k as f64;
            detector.update(at(100 * k), 0.0, &Vector3::new(x, 0.0, 0.0));
            let verdict = detector.update(at(100 * k + 50), 0.05, &Vector3::new(x + 0.05, 0.0, 0.0));
            assert_eq!(verdict, Verdict::Progressing);
        }
    }

    #[test]
    fn an_escape_ends_and_the_window_begins_anew() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let verdicts: Vec<_> =
            (0..=100).map(|k| detector.update(at(100 * k), 1.0, &Vector3::zeros())).collect();
        let stuck: Vec<_> = (0..=100).filter(|k| verdicts[*k] == Verdict::Stuck).collect();
        assert_eq!(stuck, vec![30, 90], "after 3 s; then 3 s of escape and 3 s of window");
        assert!(detector.attraction() < 1.0);
        detector.reset();
        assert_eq!(detector.attraction(), 1.0);
    }

    #[test]
    fn waiting_on_purpose_is_not_being_stuck_but_starting_and_stopping_is() {
        let stuck = |pause: fn(u64) -> bool| {
            let mut detector = EscapeDetector::new(EscapeConfig::default());
            let mut update = |k| detector.update(at(100 * k), 1.0, &Vector3::zeros());
            (0..100).filter(|k| !pause(*k)).any(|k| update(k) == Verdict::Stuck)
        };
        assert!(!stuck(|k| k % 30 < 12), "it waits for 1.2 s");
        assert!(stuck(|k| k % 10 < 3), "for 0.3 s");
    }
}
