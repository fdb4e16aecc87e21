//! The recording of a flight.

use std::path::Path;
use std::time::Duration;

use skein_ground::GroundCore;
use skein_ground::recorder::{Level, Recorder, RecorderError};
use skein_wire::event::{Advance, Declared as _};

use super::swarm::{Happenings, Swarm};
use crate::node_names::vehicle_name;
use crate::scenario::Scenario;
use crate::scene_view;

/// Planned paths are recorded this often.
const PATH_PERIOD: Duration = Duration::from_millis(500);

/// A flight's `mission.mcap`.
pub struct Recording {
    recorder: Recorder,
    names: Vec<String>,
    paths_due: Duration,
    scene_due: Duration,
}

impl Recording {
    /// Begins a recording with what stands in the world.
    ///
    /// # Errors
    /// [`RecorderError`] names the file that cannot be made.
    pub fn create(path: &Path, scenario: &Scenario) -> Result<Self, RecorderError> {
        let mut recorder = Recorder::create(path)?;
        let names: Vec<String> =
            (0..scenario.vehicles.len()).map(|index| vehicle_name(index).to_string()).collect();
        let hulls: Vec<(&str, f64)> = names
            .iter()
            .zip(&scenario.vehicles)
            .map(|(name, plan)| (name.as_str(), plan.model.hull_radius_m))
            .collect();
        recorder.scene(Duration::ZERO, &scene_view::view(&scenario.scene).solids)?;
        recorder.vehicles(Duration::ZERO, &hulls)?;
        let line = format!("{} with {} vehicles, seed {}", scenario.name, names.len(), scenario.seed);
        recorder.log(Duration::ZERO, Level::Info, "skein-sim", &line)?;
        Ok(Self { recorder, names, paths_due: Duration::ZERO, scene_due: scene_view::MOVING_PERIOD })
    }

    /// Records one step of the swarm.
    ///
    /// # Errors
    /// [`RecorderError`] when the file cannot be continued.
    pub fn take_in(&mut self, swarm: &Swarm, happenings: &Happenings) -> Result<(), RecorderError> {
        let now = swarm.now();
        for (index, scan) in &happenings.scans {
            if let Some(name) = self.names.get(*index) {
                self.recorder.scan(now, name, scan)?;
            }
        }
        if happenings.ticked {
            self.poses(swarm)?;
            self.events(now, happenings)?;
            self.told(now, swarm.ground())?;
        }
        let scene = swarm.simulation().scene();
        if now >= self.scene_due && scene.moving().next().is_some() {
            self.scene_due = now + scene_view::MOVING_PERIOD;
            self.recorder.scene(now, &scene_view::view(scene).solids)?;
        }
        if now >= self.paths_due {
            self.paths_due = now + PATH_PERIOD;
            for agent in swarm.agents() {
                let path: Vec<_> = agent.path_ahead().collect();
                self.recorder.path(now, agent.name().as_str(), &path)?;
            }
        }
        Ok(())
    }

    fn poses(&mut self, swarm: &Swarm) -> Result<(), RecorderError> {
        let truth = swarm.simulation();
        let poses: Vec<_> = self
            .names
            .iter()
            .enumerate()
            .filter_map(|(index, name)| Some((name.as_str(), truth.vehicle(index)?.motion.pose())))
            .collect();
        self.recorder.poses(swarm.now(), &poses)
    }

    fn events(&mut self, now: Duration, happenings: &Happenings) -> Result<(), RecorderError> {
        for happened in &happenings.selections {
            self.recorder.trace(&happened.home, happened)?;
            // The trace holds every leave to move; people do not need to read each.
            if happened.event.kind() != Advance::NAME {
                self.recorder.event(now, happened)?;
            }
        }
        Ok(())
    }

    /// The vehicles' states and boards, as the ground station has heard them.
    fn told(&mut self, now: Duration, station: &GroundCore) -> Result<(), RecorderError> {
        for state in station.roster().filter_map(|(_, state)| state) {
            self.recorder.state(now, state)?;
        }
        station.boards().try_for_each(|board| self.recorder.board(now, board))
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`RecorderError`] when it cannot be completed.
    pub fn finish(self) -> Result<(), RecorderError> {
        self.recorder.finish()
    }
}
