//! When a vehicle is stuck in a local minimum of its potential field.

use std::collections::VecDeque;
use std::time::Duration;

/// When to call a vehicle stuck, and how long to let it escape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscapeConfig {
    /// Progress is judged over this long.
    pub window: Duration,
    /// Least progress along the path over the window, metres.
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

/// Watches progress along a path; a state machine without a clock.
///
/// ```
/// use std::time::Duration;
/// use skein_planning::local::escape::{EscapeConfig, EscapeDetector, Verdict};
///
/// let mut detector = EscapeDetector::new(EscapeConfig::default());
/// let verdicts: Vec<_> = (0..40).map(|k| detector.update(Duration::from_millis(100 * k), 7.0)).collect();
/// assert_eq!(verdicts[29], Verdict::Progressing);
/// assert_eq!(verdicts[30], Verdict::Stuck);
/// assert_eq!(verdicts[31], Verdict::Escaping);
/// ```
#[derive(Clone, Debug)]
pub struct EscapeDetector {
    config: EscapeConfig,
    /// Time and station, within the window and one before it.
    progress: VecDeque<(Duration, f64)>,
    escaping_until: Option<Duration>,
}

impl EscapeDetector {
    /// A detector that has seen nothing.
    pub fn new(config: EscapeConfig) -> EscapeDetector {
        EscapeDetector { config, progress: VecDeque::new(), escaping_until: None }
    }

    /// Takes in how far along its path the vehicle is, metres, at `now` since the run began. Call it while
    /// the vehicle means to move, and [`EscapeDetector::reset`] when it waits, holds, or gets another path.
    pub fn update(&mut self, now: Duration, station_m: f64) -> Verdict {
        if let Some(until) = self.escaping_until {
            if now < until {
                return Verdict::Escaping;
            }
            self.reset();
        }
        self.progress.push_back((now, station_m));
        while let Some((second, _)) = self.progress.get(1)
            && *second + self.config.window <= now
        {
            self.progress.pop_front();
        }
        let Some((since, from_m)) = self.progress.front().copied() else { return Verdict::Progressing };
        if since + self.config.window > now || station_m - from_m >= self.config.min_progress_m {
            return Verdict::Progressing;
        }
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
            assert_eq!(detector.update(at(100 * k), 0.02 * k as f64), Verdict::Progressing);
        }
    }

    #[test]
    fn swinging_back_and_forth_is_not() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let stuck = (0..60)
            .any(|k| detector.update(at(100 * k), if k % 2 == 0 { 5.0 } else { 5.3 }) == Verdict::Stuck);
        assert!(stuck);
    }

    #[test]
    fn an_escape_ends_and_the_window_begins_anew() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let verdicts: Vec<_> = (0..=100).map(|k| detector.update(at(100 * k), 1.0)).collect();
        let stuck: Vec<_> = (0..=100).filter(|k| verdicts[*k] == Verdict::Stuck).collect();
        assert_eq!(stuck, vec![30, 90], "after 3 s; then 3 s of escape and 3 s of window");
        assert!(detector.attraction() < 1.0);
        detector.reset();
        assert_eq!(detector.attraction(), 1.0);
    }

    #[test]
    fn waiting_on_purpose_is_not_being_stuck() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        for k in 0..100 {
            if k % 20 == 0 {
                detector.reset();
            }
            assert_eq!(detector.update(at(100 * k), 1.0), Verdict::Progressing);
        }
    }
}
