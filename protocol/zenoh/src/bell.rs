//! Wakes a loop that waits for whatever comes first: a message, an order, its next tick.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// A bell that anyone may ring and one loop listens to. It rings on until it is heard; cloning gives another rope.
#[derive(Clone, Debug, Default)]
pub struct Bell(Arc<(Mutex<bool>, Condvar)>);

impl Bell {
    /// Wakes the loop, now or as soon as it waits.
    pub fn ring(&self) {
        let (ringing, changed) = &*self.0;
        *ringing.lock().unwrap_or_else(PoisonError::into_inner) = true;
        changed.notify_one();
    }

    /// Waits until it rings, but no longer than `patience`. Returns whether it rang.
    pub fn wait(&self, patience: Duration) -> bool {
        let (ringing, changed) = &*self.0;
        let silent = ringing.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = changed.wait_timeout_while(silent, patience, |ringing| !*ringing);
        let (mut ringing, _) = waited.unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *ringing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_rings_until_it_is_heard_once() {
        let bell = Bell::default();
        assert!(!bell.wait(Duration::ZERO));
        bell.clone().ring();
        bell.ring();
        assert!(bell.wait(Duration::ZERO));
        assert!(!bell.wait(Duration::ZERO), "it rang twice");
    }

    #[test]
    fn it_wakes_who_waits() {
        let bell = Bell::default();
        let rope = bell.clone();
        let ringer = std::thread::spawn(move || rope.ring());
        assert!(bell.wait(Duration::from_secs(60)));
        ringer.join().unwrap();
    }
}
