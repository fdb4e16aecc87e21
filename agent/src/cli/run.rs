//! `run`: one vehicle's threads around its core.
//!
//! [Control](ControlThread) and [mission](MissionThread) have a thread each; a third writes control's lines,
//! and the program's first watches over them. The program never flies on with half of itself: without its
//! mission it lands and ends, without control it ends at once, and the autopilot's own failsafe acts.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context as _, bail};
use skein_disk::{Background, ListStore, Memory};
use skein_wire::{Fleet, Key};
use skein_zenoh::{Complaints, ZenohConfig, ZenohSession};

use super::control_thread::{ControlThread, Ended, Pace};
use super::exchange::Exchange;
use super::lidar_scans::LidarScans;
use super::log::Log;
use super::mission_thread::{MissionThread, Trials};
use super::signing_clock::SigningClock;
use super::watchdog::{LOOK_MS, Seen, Watchdog};
use crate::autopilot_link::AutopilotLink;
use crate::cli::shadow_log::ShadowLog;
use crate::config_file::Config;
use crate::core::AgentCore;

/// Patience with the mission's thread when the program ends: it may hang.
const TIME_TO_END: Duration = Duration::from_secs(1);

/// Flies until Ctrl-C, which lands the vehicle first; as a shadow, while a pilot does.
///
/// # Errors
/// It cannot begin, or one of its threads has ended by a fault.
pub fn run(config: Config, is_shadow: bool) -> anyhow::Result<()> {
    let (control, mission) = open(config, is_shadow)?;
    let exchange = control.exchange.clone();
    ctrlc::set_handler({
        let exchange = exchange.clone();
        move || exchange.interrupt()
    })
    .context("Ctrl-C cannot be caught")?;
    let named = |name: &str| thread::Builder::new().name(name.to_owned());
    let mission = named("mission").spawn(move || mission.run()).context("the mission's thread")?;
    let control = named("control").spawn(move || control.run()).context("control's thread")?;
    let ended = watch(&exchange, control, &mission);
    exchange.end();
    let asked = Instant::now();
    while !mission.is_finished() && asked.elapsed() < TIME_TO_END {
        thread::sleep(Duration::from_millis(5));
    }
    match ended? {
        Ended::Asked => Ok(()),
        Ended::WithoutMission => bail!("the mission's thread has ended by a fault"),
    }
}

/// Watches over the threads until control has ended.
fn watch(exchange: &Exchange, control: JoinHandle<Ended>, mission: &JoinHandle<()>) -> anyhow::Result<Ended> {
    let mut watchdog = Watchdog::default();
    while !control.is_finished() {
        if mission.is_finished() && !exchange.mission_is_gone.swap(true, Ordering::Relaxed) {
            tracing::error!(
                "the mission's thread has ended by a fault: the vehicle lands, and the program ends"
            );
        }
        match watchdog.look(exchange.beats.load(Ordering::Relaxed)) {
            Seen::Alive => {}
            Seen::Stalled => {
                tracing::error!(
                    "control hangs: set-points are silent, so that the autopilot's failsafe acts"
                );
            }
            Seen::Recovered => tracing::warn!("control goes on, and leaves the vehicle to who has it"),
            Seen::Hung => bail!("control has hung for 10 s"),
        }
        thread::sleep(Duration::from_millis(LOOK_MS));
    }
    // Its panic has been reported where it happened.
    control.join().map_err(|_| anyhow::anyhow!("control's thread has ended by a fault"))
}

fn open(mut config: Config, is_shadow: bool) -> anyhow::Result<(ControlThread, MissionThread)> {
    let fleet = Fleet::new(&config.agent.fleet).context("`fleet`")?;
    let known = config.known();
    let session =
        ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network).of(&config.name, known))?;
    let link = session.listen(Key::protocol_subscriptions(&fleet, &config.name))?;
    let vehicles = session.listen_to_newest(Key::vehicle_subscriptions(&fleet))?;
    let wake = {
        let bell = link.bell();
        move || bell.ring()
    };
    let memory =
        Memory::open(&config.state, &config.name, config.agent.incarnation, SystemTime::now(), wake.clone())?;
    config.agent.incarnation = memory.incarnation.number;
    config.agent.kept = memory.kept;
    let (script_store, scripts) = ListStore::of_scripts(&config.state, &config.name);
    let (scripts, lost_scripts) = match scripts {
        Ok(scripts) => (scripts, None),
        Err(lost) => (Vec::new(), Some(lost.to_string())),
    };
    let signing = config.agent.signing.as_mut();
    let signing = signing
        .map(|it| SigningClock::start(it, &config.state, &config.name, SystemTime::now(), wake.clone()))
        .transpose()
        .context("the disk's thread")?;
    let script_store = Background::new(script_store, wake).context("the disk's thread")?;
    let log = {
        let shadow = is_shadow.then(|| ShadowLog::create(&config.state, &config.name)).transpose()?;
        Log::open(shadow).context("the log's thread")?
    };
    let lidar = config.lidar;
    let scans =
        lidar.map(|it| LidarScans::open(&fleet, &config.name, it, &session, log.clone())).transpose()?;
    tracing::info!(
        "{} of fleet {fleet}, life {}, Zenoh on {:?}, autopilot {}",
        config.name,
        config.agent.incarnation,
        session.locators(),
        config.autopilot
    );
    let began = Instant::now();
    config.agent.epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let mut core =
        AgentCore::durable(config.agent, memory.promises)?.keeping_scripts(Box::new(script_store), &scripts);
    if let Some(lost) = memory.lost {
        tracing::error!("{lost}");
        core = core.having_lost_promises(&lost);
    }
    if is_shadow {
        core = core.shadowing();
    }
    let (control, mut mission) = core.split();
    if let Some(lost) = lost_scripts {
        tracing::error!("{lost}");
        mission.note_disk("former scripts", Some(&lost));
    }
    let exchange = Arc::new(Exchange::new(link.bell()));
    let control = ControlThread {
        side: control,
        autopilot: AutopilotLink::new(config.autopilot),
        stations: config.stations.into_iter().map(AutopilotLink::new).collect(),
        scans,
        vehicles,
        exchange: exchange.clone(),
        log,
        began,
        is_shadow,
        pace: Pace::default(),
    };
    let trials = Trials::start(link.bell()).context("the thread that tries scripts out")?;
    let mission = MissionThread {
        side: mission,
        link,
        exchange,
        incarnation: memory.incarnation,
        signing,
        complaints: Complaints::default(),
        trials,
        began,
    };
    Ok((control, mission))
}
