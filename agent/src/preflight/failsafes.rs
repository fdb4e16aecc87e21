//! Failsafes: reads the autopilot's own failsafe parameters while it is on the ground, again and again, because others
//! may change them, and refuses unsafe ones. Its dialect lists them.

use std::time::Duration;

use skein_mav::{Companion, Dialect, Failsafe, MavEvent, ParameterValue};
use skein_wire::Check;

use super::check;

/// They are read this often, so that what a vehicle takes off with is never older.
const READ_EVERY: Duration = Duration::from_secs(3);

/// What is known of the autopilot's failsafe parameters.
#[derive(Debug)]
pub struct Failsafes {
    /// The agent's system id, which some parameters name.
    system_id: u8,
    /// The make whose parameters these are.
    make: &'static str,
    listed: Vec<Listed>,
    read_again: Duration,
}

#[derive(Debug)]
struct Listed {
    failsafe: Failsafe,
    /// What the autopilot has told of each of its names.
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
        Self { system_id, make: "", listed: Vec::new(), read_again: Duration::ZERO }
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
            let names = self.listed.iter().flat_map(|listed| listed.failsafe.parameters);
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
        self.read_again = Duration::ZERO;
    }

    /// A check of each parameter.
    pub fn checks(&self) -> impl Iterator<Item = Check> + '_ {
        self.listed.iter().map(|listed| listed.check(self.system_id))
    }
}

impl Listed {
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
