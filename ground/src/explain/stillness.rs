//! Since when a vehicle stands still.

use std::time::Duration;

use nalgebra::Vector3;

/// Who stays this near to a place stands still there, m: a hovering vehicle sways.
const RADIUS_M: f64 = 0.5;
/// Only who has stayed this long stands still; others turn around.
const LEAST: Duration = Duration::from_secs(2);

/// The place that a vehicle was last seen to come to, and when.
#[derive(Clone, Debug, Default)]
pub(super) struct Stillness(Option<(Vector3<f64>, Duration)>);

impl Stillness {
    /// At `now` the vehicle is at `position`, metres.
    pub(super) fn note(&mut self, now: Duration, position: &Vector3<f64>) {
        if self.0.is_none_or(|(place, _)| (place - position).norm() > RADIUS_M) {
            self.0 = Some((*position, now));
        }
    }

    /// Since when it stands still; none if it moves, or has just come to a halt.
    pub(super) fn since(&self, now: Duration) -> Option<Duration> {
        self.0.map(|(_, since)| since).filter(|since| now.saturating_sub(*since) >= LEAST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_sways_stands_still_and_who_creeps_does_not() {
        let (mut sways, mut flies) = (Stillness::default(), Stillness::default());
        for tenth in 0..100_u32 {
            let (now, t) = (Duration::from_millis(u64::from(tenth) * 100), f64::from(tenth) / 10.0);
            sways.note(now, &Vector3::new((3.0 * t).sin() * 0.2, 0.0, 2.0));
            flies.note(now, &Vector3::new(0.4 * t, 0.0, 2.0));
            assert_eq!(flies.since(now), None, "at {t} s");
        }
        assert_eq!(sways.since(Duration::from_millis(1900)), None);
        assert_eq!(sways.since(Duration::from_secs(10)), Some(Duration::ZERO));
    }
}
