//! Smoothing: corrections reach whoever flies bit by bit, so that no set-point steps.

use std::time::Duration;

use nalgebra::Vector3;

/// A correction is made up for at this rate, 1/s, and no faster than this, m/s.
const RATE: f64 = 5.0;
const FASTEST_M_S: f64 = 0.4;
/// A larger correction is a jump: whoever placed something by the position shifts it at once, m.
const JUMP_M: f64 = 1.5;

/// The correction that is still to be made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Smooth {
    /// The told position less the believed one, ENU, m.
    offset: Vector3<f64>,
    at: Duration,
}

impl Smooth {
    /// The belief has moved by this without the vehicle, m.
    pub fn absorb(&mut self, step: &Vector3<f64>) {
        self.offset -= step;
    }

    /// Correction of the belief, m.
    pub fn offset(&self) -> Vector3<f64> {
        self.offset
    }

    /// Time goes on to `now`; gives the jump to be made, if the correction is too large to be made bit by bit, m.
    pub fn go_on(&mut self, now: Duration) -> Option<Vector3<f64>> {
        let passed_s = now.saturating_sub(std::mem::replace(&mut self.at, now)).as_secs_f64().min(0.1);
        if self.offset.norm() > JUMP_M {
            return Some(-std::mem::take(&mut self.offset));
        }
        let made_up = self.offset * (1.0 - (-RATE * passed_s).exp());
        self.offset -= made_up.cap_magnitude(FASTEST_M_S * passed_s);
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_of_a_metre_takes_seconds_and_no_tick_steps() {
        let mut smooth = Smooth::default();
        smooth.absorb(&Vector3::x());
        let mut told = smooth.offset();
        assert_eq!(told, -Vector3::x());
        for tick in 1..=500 {
            assert_eq!(smooth.go_on(Duration::from_millis(20 * tick)), None);
            assert!((smooth.offset() - told).norm() <= 0.0081, "tick {tick}");
            told = smooth.offset();
        }
        assert!(told.norm() < 1e-3, "{told}");
    }

    #[test]
    fn what_is_larger_jumps_at_once_and_is_told() {
        let mut smooth = Smooth::default();
        smooth.absorb(&Vector3::new(0.0, 2.0, 0.0));
        assert_eq!(smooth.go_on(Duration::from_millis(20)), Some(Vector3::new(0.0, 2.0, 0.0)));
        assert_eq!(smooth.offset(), Vector3::zeros());
    }
}
