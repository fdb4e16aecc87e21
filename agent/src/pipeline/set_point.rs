//! The keep-alive rule of set-points: from fresh inputs only; then zero velocity; then silence.
//!
//! Silence is deliberate: the autopilot's own failsafe then acts. This rule runs outside the behavioural program
//! and outside the network.

use std::time::Duration;

/// Inputs older than this move nothing.
pub const FRESH_FOR: Duration = Duration::from_millis(200);
/// After this long without fresh inputs not even zero velocity is sent.
pub const SILENT_AFTER: Duration = Duration::from_millis(1000);

/// The set-point that may be sent, given the age of the oldest input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeepAlive {
    /// The pipeline's set-point.
    Command,
    Stop,
    /// Nothing at all.
    Silence,
}

impl KeepAlive {
    /// The same, but no more than a stop.
    #[must_use]
    pub fn at_most_stop(self) -> Self {
        if self == Self::Command { Self::Stop } else { self }
    }
}

/// Applies the rule at `now` to the times at which the inputs were measured.
///
/// An input that was never received counts as silent.
pub fn keep_alive(now: Duration, measured_at: &[Option<Duration>]) -> KeepAlive {
    match oldest_age(now, measured_at) {
        Some(age) if age <= FRESH_FOR => KeepAlive::Command,
        Some(age) if age <= SILENT_AFTER => KeepAlive::Stop,
        _ => KeepAlive::Silence,
    }
}

/// The age of the oldest input; `None` when one was never received.
pub fn oldest_age(now: Duration, measured_at: &[Option<Duration>]) -> Option<Duration> {
    measured_at
        .iter()
        .map(|at| at.map(|at| now.saturating_sub(at)))
        .max_by_key(|age| age.unwrap_or(Duration::MAX))?
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_secs(10);

    fn aged(ages_ms: &[u64]) -> KeepAlive {
        let inputs: Vec<_> = ages_ms.iter().map(|&age| Some(NOW - Duration::from_millis(age))).collect();
        keep_alive(NOW, &inputs)
    }

    #[test]
    fn fresh_inputs_command_old_ones_stop_and_dead_ones_silence() {
        assert_eq!(aged(&[20, 200]), KeepAlive::Command);
        assert_eq!(aged(&[20, 201]), KeepAlive::Stop);
        assert_eq!(aged(&[1000, 0]), KeepAlive::Stop);
        assert_eq!(aged(&[1001, 0]), KeepAlive::Silence);
    }

    #[test]
    fn an_input_never_received_silences() {
        assert_eq!(keep_alive(NOW, &[Some(NOW), None]), KeepAlive::Silence);
    }
}
