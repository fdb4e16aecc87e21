//! A node's time, as its driver tells it.

use std::time::Duration;

#[derive(Clone, Debug, Default)]
pub(crate) struct Clock {
    now: Duration,
    pub(crate) started: Option<Duration>,
    /// The time that b-threads are shown, where a verifier holds it.
    pub(crate) held: Option<Duration>,
}

impl Clock {
    /// Goes on to `now`, never back; the first time starts the node.
    pub(crate) fn set(&mut self, now: Duration) {
        self.now = self.now.max(now);
        self.started.get_or_insert(self.now);
    }

    pub(crate) fn now(&self) -> Duration {
        self.now
    }

    /// When the node started.
    pub(crate) fn start(&self) -> Duration {
        self.started.unwrap_or(self.now)
    }

    /// For how long the node has been up.
    pub(crate) fn up(&self) -> Duration {
        self.now - self.start()
    }

    /// The time that b-threads are shown.
    pub(crate) fn of_bthreads(&self) -> Duration {
        self.held.unwrap_or(self.now)
    }
}
