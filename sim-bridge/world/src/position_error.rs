//! Errors of a vehicle's position: satellite fixes that drift, and faults at stated times.

use std::time::Duration;

use nalgebra::{Vector2, Vector3};

use crate::noise::Noise;
use crate::quadrotor::STEP;

/// The errors of one vehicle's position; none by default.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PositionErrors {
    pub drift: Drift,
    pub faults: Vec<PositionFault>,
}

/// A first-order Gauss-Markov process on each axis of fixes and pressure height.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drift {
    /// Standard deviation east and north, m.
    pub sigma_m: f64,
    /// Standard deviation of height, m.
    pub sigma_vertical_m: f64,
    /// Time after which an error has lost all but a share of 1/e of its effect, s.
    pub correlation_s: f64,
    /// Standard deviations, horizontal and vertical, that the autopilot tells of its position, m; `None` for the true
    /// ones.
    pub told_m: Option<[f64; 2]>,
}

/// A fault that begins at a time, and ends if it has a duration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionFault {
    /// Since the run began.
    pub at: Duration,
    pub lasts: Option<Duration>,
    pub kind: PositionFaultKind,
}

/// The fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PositionFaultKind {
    /// Fixes and pressure height are this much off, ENU, m, and the estimator takes them over.
    Jump(Vector3<f64>),
    /// There are no fixes.
    GpsLost,
    /// There are no fixes within so many metres of a place, east and north.
    Jammed { centre: Vector2<f64>, radius_m: f64 },
    /// The camera finds no markers: blur, glare.
    MarkersMissed,
    /// The flow sensor sees nothing.
    FlowLost,
    /// The origin that the autopilot tells positions from moves by this, ENU, m.
    OriginMoves(Vector3<f64>),
    /// The autopilot tells the same estimate, with the same time stamp, again and again.
    Freezes,
    /// The autopilot tells estimates that are so old.
    Late(Duration),
    /// The autopilot's clock begins anew and its estimator with it.
    Resets,
}

impl PositionFault {
    /// Whether it acts at `now`.
    pub(crate) fn is_on(&self, now: Duration) -> bool {
        now >= self.at && self.lasts.is_none_or(|lasts| now < self.at + lasts)
    }
}

impl PositionFaultKind {
    /// Whether it is a fault of what an autopilot tells, and not of its instruments.
    #[must_use]
    pub fn is_of_autopilot(&self) -> bool {
        matches!(self, Self::OriginMoves(_) | Self::Freezes | Self::Late(_) | Self::Resets)
    }
}

/// The errors of one vehicle's instruments in the course of time.
#[derive(Debug, Clone)]
pub(crate) struct FixErrors {
    errors: PositionErrors,
    noise: Noise,
    decay: f64,
    drift: Vector3<f64>,
    jump: Vector3<f64>,
    lost: Lost,
}

/// The senses that are lost now.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lost {
    pub(crate) fixes: bool,
    pub(crate) markers: bool,
    pub(crate) flow: bool,
}

impl FixErrors {
    /// The drift begins as if it had gone on for ever.
    pub(crate) fn new(errors: PositionErrors, noise: Noise) -> Self {
        let decay = (-STEP.as_secs_f64() / errors.drift.correlation_s.max(1e-3)).exp();
        let lost = Lost::default();
        let mut new = Self { errors, noise, decay, drift: Vector3::zeros(), jump: Vector3::zeros(), lost };
        new.drift = new.kick(1.0);
        new
    }

    /// Independent normal numbers, with this share of the drift's standard deviations; no number is drawn for an
    /// axis without drift.
    fn kick(&mut self, share: f64) -> Vector3<f64> {
        let Drift { sigma_m, sigma_vertical_m, .. } = self.errors.drift;
        Vector3::new(sigma_m, sigma_m, sigma_vertical_m)
            .map(|sigma_m| if sigma_m > 0.0 { self.noise.normal(share * sigma_m) } else { 0.0 })
    }

    /// Goes on by [`STEP`], to `now`, with the vehicle at this place, ENU, m.
    pub(crate) fn step(&mut self, now: Duration, place: &Vector3<f64>) {
        self.drift = self.drift * self.decay + self.kick((1.0 - self.decay * self.decay).sqrt());
        (self.jump, self.lost) = (Vector3::zeros(), Lost::default());
        for fault in self.errors.faults.iter().filter(|fault| fault.is_on(now)) {
            match fault.kind {
                PositionFaultKind::Jump(by) => self.jump += by,
                PositionFaultKind::GpsLost => self.lost.fixes = true,
                PositionFaultKind::Jammed { centre, radius_m } => {
                    self.lost.fixes |= (place.xy() - centre).norm() < radius_m;
                }
                PositionFaultKind::MarkersMissed => self.lost.markers = true,
                PositionFaultKind::FlowLost => self.lost.flow = true,
                _ => {}
            }
        }
    }

    /// By how much fixes and pressure height are off now, ENU, m.
    pub(crate) fn offset(&self) -> Vector3<f64> {
        self.drift + self.jump
    }

    pub(crate) fn lost(&self) -> Lost {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(drift: Drift, faults: Vec<PositionFault>) -> FixErrors {
        FixErrors::new(PositionErrors { drift, faults }, Noise::new(5, 9))
    }

    #[test]
    fn drift_has_its_deviations_and_its_correlation_time() {
        let drift = Drift { sigma_m: 2.0, sigma_vertical_m: 0.5, correlation_s: 1.0, ..Drift::default() };
        let mut errors = errors(drift, Vec::new());
        let mut track = Vec::new();
        for _ in 0..250_000 {
            errors.step(Duration::ZERO, &Vector3::zeros());
            track.push(errors.offset());
        }
        let sigma = |axis: usize| {
            (track.iter().map(|offset| offset[axis].powi(2)).sum::<f64>() / track.len() as f64).sqrt()
        };
        assert!((sigma(0) - 2.0).abs() < 0.2 && (sigma(1) - 2.0).abs() < 0.2, "{} {}", sigma(0), sigma(1));
        assert!((sigma(2) - 0.5).abs() < 0.05, "{}", sigma(2));
        // A correlation time is 250 steps.
        let together: f64 = track.iter().zip(&track[250..]).map(|(one, later)| one.x * later.x).sum();
        let correlation = together / (track.len() as f64 * sigma(0).powi(2));
        assert!((correlation - (-1.0_f64).exp()).abs() < 0.1, "{correlation}");
    }

    #[test]
    fn a_jump_lasts_as_long_as_it_says() {
        let by = Vector3::new(8.0, 0.0, -1.0);
        let seconds = Duration::from_secs;
        let jump = |lasts| PositionFault { at: seconds(3), lasts, kind: PositionFaultKind::Jump(by) };
        let mut errors = errors(Drift::default(), vec![jump(Some(seconds(2))), jump(None)]);
        let mut offset = |second| {
            errors.step(seconds(second), &Vector3::zeros());
            errors.offset()
        };
        assert_eq!(offset(2), Vector3::zeros());
        assert_eq!(offset(3), 2.0 * by);
        assert_eq!(offset(5), by);
    }

    #[test]
    fn a_jammer_takes_the_fixes_near_it_and_nothing_else() {
        let centre = Vector2::new(10.0, 0.0);
        let kind = PositionFaultKind::Jammed { centre, radius_m: 4.0 };
        let mut errors =
            errors(Drift::default(), vec![PositionFault { at: Duration::ZERO, lasts: None, kind }]);
        let mut is_lost = |x| {
            errors.step(Duration::from_secs(1), &Vector3::new(x, 0.0, 9.0));
            (errors.lost().fixes, errors.lost().markers, errors.lost().flow)
        };
        assert_eq!([is_lost(5.0), is_lost(7.0)], [(false, false, false), (true, false, false)]);
    }
}
