//! Failsafes: reads the autopilot's own failsafe parameters while it is on the ground, again and again,
//! because others may change them, and refuses unsafe ones. Its dialect lists them.

use std::time::Duration;

use skein_mav::{Companion, Dialect, Failsafe, MavEvent, ParameterValue};
use skein_wire::{Check, CheckState};

use super::check;

/// They are read this often, so that what a vehicle takes off with is never older.
const READ_EVERY: Duration = Duration::from_secs(3);

/// Names that the autopilot did not know are asked for again in one of so many rounds: it writes a complaint
/// of each.
const LACKING_EVERY: u32 = 10;

/// The autopilot's failsafe parameters, as far as they are known.
#[derive(Debug)]
pub struct Failsafes {
    /// The agent's system id, which some parameters name.
    system_id: u8,
    /// The make whose parameters these are.
    make: &'static str,
    listed: Vec<Listed>,
    read_again: Duration,
    rounds: u32,
}

#[derive(Debug)]
struct Listed {
    failsafe: Failsafe,
    /// The autopilot's answer to each of its names.
    told: Vec<Option<Told>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Told {
    Value(ParameterValue),
    Missing,
}

impl Failsafes {
    /// Nothing is known yet of an autopilot whose companion has this system id.
    pub fn new(system_id: u8) -> Self {
        Self { system_id, make: "", listed: Vec::new(), read_again: Duration::ZERO, rounds: 0 }
    }

    /// Asks for the parameters, if that is due.
    pub fn ask(&mut self, now: Duration, companion: &mut Companion) {
        let telemetry = companion.telemetry();
        if !telemetry.connected || telemetry.armed {
            return;
        }
        if self.make != companion.dialect().name() {
            self.forget(companion.dialect());
        }
        if now >= self.read_again {
            self.read_again = now + READ_EVERY;
            let asks_all = self.rounds.is_multiple_of(LACKING_EVERY);
            self.rounds = self.rounds.wrapping_add(1);
            let names = self.listed.iter().flat_map(|listed| listed.to_ask(asks_all, self.system_id));
            names.for_each(|name| companion.read_parameter(name));
        }
    }

    /// Takes in the autopilot's answers, and what it tells of itself. After a silence it may be another one.
    pub fn hear(&mut self, event: &MavEvent, dialect: &dyn Dialect) {
        match event {
            MavEvent::ParameterRead { name, value } => self.note(name, Told::Value(*value)),
            MavEvent::ParameterMissing { name } => self.note(name, Told::Missing),
            MavEvent::HeartbeatLost | MavEvent::HeartbeatRegained => self.forget(dialect),
            MavEvent::ArmedChanged { .. } => self.read_again = Duration::ZERO,
            _ => {}
        }
    }

    fn note(&mut self, name: &str, told: Told) {
        for Listed { failsafe, told: known } in &mut self.listed {
            let named = failsafe.parameters.iter().zip(known).filter(|(parameter, _)| **parameter == name);
            named.for_each(|(_, known)| *known = Some(told));
        }
    }

    fn forget(&mut self, dialect: &dyn Dialect) {
        let listed =
            |failsafe: &Failsafe| Listed { failsafe: *failsafe, told: vec![None; failsafe.parameters.len()] };
        self.make = dialect.name();
        self.listed = dialect.failsafes().iter().map(listed).collect();
        (self.read_again, self.rounds) = (Duration::ZERO, 0);
    }

    /// A check of each parameter.
    pub fn checks(&self) -> impl Iterator<Item = Check> + '_ {
        self.listed.iter().map(|listed| listed.check(self.system_id))
    }
}

impl Listed {
    /// The names to ask for: those that the autopilot lacks only if `all` are, or if it must have one of
    /// them.
    fn to_ask(&self, all: bool, system_id: u8) -> impl Iterator<Item = &'static str> + '_ {
        let all = all || self.check(system_id).state != CheckState::Passes;
        let names = self.failsafe.parameters.iter().copied().zip(&self.told);
        names.filter(move |(_, told)| all || **told != Some(Told::Missing)).map(|(name, _)| name)
    }

    fn check(&self, system_id: u8) -> Check {
        let Self { failsafe, told } = self;
        let names = failsafe.parameters.iter().zip(told);
        let value = names.clone().find_map(|(name, told)| match told {
            Some(Told::Value(value)) => Some((*name, *value)),
            _ => None,
        });
        let name = failsafe.parameters.first().copied().unwrap_or_default();
        match value {
            Some((name, value)) => {
                check::judged(name, &value.as_f64().to_string(), failsafe.judge(Some(value), system_id))
            }
            None if told.contains(&None) => check::waits(name, "not told yet", "wait, or check the link"),
            None => check::judged(name, "this autopilot has none", failsafe.judge(None, system_id)),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use std::collections::BTreeMap;

    use skein_mav::DIALECTS;

    use super::*;

    fn dialect(name: &str) -> &'static dyn Dialect {
        DIALECTS.into_iter().find(|dialect| dialect.name() == name).unwrap()
    }

    /// The failsafes of an ArduPilot whose companion's system id is 3, which has told these values.
    fn told(values: &[(&str, Option<f32>)]) -> Failsafes {
        let mut failsafes = Failsafes::new(3);
        failsafes.hear(&MavEvent::HeartbeatRegained, dialect("ArduPilot"));
        for (name, value) in values {
            let name = (*name).to_owned();
            let event = match value {
                Some(value) => MavEvent::ParameterRead { name, value: ParameterValue::Real(*value) },
                None => MavEvent::ParameterMissing { name },
            };
            failsafes.hear(&event, dialect("ArduPilot"));
        }
        failsafes
    }

    fn state(failsafes: &Failsafes, name: &str) -> (CheckState, String) {
        let check = failsafes.checks().find(|check| check.name == name).unwrap();
        (check.state, check.value)
    }

    #[test]
    fn a_parameter_that_is_not_told_yet_is_waited_for_and_one_that_is_lacking_is_no_fault() {
        let failsafes = told(&[("FS_GCS_ENABLE", None), ("FS_GCS_TIMEOUT", None)]);
        assert_eq!(state(&failsafes, "GUID_TIMEOUT").0, CheckState::Waits);
        assert_eq!(state(&failsafes, "FS_GCS_TIMEOUT").0, CheckState::Passes);
        assert_eq!(state(&failsafes, "FS_GCS_ENABLE").0, CheckState::Fails, "every release has this one");
    }

    #[test]
    fn of_two_names_the_one_counts_that_the_release_has() {
        let failsafes = told(&[("SYSID_MYGCS", Some(3.0))]);
        assert_eq!(state(&failsafes, "SYSID_MYGCS"), (CheckState::Passes, "3".to_owned()));
        let failsafes = told(&[("SYSID_MYGCS", None), ("MAV_GCS_SYSID", Some(255.0))]);
        assert_eq!(state(&failsafes, "MAV_GCS_SYSID"), (CheckState::Fails, "255".to_owned()));
    }

    #[test]
    fn a_name_that_the_release_lacks_is_not_asked_for_every_time() {
        let failsafes = told(&[("SYSID_MYGCS", None), ("MAV_GCS_SYSID", Some(3.0)), ("FS_GCS_ENABLE", None)]);
        let asked = |all| {
            let names = failsafes.listed.iter().flat_map(|listed| listed.to_ask(all, 3));
            names.collect::<Vec<_>>()
        };
        assert!(asked(true).contains(&"SYSID_MYGCS") && !asked(false).contains(&"SYSID_MYGCS"));
        assert!(asked(false).contains(&"MAV_GCS_SYSID"));
        assert!(asked(false).contains(&"FS_GCS_ENABLE"), "it must have this one");
    }

    #[test]
    fn the_newest_value_counts_whoever_has_set_it() {
        let failsafes = told(&[("FS_GCS_ENABLE", Some(5.0)), ("FS_GCS_ENABLE", Some(0.0))]);
        assert_eq!(state(&failsafes, "FS_GCS_ENABLE"), (CheckState::Fails, "0".to_owned()));
    }

    #[test]
    fn after_a_silence_nothing_is_known_any_more() {
        let mut failsafes = told(&[("FS_GCS_ENABLE", Some(5.0))]);
        failsafes.hear(&MavEvent::HeartbeatRegained, dialect("ArduPilot"));
        assert_eq!(state(&failsafes, "FS_GCS_ENABLE").0, CheckState::Waits);
    }

    #[test]
    fn the_parameter_files_have_what_is_asked_for() {
        let settings = |text: &str, name: usize| -> BTreeMap<String, f64> {
            let lines = text.lines().filter(|line| !line.starts_with('#'));
            let read = |line: &str| {
                let words: Vec<_> = line.split([',', '\t']).collect();
                (words[name].to_owned(), words[name + 1].parse().unwrap())
            };
            lines.map(read).collect()
        };
        let asked = |make: &str| -> BTreeMap<String, f64> {
            dialect(make).safe_settings(1).into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
        };
        let arducopter = settings(include_str!("../../parameters/arducopter.param"), 0);
        assert_eq!(arducopter, asked("ArduPilot"));
        // Names that only old releases of PX4 have would be complained of.
        let px4 = settings(include_str!("../../parameters/px4.params"), 2);
        assert_eq!(px4.keys().collect::<Vec<_>>(), ["BAT1_SOURCE", "COM_OBL_RC_ACT", "COM_OF_LOSS_T"]);
        assert!(px4.iter().all(|(name, value)| asked("PX4")[name] == *value));
    }
}
