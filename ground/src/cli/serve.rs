//! `serve`: the station's loop around its core.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use anyhow::Context as _;
use skein_dbp::Happened;
use skein_dbp::facts::{DiskFails, DiskWorks};
use skein_disk::{Background, ListStore, Memory, Number};
use skein_wire::event::Declared as _;
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
    station.recording.finish();
    Ok(outcome)
}

struct Station {
    core: GroundCore,
    // Before the session's other users, so that the last words leave with it.
    link: ZenohLink,
    scenes: ZenohLink,
    scene: Option<Scene>,
    recording: Recording,
    incarnation: Number,
    console: Console,
    complaints: Complaints,
    began: Instant,
}

impl Station {
    fn open(mut config: Config, stopping: &Arc<AtomicBool>) -> anyhow::Result<Self> {
        let fleet = config.station.fleet.clone();
        let station = &config.station;
        let known = station.vehicles.iter().chain(&station.operators).cloned();
        let session =
            ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network).of(&station.name, known))?;
        let link = session.listen(Key::subscriptions_with_boards(&fleet, &config.station.name))?;
        let scenes = session.listen(vec![Key::pattern::<Scene>(&fleet)])?;
        let bell = link.bell();
        let recording_path = config.record.join("mission.mcap");
        let recording = Recording::begin(config.record, config.record_most_bytes)?;
        let wake = {
            let bell = bell.clone();
            move || bell.ring()
        };
        let memory = Memory::open(
            &config.state,
            &config.station.name,
            config.station.incarnation,
            SystemTime::now(),
            wake,
        )?;
        config.station.incarnation = memory.incarnation.number;
        config.station.kept = memory.kept;
        if memory.lost.is_some() {
            config.station.forgot = true;
            config.station.launch_on_order = true;
        }
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
        let (zone_store, zones) = ListStore::of_zones(&config.state, &config.station.name);
        let lost_zones = zones.map(|zones| config.station.zones = zones).err();
        let zone_store = Background::new(zone_store, {
            let bell = link.bell();
            move || bell.ring()
        })?;
        let mut core =
            GroundCore::durable(config.station, memory.promises).keeping_zones(Box::new(zone_store));
        if let Some(lost) = lost_zones {
            tracing::error!("{lost}");
            core.note_disk("former zones", Some(&lost.to_string()));
        }
        if let Some(lost) = memory.lost {
            tracing::error!("{lost}");
            let why = format!(
                "{lost}. Nobody takes off before an operator orders it, and nothing is decided together before a new roster"
            );
            core.note_disk("former promises", Some(&why));
        }
        console.note_recording(&recording_path);
        console.show_scene(&core, None);
        let complaints = Complaints::default();
        Ok(Self {
            core,
            link,
            scenes,
            scene: None,
            recording,
            incarnation: memory.incarnation,
            console,
            complaints,
            began: Instant::now(),
        })
    }

    /// Waits for something to do, and does it.
    fn go_on(&mut self) {
        self.link.bell().wait(TICK);
        let now = self.began.elapsed();
        for wish in self.console.take_orders() {
            tracing::info!("{wish}");
            wish.carry_out(&mut self.core);
        }
        self.incarnation.go_on(now);
        self.core.note_disk("incarnation", self.incarnation.trouble());
        self.core.note_disk("recording", self.recording.trouble().as_deref());
        self.core.attend(self.console.present());
        if let Err(error) = self.core.tick(now, &mut self.link) {
            tracing::error!("{error}");
            self.recording.note(now, Level::Error, self.core.name().as_str(), &error.to_string());
        }
        let happened = self.core.take_selections();
        happened.iter().for_each(tell_disk);
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
                self.core.know(&scene);
                self.console.show_scene(&self.core, Some(&scene));
                self.scene = Some(scene);
            }
        }
    }
}

/// Writes down that a disk fails, here or at a vehicle, and that it works again.
fn tell_disk(happened: &Happened) {
    match happened.event.kind() {
        DiskFails::NAME => tracing::error!("{}", happened.event),
        DiskWorks::NAME => tracing::warn!("{}", happened.event),
        _ => {}
    }
}
