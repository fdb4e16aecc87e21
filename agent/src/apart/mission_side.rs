//! The mission, at its own pace.

use std::time::Duration;

use skein_dbp::{Happened, NodeName};
use skein_wire::{Link, NodeLink};

use super::{
    control_side::CYCLE_PERIOD,
    news::{Body, News},
    orders::Orders,
};
use crate::mission::{Mission, Outcome, Trial, Tried};

/// A decision may be answered by what is selected next, which deserves its turn in the same step; so often.
const ROUNDS: usize = 4;

/// The mission of one vehicle. Feed it news, let it go on every 20 ms and when news or messages have come,
/// and carry its orders to control.
#[derive(Debug)]
pub struct MissionSide {
    mission: Mission,
    body: Body,
    next_cycle: Duration,
}

impl MissionSide {
    pub(crate) fn new(mission: Mission) -> Self {
        Self { mission, body: Body::default(), next_cycle: Duration::ZERO }
    }

    /// Goes on: hears control and other nodes, decides, and says to other nodes what is to be said. Gives the
    /// orders for control.
    pub fn go_on(&mut self, now: Duration, news: News, link: &mut dyn Link) -> Orders {
        // States and checks are control's to hear, who has a link for them.
        self.mission.receive(now, link);
        self.take_in(now, news);
        let mut orders = Orders { decided: now, ..Orders::default() };
        if now >= self.next_cycle {
            self.next_cycle = now + CYCLE_PERIOD;
            if let Some(here) = &self.body.here {
                self.mission.tell_scripts(&here.circumstances());
            }
            self.mission.catch_up(now);
            orders.words = Some(self.mission.words(self.body.complaint.clone()));
        }
        self.decide(now, &mut orders);
        self.mission.send(link);
        self.mission.put_board(now, link);
        orders
    }

    fn take_in(&mut self, now: Duration, news: News) {
        if let Some(body) = news.body {
            self.body = body;
        }
        for (_, report) in news.reports {
            self.mission.hear(now, report);
        }
        if let Some(what) = news.order {
            self.mission.order(what);
        }
    }

    fn decide(&mut self, now: Duration, orders: &mut Orders) {
        for _ in 0..ROUNDS {
            let decided = self.mission.decide(now);
            if decided.is_empty() {
                break;
            }
            for happened in &decided {
                let instruction = self.mission.follow(happened, self.body.is_landing);
                orders.instructions.extend(instruction.map(|instruction| (now, instruction)));
            }
            self.mission.record(decided);
        }
        orders.limits = self.mission.changed_limits().cloned();
        orders.zones = self.mission.changed_zones();
    }

    /// The next script that is to be tried out, by whoever has the time for it.
    pub fn next_trial(&mut self) -> Option<Trial> {
        self.mission.next_trial()
    }

    /// Runs a script that has been tried out, or says why not.
    pub fn note_trial(&mut self, tried: Tried) {
        self.mission.note_trial(tried);
    }

    /// Everything selected here or heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        self.mission.take_selections()
    }

    /// Tells once when the disk does not take `what` must be kept, and once when it does again.
    pub fn note_disk(&mut self, what: &str, trouble: Option<&str>) {
        self.mission.note_disk(what, trouble);
    }

    /// The vehicle's node: its program, its peers, and what has come in that was not understood.
    #[must_use]
    pub fn node(&self) -> &NodeLink {
        self.mission.node()
    }

    #[must_use]
    pub fn name(&self) -> &NodeName {
        self.mission.name()
    }

    /// The outcome of the mission, once it has ended.
    #[must_use]
    pub fn outcome(&self) -> Option<&Outcome> {
        self.mission.outcome()
    }
}
