//! The station's recording: all that it hears, on a thread of its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use skein_dbp::{Happened, NodeName};
use skein_disk::Room;
use skein_wire::event::{Advance, Declared as _, Homeward};
use skein_wire::{Scene, State};

use crate::core::GroundCore;
use crate::recorder::{Level, Recorder, RecorderError, keep_former};

/// Planned paths are recorded this often.
const PATH_PERIOD: Duration = Duration::from_millis(500);
/// Poses are handed over this often.
const POSE_PERIOD: Duration = Duration::from_millis(40);
/// So much may wait for the disk; what comes then is left out.
const MOST_WAITING: usize = 4096;
/// Patience with the disk when the station ends.
const TIME_TO_END: Duration = Duration::from_secs(5);

/// Something to be written.
type Write = Box<dyn FnOnce(&mut Recorder) -> Result<(), RecorderError> + Send>;

/// A `mission.mcap` that grows with the mission, up to its greatest size, and as long as its disk has room
/// for what matters more. When it can grow no more, the station says so and goes on without it. Nobody waits
/// for its disk.
pub struct Recording {
    /// None once it has ended.
    writes: Option<SyncSender<Write>>,
    thread: JoinHandle<()>,
    trouble: Arc<Mutex<Option<String>>>,
    /// Counts what was left out because the disk was too slow.
    left_out: u64,
    /// The number of vehicles that the file shows by now.
    shown: usize,
    /// In which life of its node each state and board was made that was handed over last, and when.
    states: BTreeMap<NodeName, (u64, Duration)>,
    boards: BTreeMap<NodeName, (u64, Duration)>,
    paths_due: Duration,
    poses_due: Duration,
}

impl Recording {
    /// Begins `mission.mcap` in `folder`. One that is there already is kept, as `mission-<n>.mcap`.
    ///
    /// # Errors
    /// Its thread cannot be started. What its disk does not do is [told](Self::trouble).
    pub fn begin(folder: PathBuf, most_bytes: u64) -> anyhow::Result<Self> {
        let (writes, waiting) = sync_channel(MOST_WAITING);
        let trouble = Arc::new(Mutex::new(None));
        let thread = thread::Builder::new().name("recording".into()).spawn({
            let trouble = trouble.clone();
            move || {
                if let Err(error) = record(&folder, most_bytes, &waiting) {
                    tracing::error!("{error:#}; the station goes on, and records no more");
                    *trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("{error:#}"));
                }
            }
        });
        Ok(Self {
            writes: Some(writes),
            thread: thread.context("the recording's thread")?,
            trouble,
            left_out: 0,
            shown: 0,
            states: BTreeMap::new(),
            boards: BTreeMap::new(),
            paths_due: Duration::ZERO,
            poses_due: Duration::ZERO,
        })
    }

    /// Why nothing is recorded any more, or not all, if so.
    pub fn trouble(&self) -> Option<String> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone();
        trouble.or_else(|| (self.left_out > 0).then(|| "its disk is too slow: it has gaps".to_owned()))
    }

    /// The obstacles of the world.
    pub fn scene(&mut self, now: Duration, scene: &Scene) {
        let solids = scene.solids.clone();
        self.write(move |recorder| recorder.scene(now, &solids));
    }

    /// Writes the events since the last call, and the states and poses of the vehicles.
    pub fn take_in(&mut self, now: Duration, station: &GroundCore, happened: &[Happened]) {
        for happened in happened {
            let (name, traced) = (station.name().clone(), happened.clone());
            self.write(move |recorder| recorder.trace(&name, &traced));
            // The trace holds every leave to move; people do not need to read each.
            if !matches!(happened.event.kind(), Advance::NAME | Homeward::NAME) {
                let said = happened.clone();
                self.write(move |recorder| recorder.event(now, &said));
            }
        }
        let heard: Vec<&State> = station.roster().filter_map(|(_, state)| state).collect();
        if heard.len() > self.shown {
            self.shown = heard.len();
            let hulls: Vec<_> = heard.iter().map(|state| (state.node.clone(), state.radius_m)).collect();
            self.write(move |recorder| recorder.vehicles(now, &named(&hulls)));
        }
        for state in &heard {
            if is_new(&mut self.states, &state.node, (state.incarnation, state.time)) {
                let state = (*state).clone();
                self.write(move |recorder| recorder.state(now, &state));
            }
        }
        for board in station.boards() {
            if is_new(&mut self.boards, &board.node, (board.incarnation, board.at)) {
                let board = board.clone();
                self.write(move |recorder| recorder.board(now, &board));
            }
        }
        if now >= self.poses_due {
            self.poses_due = now + POSE_PERIOD;
            let poses: Vec<_> = heard.iter().map(|state| (state.node.clone(), pose(state))).collect();
            self.write(move |recorder| recorder.poses(now, &named(&poses)));
        }
        if now >= self.paths_due {
            self.paths_due = now + PATH_PERIOD;
            for state in heard {
                let (node, path) = (state.node.clone(), state.path.clone());
                self.write(move |recorder| recorder.path(now, node.as_str(), &path));
            }
        }
    }

    /// A line for people.
    pub fn note(&mut self, now: Duration, level: Level, name: &str, line: &str) {
        let (name, line) = (name.to_owned(), line.to_owned());
        self.write(move |recorder| recorder.log(now, level, &name, &line));
    }

    /// Completes the file, unless the disk takes too long for it.
    pub fn finish(mut self) {
        self.writes = None;
        let asked = Instant::now();
        while !self.thread.is_finished() && asked.elapsed() < TIME_TO_END {
            thread::sleep(Duration::from_millis(5));
        }
    }

    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecorderError> + Send + 'static) {
        let Some(writes) = &self.writes else { return };
        let is_alive = !self.thread.is_finished();
        if writes.try_send(Box::new(write)).is_err() && is_alive {
            self.left_out += 1;
            if self.left_out.is_power_of_two() {
                tracing::warn!("the recording's disk is too slow: {} messages are left out", self.left_out);
            }
        }
    }
}

fn is_new(last: &mut BTreeMap<NodeName, (u64, Duration)>, node: &NodeName, made: (u64, Duration)) -> bool {
    last.insert(node.clone(), made) != Some(made)
}

fn named<T: Copy>(of: &[(NodeName, T)]) -> Vec<(&str, T)> {
    of.iter().map(|(node, value)| (node.as_str(), *value)).collect()
}

/// Writes what comes, until nothing more can come. What has been written before it ends by an error can be
/// read.
fn record(folder: &Path, most_bytes: u64, writes: &Receiver<Write>) -> anyhow::Result<()> {
    let path = folder.join("mission.mcap");
    let mut room = Room::new(&path, most_bytes);
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    if let Some(why) = room.is_full().filter(|_| !path.exists()) {
        anyhow::bail!("`{}` is not begun: {why}", path.display());
    }
    keep_former(&path)?;
    let mut recorder = Recorder::create(&path)?;
    for write in writes {
        if let Some(why) = room.is_full() {
            recorder.finish()?;
            anyhow::bail!("`{}` grows no more: {why}", path.display());
        }
        write(&mut recorder)?;
    }
    Ok(recorder.finish()?)
}

/// Where a vehicle says that it is; it does not say how it is tilted.
fn pose(state: &State) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, state.yaw_rad);
    Isometry3::from_parts(Translation3::from(state.position), turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_grows_to_its_greatest_size_says_so_and_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let (put, writes) = sync_channel::<Write>(MOST_WAITING);
        let line = "x".repeat(1000);
        put.send(Box::new(move |recorder| {
            let write = |second| {
                recorder.log(
                    Duration::from_secs(second),
                    Level::Info,
                    "ground/main",
                    &format!("{second} {line}"),
                )
            };
            (0..20).try_for_each(write)
        }))
        .unwrap();
        put.send(Box::new(|_| panic!("it grows on"))).unwrap();
        drop(put);
        let error = record(folder.path(), 1, &writes).unwrap_err().to_string();
        assert!(error.contains("mission.mcap") && error.contains("greatest size"), "{error}");
    }
}
