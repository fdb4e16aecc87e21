//! From an operator's Hold in the console to the last vehicle's acknowledgement there.
//!
//! World, ground station and every agent run as processes over Zenoh on loopback; the operator is a WebSocket client of
//! the ground station's console, like a browser. A hold is acknowledged once its block is sure to be kept (G3).

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use skein_dbp::facts::DiskFails;
use skein_sim::cli::{Exit, Network, Setup};
use skein_sim::fly::{GROUND, vehicle_name};
use skein_sim::processes::Processes;
use skein_sim::scenario::{Overrides, Scenario};
use skein_wire::event::Declared as _;

use super::load::{Beat, DeepScripts, Garbage};
use crate::operator::Operator;
use crate::quantile::quantile;
use crate::task::Task;

/// Between two orders, a time that is no multiple of any period in the system.
const PAUSE: Duration = Duration::from_millis(137);
/// Patience with a disk that is busy.
const PATIENCE: Duration = Duration::from_secs(10);

#[derive(Args, Clone, Copy)]
pub struct Holds {
    #[command(flatten)]
    pub swarm: Swarm,
    /// Times that it is held.
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub holds: usize,
    /// Beside it a second operator sends, without a pause, a script whose set nests `and` 46 deep.
    #[arg(long)]
    pub deep_script: bool,
}

/// A swarm whose vehicles have a process each, and the trouble that it is in.
#[derive(Args, Clone, Copy)]
pub struct Swarm {
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 8)]
    pub vehicles: usize,
    /// Keep all states on a file system of 1 MB that fails so; for root only. While it fails a zone is drawn first, which
    /// must be kept on it.
    #[arg(long, value_name = "FAULT")]
    pub disk: Option<DiskFault>,
    /// One more member of the fleet sends 10 MB of garbage in each second, in place of what it said until then.
    #[arg(long)]
    pub garbage: bool,
    /// Use network ports so much further up, beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    pub port_offset: u16,
}

/// A fault of the disk that all states are kept on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DiskFault {
    /// It is full before anything is kept on it.
    FullFromStart,
    /// It is full as soon as everybody is in the air, as with those that follow.
    Full,
    /// It can only be read.
    ReadOnly,
    /// A file is where the folder was.
    Replaced,
    /// The folder is gone. Whoever keeps something makes it again, so that nothing fails.
    Removed,
}

impl DiskFault {
    pub fn all() -> &'static [Self] {
        Self::value_variants()
    }
}

impl Task for Holds {
    const NAME: &'static str = "hold";
    const ABOUT: &'static str =
        "From an operator's Hold to the last vehicle's acknowledgement, each in a process of its own";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let Measured { mut times_ms, beside } = self.measure()?;
        times_ms.sort_by(f64::total_cmp);
        let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| quantile(&times_ms, share));
        let (vehicles, holds) = (self.swarm.vehicles, times_ms.len());
        let garbage_mb = beside.garbage as f64 / 1e6;
        if as_json {
            let ack_ms = json!({ "p50": p50, "p99": p99, "max": max });
            let scripts = beside.scripts_refused;
            println!(
                "{}",
                json!({
                    "vehicles": vehicles, "holds": holds, "ack_ms": ack_ms,
                    "garbage_mb": garbage_mb, "scripts_refused": scripts,
                })
            );
        } else {
            println!(
                "Hold to the last of {vehicles} acknowledgements, {holds} times: median {p50:.1} ms, p99 {p99:.1} ms, \
                 longest {max:.1} ms"
            );
            if self.swarm.garbage {
                println!("{garbage_mb:.0} MB of garbage were sent meanwhile");
            }
            if self.deep_script {
                println!("{} deep scripts were refused meanwhile", beside.scripts_refused);
            }
        }
        Ok(Exit::Done)
    }
}

/// Times of an operator's orders, and the load beside them.
#[derive(Debug, Default)]
pub struct Measured {
    pub times_ms: Vec<f64>,
    pub beside: Beside,
}

/// Load on a swarm while its operator measures.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside {
    /// Bytes of garbage that a member sent.
    pub garbage: u64,
    /// Scripts that a second operator sent, and was refused.
    pub scripts_refused: usize,
}

impl Holds {
    /// Holds the swarm so often; the time of each hold in milliseconds, from the moment its order is sent.
    ///
    /// # Errors
    /// The swarm does not start or fly, a hold is lost or refused, or a script that is too deep is not refused.
    pub fn measure(self) -> anyhow::Result<Measured> {
        let Self { swarm, holds, deep_script } = self;
        let all = vehicles(swarm.vehicles);
        let refused = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&refused);
        let mut measured = with_operator("hold", swarm, move |operator| {
            let console = operator.console();
            let load = deep_script.then(|| Beat::of(move || DeepScripts::new(console, &counted)));
            if let Some(fault) = swarm.disk {
                keep_zone(operator, fault)?;
            }
            let times = hold(operator, &all, holds);
            load.map_or(Ok(()), Beat::end)?;
            times
        })?;
        measured.beside.scripts_refused = refused.load(Ordering::Relaxed);
        Ok(measured)
    }
}

/// The first so many vehicles, as an order names them.
fn vehicles(count: usize) -> Value {
    (0..count).map(|index| vehicle_name(index).to_string()).collect()
}

/// Measurements of an operator in a swarm whose vehicles have a process each, once they are all in the air.
///
/// # Errors
/// The swarm does not start or fly, or those of `measure`.
pub fn with_operator(
    what: &str,
    swarm: Swarm,
    measure: impl FnOnce(&mut Operator) -> anyhow::Result<Vec<f64>> + Send + 'static,
) -> anyhow::Result<Measured> {
    let Swarm { vehicles, disk, garbage, port_offset } = swarm;
    // An even number, for the reason below.
    let members = if garbage { (vehicles + 1).next_multiple_of(2) } else { vehicles };
    let overrides = Overrides { vehicles: Some(members), ..Overrides::default() };
    // Where each goal is another's start nobody sets out before everybody is in the air.
    let scenario = Scenario::open("antipodal", &overrides, 1)?;
    let folder =
        std::env::temp_dir().join(format!("skein-bench-{what}-{}-{port_offset}", std::process::id()));
    let small = disk.map(|_| SmallDisk::mount(&folder.join("state"))).transpose()?;
    if let (Some(DiskFault::FullFromStart), Some(small)) = (disk, &small) {
        small.fill()?;
    }
    let setup = Setup { network: Network::Peer, port_offset, launch_on_order: false, secure: false };
    let mut swarm = Processes::start(&scenario, &folder, setup)?;
    let console = swarm.console();
    let (in_the_air, are_in_the_air) = channel();
    let (go_on, goes_on) = channel();
    let operator = std::thread::spawn(move || {
        let mut operator = Operator::connect(console)?;
        operator.await_armed(members)?;
        // Whoever measures is there as long as this thread.
        let _ = in_the_air.send(());
        let _ = goes_on.recv();
        measure(&mut operator)
    });
    let sent = Arc::new(AtomicU64::new(0));
    let mut load = None;
    while !operator.is_finished() {
        swarm.step();
        if are_in_the_air.try_recv().is_ok() {
            if let (Some(fault), Some(small)) = (disk, &small) {
                small.fail(fault)?;
            }
            if garbage {
                // From now on the last vehicle is not itself.
                swarm.kill(&vehicle_name(members - 1))?;
                let member = Garbage::join(&folder, members - 1, &sent)?;
                load = Some(Beat::of(move || Ok(member)));
            }
            let _ = go_on.send(());
        }
    }
    let measured = operator.join().map_err(|_| anyhow::anyhow!("the operator's thread has panicked"))?;
    load.map_or(Ok(()), Beat::end)?;
    let log = fs::read_to_string(swarm.log_of(&GROUND)).unwrap_or_default();
    drop(swarm);
    drop(small);
    // What is left there is of no use to anybody.
    let _ = fs::remove_dir_all(&folder);
    let beside = Beside { garbage: sent.load(Ordering::Relaxed), scripts_refused: 0 };
    let measured = measured?;
    let fails = disk.is_some_and(|fault| fault != DiskFault::Removed);
    for vehicle in (0..vehicles).map(vehicle_name).filter(|_| fails) {
        let told = vehicle.event_name(DiskFails::NAME);
        ensure!(log.contains(&told), "the station's log does not have {told}");
    }
    Ok(Measured { times_ms: measured, beside })
}

/// Draws a zone, which every vehicle has to keep on its disk: sees that it does, or that it says why it does not, and
/// that the console tells whose disk fails.
fn keep_zone(operator: &mut Operator, fault: DiskFault) -> anyhow::Result<()> {
    let zone = json!({ "name": "pond", "kind": "no_fly", "centre_m": [500, 0], "radius_m": 5 });
    let refusals = operator.draw_or_refuse(&zone)?;
    if fault == DiskFault::Removed {
        ensure!(refusals.is_empty(), "a folder that could be made again was not: {refusals:?}");
        return Ok(());
    }
    let vehicles = refusals.keys().cloned().collect();
    let told = operator.await_disks_that_fail(&vehicles);
    told.with_context(|| format!("they do not keep the zone: {refusals:?}"))
}

/// Times each hold in milliseconds.
fn hold(operator: &mut Operator, all: &Value, holds: usize) -> anyhow::Result<Vec<f64>> {
    let mut times_ms = Vec::new();
    for _ in 0..holds {
        times_ms.push(operator.order("hold", all)?.as_secs_f64() * 1000.0);
        // On hold, so that nobody arrives meanwhile.
        std::thread::sleep(PAUSE);
        operator.order("resume", all)?;
    }
    Ok(times_ms)
}

/// A file system of 1 MB in memory. It is unmounted with this, if it is still there.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(at: &Path) -> anyhow::Result<Self> {
        fs::create_dir_all(at).with_context(|| at.display().to_string())?;
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=1m", "tmpfs"]).arg(at);
        let status = mount.status().context("mount")?;
        ensure!(status.success(), "{}: cannot be mounted: only root may", at.display());
        Ok(Self(at.to_owned()))
    }

    fn fail(&self, fault: DiskFault) -> anyhow::Result<()> {
        match fault {
            DiskFault::FullFromStart => Ok(()),
            DiskFault::Full => self.fill(),
            DiskFault::ReadOnly => self.make_read_only(),
            DiskFault::Removed => self.remove(),
            DiskFault::Replaced => {
                self.remove()?;
                // Until somebody who keeps something has not made the folder again.
                while File::create_new(&self.0).is_err() {
                    fs::remove_dir_all(&self.0).with_context(|| self.0.display().to_string())?;
                }
                Ok(())
            }
        }
    }

    fn make_read_only(&self) -> anyhow::Result<()> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let mut mount = Command::new("mount");
            let status = mount.args(["-o", "remount,ro"]).arg(&self.0).status().context("mount")?;
            if status.success() {
                return Ok(());
            }
            // It is busy while a file is written.
            ensure!(Instant::now() < deadline, "{}: cannot be made read-only", self.0.display());
        }
    }

    fn remove(&self) -> anyhow::Result<()> {
        let status = Command::new("umount").arg("--lazy").arg(&self.0).status().context("umount")?;
        ensure!(status.success(), "{}: cannot be unmounted", self.0.display());
        fs::remove_dir(&self.0).with_context(|| self.0.display().to_string())
    }

    /// Leaves no room on it.
    fn fill(&self) -> anyhow::Result<()> {
        let mut ballast = File::create(self.0.join("ballast"))?;
        while ballast.write(&[0; 4096]).is_ok_and(|written| written > 0) {}
        Ok(())
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // It is in memory, and goes with the computer at the latest.
        let mut umount = Command::new("umount");
        let _ = umount.args(["--lazy", "--quiet"]).arg(&self.0).status();
    }
}
