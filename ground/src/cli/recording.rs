//! The station's recording: all that it hears.

use std::path::Path;
use std::time::Duration;

use anyhow::Context as _;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use skein_dbp::Happened;
use skein_wire::event::{Advance, Declared as _, Homeward};
use skein_wire::{Scene, State};

use crate::core::GroundCore;
use crate::recorder::{Level, Recorder, RecorderError};

/// Planned paths are recorded this often.
const PATH_PERIOD: Duration = Duration::from_millis(500);

/// A `mission.mcap` that grows with the mission. When it cannot grow any more, because the disk is full, the station
/// says so and goes on without it.
pub struct Recording {
    recorder: Option<Recorder>,
    /// The number of vehicles that the file shows by now.
    shown: usize,
    paths_due: Duration,
}

impl Recording {
    /// Begins `mission.mcap` in `folder`. One that is there already is kept, as `mission-<n>.mcap`.
    pub fn create(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join("mission.mcap");
        if path.exists() {
            let numbered = |number: u32| folder.join(format!("mission-{number}.mcap"));
            let kept = (1..).map(numbered).find(|path| !path.exists());
            if let Some(kept) = kept {
                let why = || format!("{}: cannot be kept as {}", path.display(), kept.display());
                std::fs::rename(&path, &kept).with_context(why)?;
            }
        }
        Ok(Self { recorder: Some(Recorder::create(&path)?), shown: 0, paths_due: Duration::ZERO })
    }

    /// The obstacles of the world.
    pub fn scene(&mut self, now: Duration, scene: &Scene) {
        self.write(|recorder| recorder.scene(now, &scene.solids));
    }

    /// Writes the events since the last call, and the states and poses of the vehicles.
    pub fn take_in(&mut self, now: Duration, station: &GroundCore, happened: &[Happened]) {
        for happened in happened {
            self.write(|recorder| recorder.trace(station.name(), happened));
            // The trace holds every leave to move; people do not need to read each.
            if !matches!(happened.event.kind(), Advance::NAME | Homeward::NAME) {
                self.note(now, Level::Info, happened.home.as_str(), &happened.event.to_string());
            }
        }
        let heard: Vec<&State> = station.roster().filter_map(|(_, state)| state).collect();
        if heard.len() > self.shown {
            self.shown = heard.len();
            let hulls: Vec<(&str, f64)> =
                heard.iter().map(|state| (state.node.as_str(), state.radius_m)).collect();
            self.write(|recorder| recorder.vehicles(now, &hulls));
        }
        for state in &heard {
            self.write(|recorder| recorder.state(now, state));
        }
        for board in station.boards() {
            self.write(|recorder| recorder.board(now, board));
        }
        let poses: Vec<_> = heard.iter().map(|state| (state.node.as_str(), pose(state))).collect();
        self.write(|recorder| recorder.poses(now, &poses));
        if now >= self.paths_due {
            self.paths_due = now + PATH_PERIOD;
            for state in heard {
                self.write(|recorder| recorder.path(now, state.node.as_str(), &state.path));
            }
        }
    }

    /// A line for people.
    pub fn note(&mut self, now: Duration, level: Level, name: &str, line: &str) {
        self.write(|recorder| recorder.log(now, level, name, line));
    }

    /// Completes the file.
    pub fn finish(self) -> Result<(), RecorderError> {
        self.recorder.map_or(Ok(()), Recorder::finish)
    }

    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecorderError>) {
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = write(recorder)
        {
            tracing::error!("{error}; the station goes on, and records no more");
            self.recorder = None;
        }
    }
}

/// Where a vehicle says that it is; it does not say how it is tilted.
fn pose(state: &State) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, state.yaw_rad);
    Isometry3::from_parts(Translation3::from(state.position), turn)
}
