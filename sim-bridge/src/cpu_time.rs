//! The processor's time that this thread has used: measures what it does, whoever else runs on this computer.

use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

/// The processor's time that this thread has used since it began.
///
/// # Errors
/// The system keeps no such clock.
pub fn of_this_thread() -> anyhow::Result<Duration> {
    Ok(clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)?.into())
}

/// Does something, and tells how many milliseconds of this thread's time it took.
///
/// # Errors
/// As [`of_this_thread`].
pub fn measured<T>(work: impl FnOnce() -> T) -> anyhow::Result<(T, f64)> {
    let since = of_this_thread()?;
    let done = work();
    Ok((done, (of_this_thread()? - since).as_secs_f64() * 1000.0))
}
