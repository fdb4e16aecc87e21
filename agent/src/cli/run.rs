//! `run`: the agent's loop around its core.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use skein_disk::{PromiseStore, ScriptStore, next_incarnation};
use skein_mav::{Severity, Text};
use skein_wire::Fleet;
use skein_wire::event::{Advance, Declared as _, Homeward, What};
use skein_zenoh::{Bell, Complaints, ZenohConfig, ZenohLink, ZenohSession};

use super::lidar_scans::LidarScans;
use crate::autopilot_link::AutopilotLink;
use crate::cli::shadow_log::ShadowLog;
use crate::config_file::Config;
use crate::core::AgentCore;

/// The control loop's period.
const TICK: Duration = Duration::from_millis(20);
/// The autopilot's link is looked at this often. What has come since the last look counts as that old: so nothing that
/// waited while the agent did not run passes for fresh.
const LOOK: Duration = Duration::from_millis(5);

/// Flies until Ctrl-C, which lands the vehicle first; as a shadow, while a pilot does.
pub fn run(config: Config, is_shadow: bool) -> anyhow::Result<()> {
    let mut driver = Driver::open(config, is_shadow)?;
    let interruptions = Arc::new(AtomicU32::new(0));
    ctrlc::set_handler({
        let (interruptions, bell) = (interruptions.clone(), driver.bell.clone());
        move || {
            interruptions.fetch_add(1, Ordering::Relaxed);
            bell.ring();
        }
    })
    .context("Ctrl-C cannot be caught")?;
    let mut landing = false;
    loop {
        driver.go_on()?;
        match interruptions.load(Ordering::Relaxed) {
            0 => {}
            1 if driver.core.is_committed() && !is_shadow => {
                if !std::mem::replace(&mut landing, true) {
                    tracing::warn!("landing, then ending; Ctrl-C again ends at once");
                    driver.core.order(What::Land);
                }
            }
            _ => return Ok(()),
        }
    }
}

struct Driver {
    core: AgentCore,
    autopilot: AutopilotLink,
    /// Others that the autopilot's line is shared with.
    stations: Vec<AutopilotLink>,
    shadow: Option<ShadowLog>,
    link: ZenohLink,
    scans: Option<LidarScans>,
    bell: Bell,
    complaints: Complaints,
    began: Instant,
    looked: Duration,
    next_tick: Duration,
    /// Whether it has been told that what runs could not be written down.
    told_unsaved: bool,
}

impl Driver {
    fn open(mut config: Config, is_shadow: bool) -> anyhow::Result<Self> {
        config.agent.incarnation = next_incarnation(&config.state, &config.name, config.agent.incarnation)?;
        let (store, kept) = PromiseStore::open(&config.state, &config.name)?;
        config.agent.kept = kept;
        let (script_store, scripts) = ScriptStore::open(&config.state, &config.name);
        let scripts = scripts.unwrap_or_else(|lost| {
            tracing::warn!("{lost}");
            Vec::new()
        });
        let fleet = Fleet::new(&config.agent.fleet).context("`fleet`")?;
        let known = config.known();
        let session =
            ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network).of(&config.name, known))?;
        let link = session.link(&config.name)?;
        let lidar = config.lidar;
        let scans = lidar.map(|it| LidarScans::open(&fleet, &config.name, it, &session)).transpose()?;
        tracing::info!(
            "{} of fleet {fleet}, life {}, Zenoh on {:?}, autopilot {}",
            config.name,
            config.agent.incarnation,
            session.locators(),
            config.autopilot
        );
        let shadow = is_shadow.then(|| ShadowLog::create(&config.state, &config.name)).transpose()?;
        let core = AgentCore::durable(config.agent, Box::new(store))?
            .keeping_scripts(Box::new(script_store), &scripts);
        Ok(Self {
            core: if is_shadow { core.shadowing() } else { core },
            autopilot: AutopilotLink::new(config.autopilot),
            stations: config.stations.into_iter().map(AutopilotLink::new).collect(),
            shadow,
            bell: link.bell(),
            link,
            scans,
            complaints: Complaints::default(),
            began: Instant::now(),
            looked: Duration::ZERO,
            next_tick: Duration::ZERO,
            told_unsaved: false,
        })
    }

    /// Waits for something to do, and does it.
    fn go_on(&mut self) -> anyhow::Result<()> {
        let to_tick = self.next_tick.saturating_sub(self.began.elapsed());
        self.bell.wait(to_tick.min(LOOK));
        let now = self.began.elapsed();
        let core = &mut self.core;
        let looked = std::mem::replace(&mut self.looked, now);
        let (stations, autopilot) = (&mut self.stations, &mut self.autopilot);
        autopilot.receive(|bytes| {
            core.receive_mavlink(looked, bytes);
            stations.iter_mut().for_each(|station| station.send(bytes));
        });
        for station in stations {
            station.receive(|bytes| {
                core.overhear(now, bytes);
                autopilot.send(bytes);
            });
        }
        self.take_in_scans(now);
        if now >= self.next_tick {
            // Ticks that were missed are not made up for.
            self.next_tick = (self.next_tick + TICK).max(now);
            self.core.tick(now, &mut self.link);
            if let Some(line) = self.complaints.check(now, self.core.node(), &self.link) {
                tracing::warn!("{line}");
            }
            self.tell_unsaved();
            if let Some(shadow) = &mut self.shadow {
                shadow.write(&self.core)?;
            }
        } else if !self.link.is_empty() {
            self.core.respond(now, &mut self.link);
        }
        self.autopilot.send(&self.core.take_mavlink());
        self.tell();
        Ok(())
    }

    fn take_in_scans(&mut self, now: Duration) {
        let Some(scans) = &mut self.scans else { return };
        while let Some(scan) = scans.poll(now) {
            self.core.sense(now, &scan);
        }
    }

    /// Warns once when another life of the agent would not run the scripts that run now.
    fn tell_unsaved(&mut self) {
        let unsaved = self.core.unsaved_scripts();
        if let (false, Some(why)) = (self.told_unsaved, unsaved) {
            tracing::warn!(
                "which scripts run cannot be written down, so the agent would run others if it started again now: {why}"
            );
        }
        self.told_unsaved = unsaved.is_some();
    }

    /// Writes down what the autopilot says, and what the vehicle itself has decided or met.
    fn tell(&mut self) {
        for Text { severity, text } in self.core.take_texts() {
            match severity {
                Severity::Emergency | Severity::Alert | Severity::Critical | Severity::Error => {
                    tracing::error!("autopilot: {text}");
                }
                Severity::Warning => tracing::warn!("autopilot: {text}"),
                Severity::Notice | Severity::Info => tracing::info!("autopilot: {text}"),
                Severity::Debug => tracing::debug!("autopilot: {text}"),
            }
        }
        for happened in self.core.take_selections() {
            let repeated = matches!(happened.event.kind(), Advance::NAME | Homeward::NAME);
            if happened.home == *self.core.name() && !repeated {
                tracing::info!("{}", happened.event);
            }
        }
    }
}
