//! Repeating what is not answered, until it is given up.

use std::time::Duration;

/// The rhythm of repetitions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Retry {
    pub(crate) every: Duration,
    /// Repetitions until it is given up.
    pub(crate) times: u8,
}

/// The repetitions of one thing that waits for an answer.
#[derive(Debug, Clone)]
pub(crate) struct Patience {
    retry: Retry,
    next: Duration,
    repeats: u8,
}

/// The next step.
#[derive(Debug, PartialEq)]
pub(crate) enum Turn {
    Wait,
    Repeat,
    GiveUp,
}

impl Retry {
    /// Repetitions of what is said at `now`.
    pub(crate) fn from(self, now: Duration) -> Patience {
        Patience { retry: self, next: now + self.every, repeats: 0 }
    }
}

impl Patience {
    pub(crate) fn turn(&mut self, now: Duration) -> Turn {
        if now < self.next {
            return Turn::Wait;
        }
        if self.repeats == self.retry.times {
            return Turn::GiveUp;
        }
        self.repeats += 1;
        self.next = now + self.retry.every;
        Turn::Repeat
    }

    /// Waits until `next` before the next turn.
    pub(crate) fn put_off(&mut self, next: Duration) {
        self.next = next;
    }
}
