//! `serve`: the station's loop around its core.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use skein_disk::{PromiseStore, next_incarnation};
use skein_wire::{Key, Payload, Scene};
use skein_zenoh::{Complaints, ZenohConfig, ZenohLink, ZenohSession};

use super::recording::Recording;
use crate::bthreads::MissionOutcome;
use crate::config_file::Config;
use crate::console::Console;
use crate::core::GroundCore;
use crate::recorder::Level;

/// The station goes on at least this often, and at once when a message or an order has come.
const TICK: Duration = Duration::from_millis(20);

/// Serves until Ctrl-C, or until the mission is over. Returns how it went, once it is.
pub fn run(config: Config, until_over: bool) -> anyhow::Result<Option<MissionOutcome>> {
    let stopping = Arc::new(AtomicBool::new(false));
    let mut station = Station::open(config, &stopping)?;
    let mut told = false;
    while !stopping.load(Ordering::Relaxed) {
        station.go_on();
        if let Some(outcome) = station.core.finished().filter(|_| !told) {
            told = true;
            match outcome.succeeded() {
                true => tracing::info!("mission over: every vehicle did what it was sent for"),
                false => tracing::warn!("mission over; not as planned: {:?}", outcome.failed),
            }
            if until_over {
                break;
            }
        }
    }
    let outcome = station.core.finished();
    station.recording.finish()?;
    Ok(outcome)
}

struct Station {
    core: GroundCore,
    // Before the session's other users, so that the last words leave with it.
    link: ZenohLink,
    scenes: ZenohLink,
    scene: Option<Scene>,
    recording: Recording,
    console: Console,
    complaints: Complaints,
    began: Instant,
}

impl Station {
    fn open(mut config: Config, stopping: &Arc<AtomicBool>) -> anyhow::Result<Self> {
        let recording = Recording::create(&config.record)?;
        config.station.incarnation = next_incarnation(&config.state, &config.station.name)?;
        let (store, kept) = PromiseStore::open(&config.state, &config.station.name)?;
        config.station.kept = kept;
        let fleet = config.station.fleet.clone();
        let session = ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network))?;
        let link = session.listen(Key::subscriptions_with_boards(&fleet, &config.station.name))?;
        let scenes = session.listen(vec![Key::pattern::<Scene>(&fleet)])?;
        let bell = link.bell();
        let mut console = Console::serve(config.console, config.console_security.as_ref(), {
            let bell = bell.clone();
            move || bell.ring()
        })?;
        ctrlc::set_handler({
            let stopping = stopping.clone();
            move || {
                stopping.store(true, Ordering::Relaxed);
                bell.ring();
            }
        })
        .context("Ctrl-C cannot be caught")?;
        tracing::info!(
            "{} of fleet {fleet}, life {}, Zenoh on {:?}, {} vehicles",
            config.station.name,
            config.station.incarnation,
            session.locators(),
            config.station.vehicles.len()
        );
        tracing::info!("console: {}", console.url());
        let core = GroundCore::durable(config.station, Box::new(store));
        console.show_scene(&core, None);
        let complaints = Complaints::default();
        Ok(Self { core, link, scenes, scene: None, recording, console, complaints, began: Instant::now() })
    }

    /// Waits for something to do, and does it.
    fn go_on(&mut self) {
        self.link.bell().wait(TICK);
        let now = self.began.elapsed();
        for wish in self.console.take_orders() {
            tracing::info!("{wish}");
            wish.carry_out(&mut self.core);
        }
        self.core.attend(self.console.present());
        if let Err(error) = self.core.tick(now, &mut self.link) {
            tracing::error!("{error}");
            self.recording.note(now, Level::Error, self.core.name().as_str(), &error.to_string());
        }
        let happened = self.core.take_selections();
        self.recording.take_in(now, &self.core, &happened);
        self.console.publish(now, &self.core, &happened);
        self.look_at_scene(now);
        if let Some(line) = self.complaints.check(now, self.core.node(), &self.link) {
            tracing::warn!("{line}");
            self.recording.note(now, Level::Warning, self.core.name().as_str(), &line);
        }
    }

    /// Takes in what a simulated world says of itself, when it is new.
    fn look_at_scene(&mut self, now: Duration) {
        while let Some((_, payload)) = skein_wire::Link::poll(&mut self.scenes) {
            let Ok(Payload::Scene(scene)) = Payload::decode(&payload) else { continue };
            if self.scene.as_ref() != Some(&scene) {
                self.recording.scene(now, &scene);
                self.console.show_scene(&self.core, Some(&scene));
                self.scene = Some(scene);
            }
        }
    }
}
