//! The mission's thread: b-threads, the network, and what must be kept on a disk.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use skein_disk::Number;
use skein_wire::event::{Advance, Declared as _, Homeward};
use skein_zenoh::{Complaints, ZenohLink};

use super::exchange::Exchange;
use crate::apart::MissionSide;

/// It goes on at least this often, and at once when a message or news has come.
const TICK: Duration = Duration::from_millis(20);

/// All that the mission needs.
pub struct MissionThread {
    pub side: MissionSide,
    pub link: ZenohLink,
    pub exchange: Arc<Exchange>,
    pub incarnation: Number,
    pub complaints: Complaints,
    pub began: Instant,
}

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
        self.incarnation.go_on(now);
        self.side.note_disk("incarnation", self.incarnation.trouble());
        let orders = self.side.go_on(now, self.exchange.take_news(), &mut self.link);
        self.exchange.put_orders(orders);
        if let Some(line) = self.complaints.check(now, self.side.node(), &self.link) {
            tracing::warn!("{line}");
        }
        self.tell();
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
