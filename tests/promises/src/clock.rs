//! A node's own clock.

use std::time::Duration;

const MILLION: u64 = 1_000_000;

/// A clock that began somewhere else than the others and goes a little fast or slow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    offset_ns: u64,
    /// Nanoseconds that it counts in a true millisecond.
    rate: u64,
}

impl Clock {
    /// A clock that shows `offset` when the run begins, and gains `drift_ppm` millionths.
    pub(crate) fn new(offset: Duration, drift_ppm: i32) -> Self {
        Self { offset_ns: nanoseconds(offset), rate: MILLION.saturating_add_signed(drift_ppm.into()).max(1) }
    }

    /// What it shows at the true time `at`.
    pub(crate) fn shows(&self, at: Duration) -> Duration {
        let gone = u128::from(nanoseconds(at)) * u128::from(self.rate) / u128::from(MILLION);
        Duration::from_nanos(self.offset_ns + narrow(gone))
    }

    /// The first true time at which it shows `time` or later.
    pub(crate) fn when(&self, time: Duration) -> Duration {
        let gone = u128::from(nanoseconds(time).saturating_sub(self.offset_ns));
        Duration::from_nanos(narrow((gone * u128::from(MILLION)).div_ceil(u128::from(self.rate))))
    }
}

fn nanoseconds(time: Duration) -> u64 {
    narrow(time.as_nanos())
}

/// Times of a run are far below the five centuries that fit.
fn narrow(nanoseconds: u128) -> u64 {
    u64::try_from(nanoseconds).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deadline_is_met_as_soon_as_the_clock_shows_it() {
        let nanosecond = Duration::from_nanos(1);
        for drift_ppm in [-5000, 0, 3, 5000] {
            let clock = Clock::new(Duration::from_secs(100), drift_ppm);
            for ms in [0, 1, 333, 1000, 61_234] {
                let deadline = Duration::from_secs(100) + Duration::from_millis(ms);
                let at = clock.when(deadline);
                assert!(clock.shows(at) >= deadline);
                assert!(at.is_zero() || clock.shows(at - nanosecond) < deadline, "{drift_ppm} ppm, {ms} ms");
            }
        }
    }
}
