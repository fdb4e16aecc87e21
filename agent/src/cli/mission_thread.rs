//! The mission's thread: b-threads, the network, and what must be kept on a disk.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use skein_disk::Number;
use skein_wire::event::{Advance, Declared as _, Homeward};
use skein_zenoh::{Bell, Complaints, ZenohLink};

use super::exchange::Exchange;
use super::signing_clock::SigningClock;
use crate::apart::MissionSide;
use crate::mission::{Trial, Tried};

/// It goes on at least this often, and at once when a message or news has come.
const TICK: Duration = Duration::from_millis(20);

/// All that the mission needs.
pub struct MissionThread {
    pub side: MissionSide,
    pub link: ZenohLink,
    pub exchange: Arc<Exchange>,
    pub incarnation: Number,
    /// If the autopilot's link is signed.
    pub signing: Option<SigningClock>,
    pub complaints: Complaints,
    pub trials: Trials,
    pub began: Instant,
}

/// A thread that tries scripts out.
pub struct Trials {
    given: SyncSender<Trial>,
    tried: Receiver<Tried>,
}

impl Trials {
    /// Starts it; it rings when it has tried one.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(bell: Bell) -> std::io::Result<Self> {
        let (given, trials) = sync_channel::<Trial>(MOST_WAITING);
        let (tell, tried) = sync_channel(MOST_WAITING);
        std::thread::Builder::new().name("trials".into()).spawn(move || {
            for trial in trials {
                // Whoever asked may be gone.
                let _ = tell.send(trial.run());
                bell.ring();
            }
        })?;
        Ok(Self { given, tried })
    }
}

/// So many scripts may wait; the mission lets in no more.
const MOST_WAITING: usize = 8;

impl MissionThread {
    /// Decides until it is to end.
    pub fn run(mut self) {
        let bell = self.link.bell();
        while !self.exchange.is_ending.load(Ordering::Relaxed) {
            bell.wait(TICK);
            self.go_on(self.began.elapsed());
        }
    }

    fn go_on(&mut self, now: Duration) {
        self.go_on_with_trials();
        self.incarnation.go_on(now);
        self.side.note_disk("incarnation", self.incarnation.trouble());
        if let Some(signing) = &mut self.signing {
            signing.go_on(now);
            self.side.note_disk("signing time", signing.trouble());
        }
        let orders = self.side.go_on(now, self.exchange.take_news(), &mut self.link);
        self.exchange.put_orders(orders);
        if let Some(line) = self.complaints.check(now, self.side.node(), &self.link) {
            tracing::warn!("{line}");
        }
        self.tell();
    }

    /// Has scripts tried out, and runs those that were.
    fn go_on_with_trials(&mut self) {
        while let Some(trial) = self.side.next_trial() {
            match self.trials.given.try_send(trial) {
                Ok(()) => {}
                Err(TrySendError::Full(trial) | TrySendError::Disconnected(trial)) => {
                    self.side.note_trial(trial.refused("it cannot be tried out now; send it again"));
                }
            }
        }
        while let Ok(tried) = self.trials.tried.try_recv() {
            self.side.note_trial(tried);
        }
    }

    /// Writes down what the vehicle itself has decided or met.
    fn tell(&mut self) {
        for happened in self.side.take_selections() {
            let repeated = matches!(happened.event.kind(), Advance::NAME | Homeward::NAME);
            if happened.home == *self.side.name() && !repeated {
                tracing::info!("{}", happened.event);
            }
        }
    }
}
