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
    /// A vehicle is in a local minimum once no more than this share of the pull along its path is left, on average,
    /// when what repels it is taken off; 0 to go by progress alone.
    pub balance: f64,
    /// ... for this long.
    pub balanced_for: Duration,
    /// Share of the attraction that is left during an escape (Wang 2023: the attractive gain is reduced).
    pub attraction: f64,
}

impl Default for EscapeConfig {
    fn default() -> Self {
        EscapeConfig {
            window: Duration::from_secs(3),
            min_progress_m: 0.5,
            escape_for: Duration::from_secs(3),
            balance: 0.15,
            balanced_for: Duration::from_secs(1),
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
    /// The forces on it cancel: plan another way. Said once per escape.
    Trapped,
    /// An escape is on: the attraction is reduced.
    Escaping,
}

/// The forces on a vehicle, as velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forces {
    /// The pull along the path, ENU, m/s.
    pub pull: Vector3<f64>,
    /// The rest of it beside all that repels, ENU, m/s.
    pub net: Vector3<f64>,
}

/// Weaker than this a pull is no more than holding a place, m/s.
const LEAST_PULL_M_S: f64 = 0.2;
/// Share of the newest forces in their mean, a tenth of a second after the ones before.
const NEWEST: f64 = 0.15;

impl Forces {
    fn mean(self, newest: Forces) -> Forces {
        Forces { pull: self.pull.lerp(&newest.pull, NEWEST), net: self.net.lerp(&newest.net, NEWEST) }
    }

    /// Whether no more than this share of the pull is left.
    fn cancel(&self, share: f64) -> bool {
        self.pull.norm() > LEAST_PULL_M_S && self.net.norm() < share * self.pull.norm()
    }
}

/// Watches progress along a path; a state machine without a clock. A new path is no progress: a vehicle that finds
/// one after another and stays where it is is stuck.
///
/// ```
/// use std::time::Duration;
/// use nalgebra::Vector3;
/// use skein_planning::local::escape::{EscapeConfig, EscapeDetector, Forces, Verdict};
///
/// let mut detector = EscapeDetector::new(EscapeConfig::default());
/// let here = Vector3::new(1.0, 2.0, 3.0);
/// let forces = Forces { pull: Vector3::x(), net: Vector3::x() };
/// let verdicts: Vec<_> =
///     (0..40).map(|k| detector.update(Duration::from_millis(100 * k), 7.0, &here, forces)).collect();
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
    /// The mean of the forces of late.
    forces: Forces,
    /// Since when they have cancelled.
    balanced_since: Option<Duration>,
}

impl EscapeDetector {
    /// A detector that has seen nothing.
    pub fn new(config: EscapeConfig) -> EscapeDetector {
        let progress = VecDeque::new();
        EscapeDetector {
            config,
            progress,
            along_m: 0.0,
            station_m: 0.0,
            escaping_until: None,
            forces: Forces::default(),
            balanced_since: None,
        }
    }

    /// The vehicle has got another path; an escape ends.
    pub fn begin_path(&mut self) {
        self.station_m = 0.0;
        self.escaping_until = None;
    }

    /// Takes in how far along its path the vehicle is, metres, and where, at `now` since the run began. Call it while
    /// the vehicle means to move, not while it waits or holds, and [`EscapeDetector::reset`] when it has arrived. Meant
    /// for ten calls a second.
    pub fn update(
        &mut self,
        now: Duration,
        station_m: f64,
        position: &Vector3<f64>,
        forces: Forces,
    ) -> Verdict {
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
        if self.is_trapped(now, forces) {
            self.begin_escape(now);
            return Verdict::Trapped;
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
        self.begin_escape(now);
        Verdict::Stuck
    }

    /// Takes in the newest forces; tells whether they have cancelled for long enough.
    fn is_trapped(&mut self, now: Duration, forces: Forces) -> bool {
        self.forces = self.forces.mean(forces);
        if !self.forces.cancel(self.config.balance) {
            self.balanced_since = None;
            return false;
        }
        now.saturating_sub(*self.balanced_since.get_or_insert(now)) >= self.config.balanced_for
    }

    fn begin_escape(&mut self, now: Duration) {
        self.reset();
        self.escaping_until = Some(now + self.config.escape_for);
    }

    /// Forgets what it has seen, and ends an escape.
    pub fn reset(&mut self) {
        self.progress.clear();
        self.escaping_until = None;
        self.forces = Forces::default();
        self.balanced_since = None;
    }

    /// The factor for the attraction now: 1, or less during an escape.
    pub fn attraction(&self) -> f64 {
        if self.escaping_until.is_some() { self.config.attraction } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNHINDERED: Forces = Forces { pull: Vector3::new(1.0, 0.0, 0.0), net: Vector3::new(1.0, 0.0, 0.0) };

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn slow_but_steady_progress_is_progress() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        for k in 0..200 {
            let along_m = 0.02 * k as f64;
            let verdict = detector.update(at(100 * k), along_m, &Vector3::new(along_m, 0.0, 0.0), UNHINDERED);
            assert_eq!(verdict, Verdict::Progressing);
        }
    }

    #[test]
    fn swinging_back_and_forth_is_not() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let stuck = (0..60).map(|k| if k % 2 == 0 { 5.0 } else { 5.3 }).zip(0..).any(|(x, k)| {
            detector.update(at(100 * k), x, &Vector3::new(x, 0.0, 0.0), UNHINDERED) == Verdict::Stuck
        });
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
                detector.update(at(100 * k), 0.0, &Vector3::zeros(), UNHINDERED),
                detector.update(at(100 * k + 50), x, &Vector3::new(x, 0.0, 0.0), UNHINDERED),
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
            detector.update(at(100 * k), 0.0, &Vector3::new(x, 0.0, 0.0), UNHINDERED);
            let verdict =
                detector.update(at(100 * k + 50), 0.05, &Vector3::new(x + 0.05, 0.0, 0.0), UNHINDERED);
            assert_eq!(verdict, Verdict::Progressing);
        }
    }

    #[test]
    fn an_escape_ends_and_the_window_begins_anew() {
        let mut detector = EscapeDetector::new(EscapeConfig::default());
        let verdicts: Vec<_> =
            (0..=100).map(|k| detector.update(at(100 * k), 1.0, &Vector3::zeros(), UNHINDERED)).collect();
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
            let mut update = |k| detector.update(at(100 * k), 1.0, &Vector3::zeros(), UNHINDERED);
            (0..100).filter(|k| !pause(*k)).any(|k| update(k) == Verdict::Stuck)
        };
        assert!(!stuck(|k| k % 30 < 12), "it waits for 1.2 s");
        assert!(stuck(|k| k % 10 < 3), "for 0.3 s");
    }

    /// When a vehicle is told that it is trapped to which this force is done, in tenths of a second.
    fn trapped_at(net: fn(u64) -> Vector3<f64>, config: EscapeConfig) -> Option<u64> {
        let mut detector = EscapeDetector::new(config);
        let mut update = |k: u64| {
            let forces = Forces { net: net(k), ..UNHINDERED };
            detector.update(at(100 * k), 1.0, &Vector3::zeros(), forces)
        };
        (0..29).find(|k| update(*k) == Verdict::Trapped)
    }

    #[test]
    fn a_local_minimum_is_told_by_the_forces_long_before_the_clock_does() {
        let config = EscapeConfig::default();
        let told = trapped_at(|_| Vector3::zeros(), config);
        assert!(told.is_some_and(|tenths| (10..=15).contains(&tenths)), "{told:?}");
        let swinging = |k: u64| if k.is_multiple_of(2) { Vector3::y() } else { -Vector3::y() } * 0.5;
        assert!(trapped_at(swinging, config).is_some(), "swinging to and fro is no way out");
        assert_eq!(trapped_at(|_| Vector3::x() * 0.5, config), None, "it is pulled on");
        let by_the_clock = EscapeConfig { balance: 0.0, ..config };
        assert_eq!(trapped_at(|_| Vector3::zeros(), by_the_clock), None);
    }
}
