//! Mission files: a route for one vehicle, for each vehicle, or for all in trail.

mod error;
mod json;
mod lsc;
mod plan;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use skein_mav::Datum;
use skein_planning::airspace::Airspace;

pub use error::{MissionError, Warning};
pub use lsc::{LscAgent, LscMission};

use json::Document;

/// A route for one vehicle, in the world's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    /// The place before take-off, and the end of a return: ENU, metres, on the ground.
    pub home: Vector3<f64>,
    pub waypoints: Vec<Waypoint>,
    pub ends: Ends,
    /// Height above the ground at which the take-off ends, where the file says.
    pub takeoff_height_m: Option<f64>,
    /// Name of a built-in vehicle model, where the file says.
    pub model: Option<String>,
    /// Start and goal are part of an experiment's setting, and must stay where the file puts them.
    pub exact: bool,
}

/// A place to fly to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// ENU, metres.
    pub position: Vector3<f64>,
    /// The stay there, in seconds.
    pub hold_s: f64,
    /// Speed on the way there, in m/s, where the file says.
    pub speed_m_s: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// Land under it.
    Land,
    /// Fly home and land there.
    Return,
}

/// The content of one mission file, or of several together.
#[derive(Debug, Clone, Default)]
pub struct MissionSet {
    /// One mission that all fly in trail, or one for each vehicle.
    pub missions: Vec<Mission>,
    /// Parts of the files that have no effect.
    pub warnings: Vec<Warning>,
    /// No-fly zones of the files' geofences.
    pub airspace: Airspace,
    /// The world's origin on the earth, where a file spoke of latitudes.
    pub datum: Option<Datum>,
}

impl MissionSet {
    /// Reads a QGroundControl plan or an LSC mission; `file` is what errors call it.
    ///
    /// `datum` is where the world's origin is on the earth, if the world says. A plan that was drawn elsewhere, or
    /// flies in a world that does not say, has its planned home set on the origin.
    pub fn read(text: &str, file: &str, datum: Option<Datum>) -> Result<Self, MissionError> {
        let document = Document::parse(text, file)?;
        let root = document.root();
        if root.optional("mission").is_some() {
            plan::read(&root, datum)
        } else if root.optional("agents").is_some() {
            lsc::read(&root)
        } else {
            Err(MissionError::Unknown { file: document.file().to_owned() })
        }
    }
}

/// Reads mission files in order; the first plan's datum holds for those after it.
pub fn read_files(paths: &[PathBuf], datum: Option<Datum>) -> Result<MissionSet, MissionError> {
    let mut all = MissionSet::default();
    for path in paths {
        let set = MissionSet::read(&read_text(path)?, &path.display().to_string(), all.datum.or(datum))?;
        all.missions.extend(set.missions);
        all.warnings.extend(set.warnings);
        all.airspace.include(set.airspace);
        all.datum = all.datum.or(set.datum);
    }
    Ok(all)
}

fn read_text(path: &Path) -> Result<String, MissionError> {
    std::fs::read_to_string(path).map_err(|cause| MissionError::Unreadable { path: path.to_owned(), cause })
}
