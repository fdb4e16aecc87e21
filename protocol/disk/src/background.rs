//! A store behind a thread of its own.

use std::fmt;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread;

use skein_wire::{Saving, Store};

/// Saves on a thread of its own, so that nobody waits for a slow disk, nor for one that does not answer at
/// all.
pub struct Background<T> {
    values: SyncSender<T>,
    outcomes: Receiver<Saving>,
    /// The value that the thread has in hand.
    in_hand: Option<T>,
}

impl<T: Clone + PartialEq + Send + 'static> Background<T> {
    /// The same store, on a thread. `done` is called there whenever something has been saved, or has not.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn new(
        mut store: impl Store<T> + 'static,
        done: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let (values, wanted) = sync_channel::<T>(1);
        let (tell, outcomes) = sync_channel(1);
        thread::Builder::new().name("disk".into()).spawn(move || {
            for value in wanted {
                // Whoever asked may be gone.
                let _ = tell.send(store.save(&value));
                done();
            }
        })?;
        Ok(Self { values, outcomes, in_hand: None })
    }

    /// The outcome for what the thread had in hand, if it is ready.
    fn outcome(&mut self) -> Option<(T, Saving)> {
        let gone = || Saving::Failed("its thread has ended".to_owned());
        let outcome = match self.outcomes.try_recv() {
            Ok(outcome) => outcome,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => gone(),
        };
        Some((self.in_hand.take()?, outcome))
    }
}

impl<T: Clone + PartialEq + Send + 'static> Store<T> for Background<T> {
    fn save(&mut self, value: &T) -> Saving {
        if let Some((saved, outcome)) = self.outcome()
            && (saved == *value || outcome != Saving::Done)
        {
            return outcome;
        }
        if self.in_hand.is_none() {
            match self.values.try_send(value.clone()) {
                Ok(()) => self.in_hand = Some(value.clone()),
                Err(TrySendError::Full(_)) => {}
                Err(TrySendError::Disconnected(_)) => {
                    return Saving::Failed("its thread has ended".to_owned());
                }
            }
        }
        Saving::UnderWay
    }
}

impl<T> fmt::Debug for Background<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Background").field("busy", &self.in_hand.is_some()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};

    use super::*;

    /// A disk that tells what it is given, and answers when a test lets it.
    #[derive(Debug)]
    struct Slow {
        given: SyncSender<u8>,
        answers: Receiver<Saving>,
    }

    impl Store<u8> for Slow {
        fn save(&mut self, value: &u8) -> Saving {
            self.given.send(*value).unwrap();
            self.answers.recv().unwrap()
        }
    }

    #[test]
    fn nobody_waits_for_it_and_only_what_is_saved_counts() {
        let (given, seen) = sync_channel(1);
        let (answer, answers) = channel();
        let (rang, rung) = channel();
        let mut store = Background::new(Slow { given, answers }, move || rang.send(()).unwrap()).unwrap();
        assert_eq!(store.save(&1), Saving::UnderWay);
        assert_eq!(seen.recv(), Ok(1), "it is being saved");
        assert_eq!(store.save(&2), Saving::UnderWay, "another value has come meanwhile");
        answer.send(Saving::Done).unwrap();
        rung.recv().unwrap();
        assert_eq!(store.save(&2), Saving::UnderWay, "the first is saved, and that is not the second");
        assert_eq!(seen.recv(), Ok(2));
        answer.send(Saving::Done).unwrap();
        rung.recv().unwrap();
        assert_eq!(store.save(&2), Saving::Done);
        assert_eq!(store.save(&3), Saving::UnderWay);
        assert_eq!(seen.recv(), Ok(3));
        answer.send(Saving::Failed("full".to_owned())).unwrap();
        rung.recv().unwrap();
        assert_eq!(store.save(&3), Saving::Failed("full".to_owned()));
        assert_eq!(store.save(&3), Saving::UnderWay, "asked again, it tries again");
    }
}
