//! Control, at its own pace.

use std::time::Duration;

use skein_dbp::NodeName;
use skein_mav::{SetPoint, Text};
use skein_wire::event::What;
use skein_wire::{Link, Scan, VehicleLink};

use super::{
    news::{Body, News},
    orders::{Orders, Words},
};
use crate::{
    control::{Control, SetPointRecord},
    pipeline::set_point::SILENT_AFTER,
    positioning::Motion,
    report::Report,
};

/// An agent that has not run for this long has let its set-points fall silent, and does not take them up by
/// itself.
const LONGEST_PAUSE: Duration = SILENT_AFTER;
/// A navigation cycle and a state message to the others begin this often.
pub const CYCLE_PERIOD: Duration = Duration::from_millis(100);

/// Control of one vehicle, which hears and tells the others itself. Feed it bytes, scans and orders, tick it
/// every 20 ms, carry its bytes and its news away.
#[derive(Debug)]
pub struct ControlSide {
    pub(crate) control: Control,
    vehicles: VehicleLink,
    words: Words,
    news: News,
    next_cycle: Duration,
    last_tick: Option<Duration>,
    /// The vehicle is to land, and why; told the mission, which may be silent.
    must_land: Option<String>,
}

impl ControlSide {
    pub(crate) fn new(control: Control, vehicles: VehicleLink) -> Self {
        Self {
            control,
            vehicles,
            words: Words::default(),
            news: News::default(),
            next_cycle: Duration::ZERO,
            last_tick: None,
            must_land: None,
        }
    }

    /// Takes in bytes from the autopilot.
    pub fn receive_mavlink(&mut self, now: Duration, bytes: &[u8]) {
        self.control.receive_mavlink(now, bytes);
    }

    /// Bytes for the autopilot.
    pub fn take_mavlink(&mut self) -> Vec<u8> {
        self.control.take_mavlink()
    }

    /// Takes in what another station says to the autopilot through this agent: an order of it takes the
    /// vehicle over.
    pub fn overhear(&mut self, now: Duration, bytes: &[u8]) {
        if let Some(report) = self.control.overhear(bytes) {
            self.news.reports.put(now, report);
        }
    }

    /// Takes in a lidar scan.
    pub fn sense(&mut self, now: Duration, scan: &Scan) {
        self.control.sense(now, scan);
    }

    /// Carries out what the mission has decided.
    pub fn take_in(&mut self, now: Duration, orders: Orders) {
        self.control.note_decision(orders.decided);
        for (at, instruction) in orders.instructions {
            let report = self.control.carry_out(now, at, instruction);
            self.news.reports.extend(report.map(|report| (now, report)));
        }
        if let Some(limits) = orders.limits {
            self.control.limit(&limits);
        }
        if let Some(zones) = orders.zones {
            self.control.draw(now, zones);
        }
        if let Some(words) = orders.words {
            self.words = words;
        }
    }

    /// Says this of the mission to the others from now on.
    pub(crate) fn speak(&mut self, words: Words) {
        self.words = words;
    }

    /// The mission has ended, and will decide nothing any more: a vehicle that it had flown lands at once.
    pub fn lose_mission(&mut self, why: &str) {
        self.must_land.get_or_insert_with(|| why.to_owned());
    }

    /// Takes in an order of whoever is at this vehicle's own computer.
    pub fn order(&mut self, what: What) {
        self.news.order = Some(what);
    }

    /// One tick, every 20 ms: hears and tells others, and ends with a set-point.
    pub fn tick(&mut self, now: Duration, link: &mut dyn Link) {
        if let Some(report) = self.note_pause(now) {
            self.news.reports.put(now, report);
        }
        self.hear(now, link);
        let reports = self.control.observe(now);
        self.news.reports.extend(reports.into_iter().map(|report| (now, report)));
        if self.begins_cycle(now) {
            self.look_ahead_and_tell(now, link);
        }
        self.land_if_it_must(now);
        self.control.steer(now);
        self.news.body = Some(self.body());
    }

    fn hear(&mut self, now: Duration, link: &mut dyn Link) {
        self.vehicles.receive(link);
        self.control.hear(now, self.vehicles.take_states());
        self.control.hear_readiness(now, self.vehicles.take_readiness());
    }

    /// Whether a navigation cycle begins.
    pub(crate) fn begins_cycle(&mut self, now: Duration) -> bool {
        let begins = now >= self.next_cycle;
        if begins {
            self.next_cycle = now + CYCLE_PERIOD;
        }
        begins
    }

    fn look_ahead_and_tell(&mut self, now: Duration, link: &mut dyn Link) {
        let reports = self.control.look_ahead(now);
        self.news.reports.extend(reports.into_iter().map(|report| (now, report)));
        if let Some(readiness) = self.control.readiness_to_tell(now) {
            self.vehicles.put_readiness(readiness, link);
        }
        let silence = self.control.mission_silence(now);
        if let Some(body) = self.control.state(now) {
            let mut state = self.words.said_of(body);
            if let Some(silence) = silence {
                state.waiting_for = format!("its mission: no decision for {:.1} s", silence.as_secs_f64());
            }
            self.vehicles.put_state(state, link);
        }
    }

    fn land_if_it_must(&mut self, now: Duration) {
        if let Some(why) = &self.must_land
            && let Some(report) = self.control.land(now, why)
        {
            self.news.reports.put(now, report);
        }
    }

    /// Lets go of the vehicle if this has not run for long.
    pub(crate) fn note_pause(&mut self, now: Duration) -> Option<Report> {
        let pause = self.last_tick.replace(now).map_or(Duration::ZERO, |last| now.saturating_sub(last));
        if pause > LONGEST_PAUSE { self.control.wake(pause) } else { None }
    }

    fn body(&self) -> Body {
        Body {
            is_landing: self.control.flight().is_landing(),
            complaint: self.control.complaint(),
            here: self.control.circumstances().map(Into::into),
        }
    }

    /// Takes the news for the mission since the last call.
    pub fn take_news(&mut self) -> News {
        std::mem::take(&mut self.news)
    }

    /// Takes the lines that the autopilot has written since the last call.
    pub fn take_texts(&mut self) -> Vec<Text> {
        self.control.take_texts()
    }

    /// For how long the mission has not decided, if that is too long to fly on.
    pub fn mission_silence(&mut self, now: Duration) -> Option<Duration> {
        self.control.mission_silence(now)
    }

    /// Whether this agent has the vehicle in the air, or on its way there.
    #[must_use]
    pub fn is_committed(&self) -> bool {
        self.control.flight().is_committed()
    }

    /// The newest set-point, when it was made, and the motion of the vehicle as it is now; none before the
    /// first.
    #[must_use]
    pub fn last_set_point(&self) -> Option<(Duration, SetPoint, Motion)> {
        self.control.last_set_point()
    }

    #[must_use]
    pub fn set_points(&self) -> SetPointRecord {
        self.control.set_points()
    }

    /// The vehicle's node name.
    #[must_use]
    pub fn name(&self) -> &NodeName {
        self.control.name()
    }
}
