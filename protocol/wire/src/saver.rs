//! Something that is to be kept, and how its store gets on with it.

use std::time::Duration;

use crate::store::{Saving, Store};

/// A store that takes longer than this for something counts as one that fails, until it is done.
const PATIENCE: Duration = Duration::from_millis(200);
/// After a failure a store is asked again after so long.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Brings values to a store, the newest in place of all before, until the store has it.
#[derive(Debug)]
pub struct Saver<T> {
    store: Box<dyn Store<T>>,
    /// Since when, and what, it has been trying to keep.
    unsaved: Option<(Duration, T)>,
    retry_at: Duration,
    trouble: Option<String>,
}

impl<T> Saver<T> {
    pub fn new(store: Box<dyn Store<T>>) -> Self {
        Self { store, unsaved: None, retry_at: Duration::ZERO, trouble: None }
    }

    /// Has this to be kept from now on, and tries so at once.
    pub fn put(&mut self, now: Duration, value: T) {
        self.retry_at = Duration::ZERO;
        let since = self.unsaved.take().map_or(now, |(since, _)| since);
        self.unsaved = Some((since, value));
    }

    /// Goes on with it; gives whether the store holds all that it was given.
    pub fn go_on(&mut self, now: Duration) -> bool {
        let Some((since, value)) = &self.unsaved else { return true };
        if now < self.retry_at {
            return false;
        }
        match self.store.save(value) {
            Saving::Done => {
                self.unsaved = None;
                self.trouble = None;
                return true;
            }
            Saving::Failed(why) => {
                self.retry_at = now + RETRY_AFTER;
                self.trouble = Some(why);
            }
            Saving::UnderWay if now >= *since + PATIENCE && self.trouble.is_none() => {
                self.trouble = Some("the disk does not answer".to_owned());
            }
            Saving::UnderWay => {}
        }
        false
    }

    /// Why what was given last is not kept, if it is not and will not be at once.
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }

    pub fn is_done(&self) -> bool {
        self.unsaved.is_none()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    #[derive(Debug)]
    struct Slow(VecDeque<Saving>, Vec<u8>);

    impl Store<u8> for Slow {
        fn save(&mut self, value: &u8) -> Saving {
            self.1.push(*value);
            self.0.pop_front().unwrap_or(Saving::Done)
        }
    }

    fn saver(answers: impl IntoIterator<Item = Saving>) -> Saver<u8> {
        Saver::new(Box::new(Slow(answers.into_iter().collect(), Vec::new())))
    }

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn a_store_that_does_not_answer_is_in_trouble_until_it_is_done() {
        let mut saver = saver([Saving::UnderWay, Saving::UnderWay]);
        saver.put(ms(0), 1);
        assert!(!saver.go_on(ms(0)) && saver.trouble().is_none());
        saver.put(ms(100), 2);
        assert!(!saver.go_on(ms(200)) && saver.trouble().is_some(), "since the first that it does not have");
        assert!(saver.go_on(ms(220)) && saver.trouble().is_none());
    }

    #[test]
    fn a_store_that_fails_is_asked_again_a_second_later_and_not_before() {
        let mut saver = saver([Saving::Failed("full".to_owned())]);
        saver.put(ms(0), 1);
        assert!(!saver.go_on(ms(0)));
        assert!(!saver.go_on(ms(999)));
        assert_eq!(saver.trouble(), Some("full"));
        assert!(saver.go_on(ms(1000)) && saver.trouble().is_none() && saver.is_done());
    }
}
