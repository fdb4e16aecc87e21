//! Dead reckoning: for how long, and how far, a vehicle flies on without a source of position.

use std::time::Duration;

/// It goes on for so long at most, and as long as its position is no more uncertain than this, m.
const GOES_ON_FOR: Duration = Duration::from_secs(5);
const GOES_ON_WITHIN_M: f64 = 0.3;

/// Whether a vehicle without a source for `since`, with a position of this standard deviation, is to stop.
pub fn is_over(now: Duration, since: Duration, sigma_m: f64) -> bool {
    now.saturating_sub(since) > GOES_ON_FOR || sigma_m > GOES_ON_WITHIN_M
}
