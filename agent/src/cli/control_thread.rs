//! Control's thread: from the autopilot's bytes, scans, neighbours' states and the mission's orders to
//! set-points. It waits for nothing but its next look.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use skein_wire::event::What;
use skein_zenoh::ZenohLink;

use super::exchange::Exchange;
use super::lidar_scans::LidarScans;
use super::log::{Line, Log};
use crate::apart::{ControlSide, News};
use crate::autopilot_link::AutopilotLink;

/// The control loop's period.
const TICK: Duration = Duration::from_millis(20);
/// The autopilot's link is looked at this often. What has come since the last look counts as that old: so
/// nothing that waited while the agent did not run passes for fresh.
const LOOK: Duration = Duration::from_millis(5);

/// All that control needs.
pub struct ControlThread {
    pub side: ControlSide,
    pub autopilot: AutopilotLink,
    /// Others that the autopilot's line is shared with.
    pub stations: Vec<AutopilotLink>,
    pub scans: Option<LidarScans>,
    /// Other vehicles' words about themselves.
    pub vehicles: ZenohLink,
    pub exchange: Arc<Exchange>,
    pub log: Log,
    pub began: Instant,
    pub is_shadow: bool,
    pub pace: Pace,
}

/// Where the loop stands.
#[derive(Default)]
pub struct Pace {
    looked: Duration,
    next_tick: Duration,
    /// The news that the mission has yet to be told.
    news: News,
    is_ending: bool,
    told_silence: bool,
    last_set_point: Option<Duration>,
}

/// The way in which it has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// As it was asked to.
    Asked,
    /// The mission's thread has ended, and the vehicle is down, or not this agent's.
    WithoutMission,
}

impl ControlThread {
    /// Flies until it is asked to end, which lands the vehicle first; a second wish ends it at once.
    pub fn run(mut self) -> Ended {
        loop {
            self.go_on();
            let flies = self.side.is_committed() && !self.is_shadow;
            match self.exchange.interruptions.load(Ordering::Relaxed) {
                0 => {}
                1 if flies => self.land(),
                _ => return Ended::Asked,
            }
            if self.exchange.mission_is_gone.load(Ordering::Relaxed) {
                if !flies {
                    return Ended::WithoutMission;
                }
                self.side.lose_mission("its mission has ended by a fault");
            }
        }
    }

    /// Lands through the mission; by itself, if that is silent.
    fn land(&mut self) {
        if !std::mem::replace(&mut self.pace.is_ending, true) {
            self.log.warn("landing, then ending; Ctrl-C again ends at once");
            self.side.order(What::Land);
        }
        if self.side.mission_silence(self.began.elapsed()).is_some() {
            self.side.lose_mission("its program was asked to end");
        }
    }

    /// Waits for something to do, and does it.
    fn go_on(&mut self) {
        let to_tick = self.pace.next_tick.saturating_sub(self.began.elapsed());
        self.exchange.to_control().wait(to_tick.min(LOOK));
        let now = self.began.elapsed();
        self.take_in_mavlink(now);
        self.take_in_scans(now);
        if let Some(orders) = self.exchange.take_orders() {
            self.side.take_in(now, orders);
        }
        if now >= self.pace.next_tick {
            // Ticks that were missed are not made up for.
            self.pace.next_tick = (self.pace.next_tick + TICK).max(now);
            self.side.tick(now, &mut self.vehicles);
        }
        self.autopilot.send(&self.side.take_mavlink());
        self.tell(now);
        self.exchange.beats.fetch_add(1, Ordering::Relaxed);
    }

    fn take_in_mavlink(&mut self, now: Duration) {
        let looked = std::mem::replace(&mut self.pace.looked, now);
        let Self { side, stations, autopilot, .. } = self;
        autopilot.receive(|bytes| {
            side.receive_mavlink(looked, bytes);
            stations.iter_mut().for_each(|station| station.send(bytes));
        });
        for station in stations {
            station.receive(|bytes| {
                side.overhear(now, bytes);
                autopilot.send(bytes);
            });
        }
    }

    fn take_in_scans(&mut self, now: Duration) {
        let Some(scans) = &mut self.scans else { return };
        while let Some(scan) = scans.poll(now) {
            self.side.sense(now, &scan);
        }
    }

    fn tell(&mut self, now: Duration) {
        self.pace.news.merge(self.side.take_news());
        self.exchange.put_news(&mut self.pace.news);
        self.side.take_texts().into_iter().for_each(|text| self.log.put(Line::Text(text)));
        self.tell_silence(now);
        if let Some((at, set_point, motion)) = self.side.last_set_point().filter(|_| self.is_shadow)
            && self.pace.last_set_point.replace(at) != Some(at)
        {
            self.log.put(Line::SetPoint(Box::new((at, set_point, motion))));
        }
    }

    /// Says once that the mission is silent, and once that it is not any more.
    fn tell_silence(&mut self, now: Duration) {
        let is_silent = self.side.mission_silence(now).is_some();
        if std::mem::replace(&mut self.pace.told_silence, is_silent) != is_silent {
            self.log.warn(match is_silent {
                true => "its mission has decided nothing for half a second: the vehicle hovers, and lands after 10 s",
                false => "its mission decides again",
            });
        }
    }
}
