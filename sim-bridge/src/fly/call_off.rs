//! The end of a mission before it is over: by Ctrl-C, or at its time limit.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

/// Time for all to land once the mission is called off.
const TIME_TO_LAND: Duration = Duration::from_secs(60);

/// A mission that was called off.
pub struct CalledOff {
    pub why: String,
    pub at: Duration,
}

impl CalledOff {
    pub fn is_out_of_time(&self, now: Duration) -> bool {
        now > self.at + TIME_TO_LAND
    }
}

/// The time that counts towards a mission's limit: from the start on, or from the first take-off on where that waits for
/// an order.
pub struct MissionClock {
    waits: bool,
    began: Duration,
}

impl MissionClock {
    pub fn new(launch_on_order: bool) -> Self {
        Self { waits: launch_on_order, began: Duration::ZERO }
    }

    /// The mission's time at `now`, when everybody is on the ground or not.
    pub fn time(&mut self, now: Duration, is_grounded: bool) -> Duration {
        self.waits &= is_grounded;
        if self.waits {
            self.began = now;
        }
        now.saturating_sub(self.began)
    }
}

/// The reason why a mission that has taken so long is to be called off now, if there is one.
pub fn reason(flown: Duration, time_limit_s: f64) -> Option<&'static str> {
    if interruptions() > 0 {
        Some("interrupted")
    } else if flown.as_secs_f64() > time_limit_s {
        Some("the time limit was reached")
    } else {
        None
    }
}

/// Signals of the user to stop, with Ctrl-C.
static INTERRUPTIONS: LazyLock<Arc<AtomicU32>> = LazyLock::new(|| {
    let count = Arc::new(AtomicU32::new(0));
    let counter = Arc::clone(&count);
    // Without a handler Ctrl-C ends the process, as it does by itself.
    let _ = ctrlc::set_handler(move || {
        counter.fetch_add(1, Ordering::Relaxed);
    });
    count
});

/// Counts the user's signals to stop, from the first call on.
pub fn interruptions() -> u32 {
    INTERRUPTIONS.load(Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_waits_for_an_order_to_launch_does_not_use_up_the_missions_time() {
        let at = Duration::from_secs;
        let mut at_once = MissionClock::new(false);
        assert_eq!(at_once.time(at(20), true), at(20));
        let mut waits = MissionClock::new(true);
        assert_eq!([waits.time(at(400), true), waits.time(at(401), false)], [Duration::ZERO, at(1)]);
        assert_eq!(waits.time(at(450), true), at(50), "landed again, it does not wait any more");
    }
}
