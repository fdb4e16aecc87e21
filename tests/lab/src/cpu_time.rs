//! CPU time used: what a computation costs, whatever else the computer does.

use std::time::Duration;

use anyhow::Context as _;
use nix::time::{ClockId, clock_gettime};

/// The time of this thread so far.
///
/// # Errors
/// The operating system's error.
pub fn this_thread() -> anyhow::Result<Duration> {
    read(ClockId::CLOCK_THREAD_CPUTIME_ID)
}

/// The same; a system that does not tell makes all cost nothing.
#[must_use]
pub fn this_thread_or_nothing() -> Duration {
    this_thread().unwrap_or_default()
}

/// The time of this process so far, in all its threads.
///
/// # Errors
/// The operating system's error.
pub fn this_process() -> anyhow::Result<Duration> {
    read(ClockId::CLOCK_PROCESS_CPUTIME_ID)
}

/// Does something, and tells how many milliseconds of this thread's time it took.
///
/// # Errors
/// The operating system's error.
pub fn measured_ms<T>(work: impl FnOnce() -> T) -> anyhow::Result<(T, f64)> {
    let since = this_thread()?;
    let done = work();
    Ok((done, (this_thread()? - since).as_secs_f64() * 1000.0))
}

fn read(clock: ClockId) -> anyhow::Result<Duration> {
    Ok(clock_gettime(clock).context("the CPU time cannot be read")?.into())
}
