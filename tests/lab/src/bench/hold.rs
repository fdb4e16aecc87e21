//! From an operator's Hold in the console to the last vehicle's acknowledgement there.
//!
//! World, ground station and every agent run as processes over Zenoh on loopback; the operator is a WebSocket client of
//! the ground station's console, like a browser. A hold is acknowledged once its block is sure to be kept (G3).

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::channel;
use std::time::Duration;

use anyhow::{Context as _, ensure};
use clap::{Args, ValueEnum};
use serde_json::json;
use skein_sim::cli::{Exit, Network, Setup};
use skein_sim::processes::Processes;
use skein_sim::scenario::{Overrides, Scenario};

use crate::operator::Operator;
use crate::quantile::quantile;
use crate::task::Task;

/// Between two orders, a time that is no multiple of any period in the system.
const PAUSE: Duration = Duration::from_millis(137);

#[derive(Args)]
pub struct Holds {
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 8)]
    vehicles: usize,
    /// Times that it is held.
    #[arg(long, value_name = "N", default_value_t = 200)]
    holds: usize,
    /// Keep all states on a file system of 1 MB that is full from then on; for root only.
    #[arg(long, value_name = "WHEN")]
    full_disk: Option<Moment>,
    /// Use network ports so much further up, beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    port_offset: u16,
}

/// When the disk becomes full.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Moment {
    /// Before anything is kept on it.
    Start,
    /// When everybody is in the air.
    Flight,
}

impl Task for Holds {
    const NAME: &'static str = "hold";
    const ABOUT: &'static str =
        "From an operator's Hold to the last vehicle's acknowledgement, each in a process of its own";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let Self { vehicles, holds, full_disk, port_offset } = *self;
        let mut times_ms = measure(vehicles, holds, full_disk, port_offset)?;
        times_ms.sort_by(f64::total_cmp);
        let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| quantile(&times_ms, share));
        if as_json {
            let ack_ms = json!({ "p50": p50, "p99": p99, "max": max });
            println!("{}", json!({ "vehicles": vehicles, "holds": times_ms.len(), "ack_ms": ack_ms }));
        } else {
            println!(
                "Hold to the last of {vehicles} acknowledgements, {} times: median {p50:.1} ms, p99 {p99:.1} ms, longest {max:.1} ms",
                times_ms.len()
            );
        }
        Ok(Exit::Done)
    }
}

/// Holds a swarm so often; the time of each hold in milliseconds, from the moment its order is sent.
///
/// # Errors
/// The swarm does not start or fly, or a hold is lost or refused.
pub fn measure(
    vehicles: usize,
    holds: usize,
    full_disk: Option<Moment>,
    port_offset: u16,
) -> anyhow::Result<Vec<f64>> {
    with_operator("hold", vehicles, full_disk, port_offset, move |operator| hold(operator, holds))
}

/// What an operator measures in a swarm whose vehicles have a process each, once they are all in the air.
///
/// # Errors
/// The swarm does not start or fly, or those of `measure`.
pub fn with_operator(
    what: &str,
    vehicles: usize,
    full_disk: Option<Moment>,
    port_offset: u16,
    measure: impl FnOnce(&mut Operator) -> anyhow::Result<Vec<f64>> + Send + 'static,
) -> anyhow::Result<Vec<f64>> {
    let overrides = Overrides { vehicles: Some(vehicles), ..Overrides::default() };
    // Nobody sets out there before everybody is in the air.
    let scenario = Scenario::open("antipodal", &overrides, 1)?;
    let folder =
        std::env::temp_dir().join(format!("skein-bench-{what}-{}-{port_offset}", std::process::id()));
    let disk = full_disk.map(|_| SmallDisk::mount(&folder.join("state"))).transpose()?;
    let fill = || disk.as_ref().map_or(Ok(()), SmallDisk::fill);
    if full_disk == Some(Moment::Start) {
        fill()?;
    }
    let setup = Setup { network: Network::Peer, port_offset, launch_on_order: false, secure: false };
    let mut swarm = Processes::start(&scenario, &folder, setup)?;
    let console = swarm.console();
    let (in_the_air, are_in_the_air) = channel();
    let (go_on, goes_on) = channel();
    let operator = std::thread::spawn(move || {
        let mut operator = Operator::connect(console)?;
        operator.await_armed(vehicles)?;
        // Whoever measures is there as long as this thread.
        let _ = in_the_air.send(());
        let _ = goes_on.recv();
        measure(&mut operator)
    });
    while !operator.is_finished() {
        swarm.step();
        if are_in_the_air.try_recv().is_ok() {
            fill()?;
            let _ = go_on.send(());
        }
    }
    let measured = operator.join().map_err(|_| anyhow::anyhow!("the operator's thread has panicked"))?;
    drop(swarm);
    drop(disk);
    // What is left there is of no use to anybody.
    let _ = fs::remove_dir_all(&folder);
    measured
}

/// Times each hold in milliseconds.
fn hold(operator: &mut Operator, holds: usize) -> anyhow::Result<Vec<f64>> {
    let all = json!("all");
    let mut times_ms = Vec::new();
    for _ in 0..holds {
        times_ms.push(operator.order("hold", &all)?.as_secs_f64() * 1000.0);
        // On hold, so that nobody arrives meanwhile.
        std::thread::sleep(PAUSE);
        operator.order("resume", &all)?;
    }
    Ok(times_ms)
}

/// A file system of 1 MB in memory. It is unmounted with this.
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
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).status();
    }
}
