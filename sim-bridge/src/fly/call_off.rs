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

/// The reason why a mission is to be called off now, if there is one.
pub fn reason(now: Duration, time_limit_s: f64) -> Option<&'static str> {
    if interruptions() > 0 {
        Some("interrupted")
    } else if now.as_secs_f64() > time_limit_s {
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
