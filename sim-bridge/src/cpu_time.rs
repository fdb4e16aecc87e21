//! Processor time: what a computation costs, whatever else the computer does meanwhile.

use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

/// What this thread has used so far.
///
/// # Errors
/// The operating system does not tell.
pub fn of_this_thread() -> nix::Result<Duration> {
    Ok(clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)?.into())
}

/// What this process has used so far.
///
/// # Errors
/// The operating system does not tell.
pub fn of_this_process() -> nix::Result<Duration> {
    Ok(clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID)?.into())
}
