//! `preflight`: every check before take-off. It arms nothing, and sends no set-point.

use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

use clap::Args;
use serde_json::json;
use skein_bp::behaviour::Behaviours;
use skein_wire::{Check, CheckState, Fleet, Key, Link as _, Payload, Readiness, State};
use skein_zenoh::{ZenohConfig, ZenohLink, ZenohSession};

use super::lidar_scans::LidarScans;
use super::log::Log;
use super::signing_clock::SigningClock;
use crate::autopilot_link::{Address, AutopilotLink};
use crate::config_file::Config;
use crate::control::Control;
use crate::parts::Parts;

/// The control loop's period.
const TICK: Duration = Duration::from_millis(20);
/// The others say where they stand, and what their datum is, within this time.
const OTHERS_HEARD: Duration = Duration::from_secs(3);
/// Columns of the printed list: in all, and before what was found.
const COLUMNS: usize = 80;
const INDENT: usize = 25;

/// Options of `preflight`.
#[derive(Args)]
pub struct Preflight {
    /// Configuration of the agent; agent/agent.toml explains every field.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Seconds to wait for what is not known yet.
    #[arg(long, value_name = "S", default_value_t = 15)]
    wait: u64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Preflight {
    /// Makes the checks, and prints them; whether all pass.
    pub fn run(self, known: &Behaviours) -> anyhow::Result<bool> {
        let mut vehicle = Vehicle::open(Config::read(&self.config, known)?)?;
        let readiness = vehicle.check(Duration::from_secs(self.wait));
        if self.json {
            println!("{}", in_json(&readiness));
        } else {
            print!("{}", in_words(&readiness));
        }
        Ok(readiness.is_ready())
    }
}

struct Vehicle {
    control: Control,
    autopilot: AutopilotLink,
    /// The autopilot answers only whoever has spoken first.
    speaks_first: bool,
    scans: Option<LidarScans>,
    others: Option<ZenohLink>,
    signing: Option<SigningClock>,
    began: Instant,
}

impl Vehicle {
    fn open(mut config: Config) -> anyhow::Result<Self> {
        let fleet = Fleet::new(&config.agent.fleet)?;
        let known = config.known();
        let network =
            ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network).of(&config.name, known));
        let (mut scans, mut others) = (None, None);
        match network {
            Ok(session) => {
                let lidar = config.lidar;
                scans = lidar
                    .map(|it| LidarScans::open(&fleet, &config.name, it, &session, Log::open(None)?))
                    .transpose()?;
                let keys = vec![Key::pattern::<State>(&fleet), Key::pattern::<Readiness>(&fleet)];
                others = Some(session.listen(keys)?);
            }
            Err(error) => tracing::warn!("neither lidar nor other vehicles are heard: {error:#}"),
        }
        let signing = config.agent.signing.as_mut();
        let signing = signing
            .map(|it| SigningClock::start(it, &config.state, &config.name, SystemTime::now(), || {}))
            .transpose()?;
        let Parts { positioning, layers, .. } = Parts::of(&config.agent);
        Ok(Self {
            control: Control::new(config.agent.into(), config.name, positioning, layers)?,
            speaks_first: matches!(config.autopilot, Address::UdpOut(_)),
            autopilot: AutopilotLink::new(config.autopilot),
            scans,
            others,
            signing,
            began: Instant::now(),
        })
    }

    /// Looks until everything is known, for so long at most.
    fn check(&mut self, patience: Duration) -> Readiness {
        loop {
            self.look();
            let (readiness, elapsed) = (self.control.readiness(), self.began.elapsed());
            let is_known = readiness.checks.iter().all(|check| check.state != CheckState::Waits);
            if elapsed >= patience || is_known && elapsed >= OTHERS_HEARD.min(patience) {
                return readiness;
            }
            std::thread::sleep(TICK);
        }
    }

    fn look(&mut self) {
        let (now, control) = (self.began.elapsed(), &mut self.control);
        if let Some(signing) = &mut self.signing {
            signing.go_on(now);
        }
        self.autopilot.receive(|bytes| control.receive_mavlink(now, bytes));
        let scans = self.scans.as_mut();
        scans.into_iter().flat_map(|scans| std::iter::from_fn(|| scans.poll(now))).for_each(|scan| {
            control.sense(now, &scan);
        });
        let others = self.others.as_mut();
        for (_, payload) in others.into_iter().flat_map(|link| std::iter::from_fn(|| link.poll())) {
            match Payload::decode(&payload) {
                Ok(Payload::State(state)) if state.node != *control.name() => {
                    control.hear(now, vec![state]);
                }
                Ok(Payload::Readiness(said)) if said.node != *control.name() => {
                    control.hear_readiness(now, vec![said]);
                }
                _ => {}
            }
        }
        control.observe(now);
        let bytes = control.take_mavlink();
        // To an autopilot in flight, heartbeats that begin here, and then end, are the loss of its ground
        // station.
        if self.speaks_first || control.may_be_spoken_to() {
            self.autopilot.send(&bytes);
        }
    }
}

fn in_json(readiness: &Readiness) -> serde_json::Value {
    let check = |Check { name, state, value, advice }: &Check| json!({ "name": name, "state": state.word(), "value": value, "advice": advice });
    json!({
        "vehicle": readiness.node.as_str(),
        "ready": readiness.is_ready(),
        "checks": readiness.checks.iter().map(check).collect::<Vec<_>>(),
    })
}

fn in_words(readiness: &Readiness) -> String {
    let mut text = String::new();
    for Check { name, state, value, advice } in &readiness.checks {
        let found = wrapped(value, COLUMNS - INDENT);
        let advice = wrapped(advice, COLUMNS - INDENT - 2);
        let rest = advice.iter().enumerate().map(|(line, words)| {
            let arrow = if line == 0 { "> " } else { "  " };
            format!("{arrow}{words}")
        });
        let mut head = format!("{:7} {name:16} ", state.word());
        for line in found.into_iter().chain(rest) {
            text.push_str(&format!("{head}{line}\n"));
            head = " ".repeat(INDENT);
        }
    }
    let faults = readiness.faults().count();
    let verdict = match faults {
        0 => "is ready".to_owned(),
        1 => "is not ready: 1 check does not pass".to_owned(),
        _ => format!("is not ready: {faults} checks do not pass"),
    };
    text.push_str(&format!("{} {verdict}\n", readiness.node));
    text
}

/// The words of a text in lines of at most so many characters, a longer word in a line of its own.
fn wrapped(text: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use super::*;

    fn readiness() -> Readiness {
        let check = |name: &str, state, value: &str, advice: &str| Check {
            name: name.into(),
            state,
            value: value.into(),
            advice: advice.into(),
        };
        Readiness {
            node: skein_wire::NodeName::new("uav/1").unwrap(),
            incarnation: 0,
            home: [0.0; 3],
            datum: [0.0; 3],
            checks: vec![
                check("autopilot", CheckState::Passes, "PX4, in mode hold", ""),
                check(
                    "home",
                    CheckState::Fails,
                    "stands 12 m west of its home",
                    "carry it to its pad, or check `mission.home`, `datum` and `autopilot.system_id`",
                ),
            ],
        }
    }

    #[test]
    fn the_list_fits_80_columns_and_ends_with_the_verdict() {
        let text = in_words(&readiness());
        let expected = "\
passes  autopilot        PX4, in mode hold
fails   home             stands 12 m west of its home
                         > carry it to its pad, or check `mission.home`, `datum`
                           and `autopilot.system_id`
uav/1 is not ready: 1 check does not pass
";
        assert_eq!(text, expected);
        assert!(text.lines().all(|line| line.chars().count() <= COLUMNS));
    }

    #[test]
    fn in_json_every_check_has_its_state_and_value() {
        let text = in_json(&readiness());
        assert_eq!((&text["ready"], &text["vehicle"]), (&json!(false), &json!("uav/1")));
        assert_eq!(text["checks"][1]["state"], "fails");
        assert_eq!(text["checks"][0]["value"], "PX4, in mode hold");
    }
}
