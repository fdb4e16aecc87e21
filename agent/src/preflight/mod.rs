//! Preflight: every check before take-off, each with its value and what to do if it does not pass. A vehicle
//! is ready when all pass. Another check is a function here, and its line in [`Situation::checks`].

mod check;
mod failsafes;
mod handling;
mod pad;

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Datum, Landed, Refused, Severity, Stamped, Telemetry, Text};
use skein_planning::airspace::KeepOut;
use skein_wire::{Check, CheckState};

pub use self::failsafes::Failsafes;
pub use self::handling::HandlingParameters;
pub use self::pad::Others;
use self::{
    check::{fails, passes, waits},
    pad::Pad,
};
use crate::config::AgentConfig;
use crate::neighbours::Neighbour;
use crate::pipeline::headroom::Look;
use crate::positioning::Estimate;
use crate::report::Report;

/// A vehicle that takes off knows where it is, and what is around it, from no longer ago than this.
const KNOWN_WITHIN: Duration = Duration::from_millis(500);
/// Least energy to take off with.
const BATTERY_TO_START: f64 = 0.3;
/// The checks are made this often at least.
const CHECK_EVERY: Duration = Duration::from_millis(100);
/// Faults that have lasted for so long are told.
const FAULTS_LAST: Duration = Duration::from_secs(1);
/// The column above the start is looked at every so often, m.
const LAYER_M: f64 = 0.2;
/// A line that the autopilot wrote longer ago has nothing to do with its present checks.
const WRITTEN_WITHIN: Duration = Duration::from_secs(60);

/// All that the checks are made of.
#[derive(Debug)]
pub struct Situation<'a> {
    pub now: Duration,
    pub config: &'a AgentConfig,
    pub telemetry: &'a Telemetry,
    /// The autopilot's make.
    pub make: &'static str,
    pub estimate: Estimate,
    /// Why the estimate is none to fly by, if so.
    pub doubt: Option<&'a str>,
    /// Of the battery, 0 to 1, as long as it is known.
    pub charge: Option<f64>,
    /// Why the battery does not hold the mission, if it does not.
    pub shortfall: Option<&'a str>,
    pub failsafes: &'a Failsafes,
    /// The check that it is known how the vehicle flies.
    pub envelope: Check,
    pub look: Option<Look>,
    /// Where nobody may fly.
    pub keep_out: Option<&'a KeepOut>,
    pub neighbours: &'a [Neighbour],
    pub others: &'a Others,
    /// Where the vehicle landed last in this life of the agent, m ENU.
    pub landed_at: Option<Vector3<f64>>,
    /// This agent has armed it, and it is not up yet.
    pub is_taking_off: bool,
    /// This agent flies it, takes it off or lands it.
    pub is_flown: bool,
    /// The limits on its motion do not contradict one another.
    pub has_somewhere_to_fly: bool,
}

/// The checks as they were found last.
#[derive(Debug, Default)]
pub struct Preflight {
    checks: Vec<Check>,
    is_ready: bool,
    next: Duration,
    /// The vehicle's stand at the last checks: a change of it is checked at once.
    stand: Option<(bool, Landed, bool)>,
    /// The names of the checks that do not pass, and since when it has been these.
    faults: (Vec<String>, Duration),
    told: Vec<String>,
}

impl Preflight {
    /// Makes the checks, if that is due.
    pub fn update(&mut self, situation: &Situation<'_>) -> Option<Report> {
        let Situation { now, telemetry, is_taking_off, .. } = situation;
        let stand = Some((telemetry.armed, telemetry.landed, *is_taking_off));
        if *now < self.next && stand == self.stand {
            return None;
        }
        (self.next, self.stand) = (*now + CHECK_EVERY, stand);
        self.checks = situation.checks(self.is_ready);
        let faults: Vec<_> = self.faulty().map(|check| check.name.clone()).collect();
        let was_ready = std::mem::replace(&mut self.is_ready, faults.is_empty());
        if faults != self.faults.0 {
            self.faults = (faults, *now);
        }
        let lasts = *now >= self.faults.1 + FAULTS_LAST && self.faults.0 != self.told;
        let tells = was_ready != self.is_ready || !self.is_ready && lasts;
        tells.then(|| {
            self.told.clone_from(&self.faults.0);
            if self.is_ready { Report::Ready } else { Report::Unready(self.why()) }
        })
    }

    pub fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// All checks, in the order in which people look at them.
    pub fn checks(&self) -> &[Check] {
        &self.checks
    }

    /// The checks that do not pass: those that hang on one that does not are left out.
    fn faulty(&self) -> impl Iterator<Item = &Check> {
        let does_not_pass = |check: &&Check| check.state != CheckState::Passes;
        let first = self.checks.iter().take(1).any(|check| does_not_pass(&check));
        let most = if first { 1 } else { usize::MAX };
        self.checks.iter().filter(does_not_pass).take(most)
    }

    /// Why the vehicle is not ready, in words; empty if it is.
    pub fn why(&self) -> String {
        let words = |check: &Check| match &*check.advice {
            "" => format!("{}: {}", check.name, check.value),
            advice => format!("{}: {} ({advice})", check.name, check.value),
        };
        self.faulty().map(words).collect::<Vec<_>>().join("; ")
    }

    /// Why a vehicle on the ground is not ready; none of one that is, or that flies.
    pub fn complaint(&self) -> Option<String> {
        let flies = self.checks.iter().any(|check| check.value == FLIES);
        (!self.is_ready && !flies).then(|| self.why())
    }
}

/// The only check of a vehicle that is not on the ground, and what it finds.
const STAND: &str = "stand";
const FLIES: &str = "it flies";

impl Situation<'_> {
    fn checks(&self, was_ready: bool) -> Vec<Check> {
        let stand = self.stand(was_ready);
        if stand.value == FLIES {
            return vec![stand];
        }
        let mut checks = vec![self.autopilot(), stand, self.position()];
        checks.extend(self.lidar());
        checks.extend(self.place());
        checks.extend([
            self.overhead(),
            self.airspace(),
            self.battery(),
            self.mission(),
            self.envelope.clone(),
            self.limits(),
            self.arming(),
        ]);
        checks.extend(self.failsafes.checks());
        checks
    }

    /// On the ground, and nobody else has armed it.
    fn stand(&self, was_ready: bool) -> Check {
        let Telemetry { landed, armed, .. } = self.telemetry;
        match (landed, armed) {
            _ if was_ready && *armed && self.is_taking_off => passes(STAND, "takes off"),
            (Landed::Unknown, _) => waits(STAND, "not told yet whether it is on the ground", "wait"),
            (Landed::OnGround, false) => passes(STAND, "on the ground, disarmed"),
            (Landed::OnGround, true) if self.is_flown => fails(STAND, FLIES, ""),
            (Landed::OnGround, true) => fails(STAND, "somebody else has armed it", "disarm it"),
            _ => fails(STAND, FLIES, ""),
        }
    }

    fn autopilot(&self) -> Check {
        let (name, advice) =
            ("autopilot", "connect it, and check `autopilot.link` and `autopilot.system_id`");
        match self.telemetry.last_heartbeat {
            _ if !self.telemetry.connected && self.telemetry.refused.total() > 0 => {
                let Refused { unsigned, wrong, old } = self.telemetry.refused;
                let found = format!(
                    "frames refused: {unsigned} unsigned, {wrong} with another key, {old} signed too long ago"
                );
                let advice = "give it the key of `autopilot.signing`, set this computer's clock, or accept what is \
                              unsigned by `refuse_unsigned = false`";
                fails(name, found, advice)
            }
            None => waits(name, "no autopilot heard", advice),
            Some(_) if !self.telemetry.connected => fails(name, "silent", advice),
            Some(_) => {
                let version = if self.telemetry.knows_mavlink_1_only { ", MAVLink 1 only" } else { "" };
                passes(name, format!("{}, in mode {}{version}", self.make, self.telemetry.mode))
            }
        }
    }

    fn position(&self) -> Check {
        let name = "position";
        match self.estimate.motion {
            None => waits(name, "no position yet", "wait for its satellites, under open sky"),
            Some(_) if !self.estimate.is_fresh(self.now, KNOWN_WITHIN) => {
                fails(name, "position or attitude is old", "check the link to the autopilot")
            }
            Some(_) if let Some(why) = self.doubt => {
                fails(name, why, "wait until its estimate is good again")
            }
            Some(motion) => passes(name, format!("good to {:.2} m", motion.value.position_sigma_m())),
        }
    }

    fn lidar(&self) -> Option<Check> {
        let (name, advice) =
            ("lidar", "start its driver, and check `lidar.sensor` and both computers' clocks");
        self.config.lidar.then(|| match self.look {
            None => waits(name, "no scan", advice),
            Some(_) if self.fresh_look().is_none() => fails(name, "no scan any more", advice),
            Some(_) => passes(name, "scans come"),
        })
    }

    fn fresh_look(&self) -> Option<Look> {
        self.look.filter(|look| self.now.saturating_sub(look.stamp) < KNOWN_WITHIN)
    }

    /// Where it stands: it is not looked at again while it takes off.
    fn place(&self) -> Vec<Check> {
        let AgentConfig { home, fence, envelope, datum, .. } = self.config;
        let Some(motion) = self.estimate.motion.filter(|_| self.telemetry.home.is_some()) else {
            return vec![pad::unknown()];
        };
        if self.is_taking_off {
            return vec![passes("home", "has left it")];
        }
        let pad = Pad {
            now: self.now,
            motion: &motion.value,
            home: (*home).into(),
            landed_at: self.landed_at,
            fence,
            envelope,
            neighbours: self.neighbours,
            others: self.others,
        };
        vec![pad.home(), pad.pad(), pad.fence(), pad.datum(degrees(datum))]
    }

    /// Nothing is above as far as it climbs: nobody who flies, and nothing that the range finder sees.
    fn overhead(&self) -> Check {
        let (name, AgentConfig { envelope, home, takeoff_height_m, .. }) = ("overhead", self.config);
        if self.is_taking_off {
            return passes(name, "was clear");
        }
        let start = self.estimate.motion.map_or(Vector3::from(*home), |motion| motion.value.position);
        if let Some(other) = self.neighbours.iter().find(|other| other.may_be_over(&start, envelope)) {
            return fails(name, format!("{} may be above", other.node), "wait until it has gone");
        }
        let climbs_m = takeoff_height_m + envelope.hull_m + envelope.margin_m;
        match self.fresh_look().map(|look| look.up_m) {
            Some(Some(up_m)) if up_m < climbs_m => fails(
                name,
                format!("a roof {up_m:.1} m above it"),
                format!(
                    "it climbs to {takeoff_height_m} m: move it under open sky, or lower `takeoff_height_m`"
                ),
            ),
            Some(_) => passes(name, "clear"),
            None => passes(name, "nobody else is above; nothing looks up"),
        }
    }

    /// No closed airspace is above: who stands in a zone may leave it.
    fn airspace(&self) -> Check {
        let (name, AgentConfig { home, takeoff_height_m, .. }) = ("airspace", self.config);
        let start = self.estimate.motion.map_or(Vector3::from(*home), |motion| motion.value.position);
        let layers = (takeoff_height_m / LAYER_M).ceil() as u32;
        let is_closed = |height_m: &f64| {
            let place = start + Vector3::z() * *height_m;
            self.keep_out.is_some_and(|zones| zones.bare_room_m(&place) < 0.0)
        };
        let heights_m = (0..=layers).map(|layer| f64::from(layer) * LAYER_M);
        match heights_m.clone().find(is_closed) {
            Some(height_m) if height_m > 0.0 => fails(
                name,
                format!("closed from {height_m:.1} m above the start"),
                "start elsewhere, or lower `takeoff_height_m`",
            ),
            _ => passes(name, "open above the start"),
        }
    }

    fn battery(&self) -> Check {
        let name = "battery";
        match self.charge {
            None => waits(name, "no charge told", "connect its monitor, and set its parameters"),
            Some(charge) => {
                let value = format!("{:.0} %", 100.0 * charge);
                match charge >= BATTERY_TO_START {
                    true => passes(name, value),
                    false => fails(name, value, format!("charge it to {:.0} %", 100.0 * BATTERY_TO_START)),
                }
            }
        }
    }

    /// The battery holds the mission.
    fn mission(&self) -> Check {
        match self.shortfall {
            None => passes("mission", "as far as is known, the battery holds it"),
            Some(why) => fails("mission", why, "shorten it, or charge the battery"),
        }
    }

    fn limits(&self) -> Check {
        match self.has_somewhere_to_fly {
            true => passes("limits", "leave room to fly"),
            false => fails("limits", "the limits on its motion leave no room", "unload one of those scripts"),
        }
    }

    fn arming(&self) -> Check {
        let (name, telemetry) = ("arming", self.telemetry);
        if telemetry.ready_to_arm {
            return passes(name, "the autopilot's own checks pass");
        }
        let recent = |text: &&Stamped<Text>| {
            text.age(self.now) <= WRITTEN_WITHIN && text.value.severity <= Severity::Warning
        };
        let text = telemetry.texts.iter().rev().find(recent);
        let why = text.map_or_else(String::new, |text| format!(": {}", text.value.text));
        waits(name, format!("the autopilot's own checks fail{why}"), "see its own messages")
    }
}

/// Latitude and longitude, degrees, and height, metres.
pub fn degrees(datum: &Datum) -> [f64; 3] {
    [datum.latitude_rad.to_degrees(), datum.longitude_rad.to_degrees(), datum.height_m]
}

#[cfg(all(test, feature = "zenoh"))]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use nalgebra::UnitQuaternion;
    use skein_mav::Battery;
    use skein_planning::airspace::Airspace;

    use super::*;
    use crate::config_file::Config;
    use crate::positioning::{Attitude, Motion};

    const NOW: Duration = Duration::from_secs(50);

    /// All that is told by a vehicle that is ready, or is not.
    struct Told {
        config: AgentConfig,
        telemetry: Telemetry,
        estimate: Estimate,
        look: Option<Look>,
        keep_out: Option<KeepOut>,
        shortfall: Option<&'static str>,
        doubt: Option<&'static str>,
        failsafes: Failsafes,
        others: Others,
        is_taking_off: bool,
        is_flown: bool,
        has_somewhere_to_fly: bool,
    }

    impl Told {
        fn ready() -> Self {
            let motion = Motion::new(Vector3::zeros(), Vector3::zeros(), [0.05, 0.05, 0.1]);
            let attitude = Attitude {
                body_to_world: UnitQuaternion::identity(),
                rate: Vector3::zeros(),
                covariance: nalgebra::Matrix3::identity(),
            };
            let battery = Battery { fraction: 0.9, voltage_v: 15.0 };
            Self {
                config: Config::example().unwrap().agent,
                telemetry: Telemetry {
                    last_heartbeat: Some(NOW),
                    connected: true,
                    landed: Landed::OnGround,
                    home: Some(Vector3::zeros()),
                    ready_to_arm: true,
                    battery: Some(Stamped { stamp: NOW, value: battery }),
                    ..Telemetry::default()
                },
                estimate: Estimate {
                    motion: Some(Stamped { stamp: NOW, value: motion }),
                    attitude: Some(Stamped { stamp: NOW, value: attitude }),
                    ..Estimate::default()
                },
                look: Some(Look { stamp: NOW, up_m: None, down_m: None }),
                keep_out: None,
                shortfall: None,
                doubt: None,
                failsafes: Failsafes::new(1),
                others: Others::new(),
                is_taking_off: false,
                is_flown: false,
                has_somewhere_to_fly: true,
            }
        }

        fn update(&self, preflight: &mut Preflight, now: Duration) -> Option<Report> {
            preflight.update(&Situation {
                now,
                config: &self.config,
                telemetry: &self.telemetry,
                make: "PX4",
                estimate: self.estimate,
                doubt: self.doubt,
                charge: self.telemetry.battery.map(|battery| battery.value.fraction),
                shortfall: self.shortfall,
                failsafes: &self.failsafes,
                envelope: passes("envelope", "as configured"),
                look: self.look,
                keep_out: self.keep_out.as_ref(),
                neighbours: &[],
                others: &self.others,
                landed_at: None,
                is_taking_off: self.is_taking_off,
                is_flown: self.is_flown,
                has_somewhere_to_fly: self.has_somewhere_to_fly,
            })
        }

        /// Why it is not ready.
        fn why(&self) -> String {
            let mut preflight = Preflight::default();
            self.update(&mut preflight, NOW);
            preflight.why()
        }
    }

    /// The zone that begins 2 m above the origin.
    fn zone_above() -> KeepOut {
        let zone = "[[no_fly]]\ncentre_m = [0.0, 0.0]\nradius_m = 3.0\nfloor_m = 2.0\nceiling_m = 6.0\n";
        let table: skein_planning::airspace::AirspaceTable = toml::from_str(zone).unwrap();
        let airspace: Airspace = table.check().unwrap();
        KeepOut::new(airspace, 1.0, 1.0)
    }

    #[test]
    fn each_check_that_does_not_pass_is_named_with_what_was_found() {
        type Change = fn(&mut Told);
        let cases: [(Change, &str); 18] = [
            (|_| {}, ""),
            (|told| told.telemetry.last_heartbeat = None, "autopilot: no autopilot heard"),
            (|told| told.telemetry.connected = false, "autopilot: silent"),
            (
                |told| (told.telemetry.connected, told.telemetry.refused.unsigned) = (false, 7),
                "autopilot: frames refused: 7 unsigned, 0 with another key",
            ),
            (|told| told.estimate.motion = None, "position: no position yet"),
            (|told| told.estimate.attitude = None, "position: position or attitude is old"),
            (|told| told.look = None, "lidar: no scan"),
            (|told| told.look.as_mut().unwrap().stamp -= KNOWN_WITHIN, "lidar: no scan any more"),
            (|told| told.look.as_mut().unwrap().up_m = Some(2.9), "overhead: a roof 2.9 m above it"),
            (|told| told.keep_out = Some(zone_above()), "airspace: closed from 2.2 m above the start"),
            (|told| told.telemetry.battery = None, "battery: no charge told"),
            (|told| told.telemetry.battery.as_mut().unwrap().value.fraction = 0.29, "battery: 29 %"),
            (|told| told.shortfall = Some("it takes 9 minutes"), "mission: it takes 9 minutes"),
            (|told| told.doubt = Some("its position is uncertain"), "position: its position is uncertain"),
            (|told| told.has_somewhere_to_fly = false, "limits: the limits"),
            (|told| told.telemetry.ready_to_arm = false, "arming: the autopilot's own checks fail"),
            (|told| told.telemetry.armed = true, "stand: somebody else has armed it"),
            (|told| told.telemetry.landed = Landed::InAir, "stand: it flies"),
        ];
        for (change, fault) in cases {
            let mut told = Told::ready();
            change(&mut told);
            let why = told.why();
            assert!(why.starts_with(fault) && why.is_empty() == fault.is_empty(), "{why:?}: not {fault:?}");
        }
        let mut high = Told::ready();
        high.look.as_mut().unwrap().up_m = Some(3.1);
        assert_eq!(high.why(), "", "it climbs to 2.5 m, and needs half a metre above that");
    }

    #[test]
    fn of_an_autopilot_that_is_not_heard_nothing_else_is_told() {
        let mut told = Told::ready();
        (told.telemetry.last_heartbeat, told.estimate.motion, told.telemetry.battery) = (None, None, None);
        let why = told.why();
        assert!(why.starts_with("autopilot: ") && !why.contains(';'), "{why}");
    }

    #[test]
    fn a_fault_is_told_at_once_and_others_once_they_last() {
        let (mut preflight, mut told) = (Preflight::default(), Told::ready());
        assert_eq!(told.update(&mut preflight, NOW), Some(Report::Ready));
        told.look = Some(Look { stamp: NOW, up_m: Some(1.0), down_m: None });
        let report = told.update(&mut preflight, NOW + CHECK_EVERY);
        assert!(matches!(report, Some(Report::Unready(why)) if why.starts_with("overhead: ")));
        told.has_somewhere_to_fly = false;
        assert_eq!(told.update(&mut preflight, NOW + 2 * CHECK_EVERY), None);
        let (mut reports, mut now) = (Vec::new(), NOW + 3 * CHECK_EVERY);
        while now < NOW + Duration::from_secs(4) {
            told.look = Some(Look { stamp: now, up_m: Some(1.0), down_m: None });
            for stamp in [
                &mut told.estimate.motion.as_mut().unwrap().stamp,
                &mut told.estimate.attitude.as_mut().unwrap().stamp,
            ] {
                *stamp = now;
            }
            reports.extend(told.update(&mut preflight, now));
            now += CHECK_EVERY;
        }
        assert!(matches!(&*reports, [Report::Unready(why)] if why.contains("limits: ")), "{reports:?}");
    }

    #[test]
    fn a_vehicle_that_was_ready_takes_off_whatever_is_above_it_then() {
        let (mut preflight, mut told) = (Preflight::default(), Told::ready());
        told.update(&mut preflight, NOW);
        (told.telemetry.armed, told.is_taking_off, told.is_flown) = (true, true, true);
        told.telemetry.landed = Landed::TakingOff;
        told.look.as_mut().unwrap().up_m = Some(1.0);
        assert_eq!(told.update(&mut preflight, NOW), None);
        (told.telemetry.landed, told.is_taking_off) = (Landed::InAir, false);
        assert!(matches!(told.update(&mut preflight, NOW), Some(Report::Unready(_))));
        assert_eq!(preflight.complaint(), None, "it flies");
    }
}
