//! Mission files: a route for one vehicle, for each vehicle, or for all in trail.

mod command;
mod error;
mod features;
mod geojson;
mod item;
mod json;
mod kml;
mod lsc;
mod plan;
mod route;
mod structure_scan;
mod waypoint_file;
pub mod write;

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector3;
use skein_mav::Datum;
use skein_planning::airspace::Airspace;

pub use error::{MissionError, Warning};
pub use lsc::{LscAgent, LscMission};

use self::json::Document;
use self::route::Draft;
use crate::element::Element;

/// Largest mission file, in bytes.
const LARGEST_BYTES: usize = 8 << 20;

/// A route for one vehicle, in the world's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mission {
    /// The place before take-off, and the end of a return: ENU, metres, on the ground.
    pub home: Vector3<f64>,
    pub waypoints: Vec<Waypoint>,
    pub ends: Ends,
    /// Height above the ground at which the take-off ends, where the file says.
    pub takeoff_height_m: Option<f64>,
    /// The stay before the first waypoint, in seconds.
    pub delay_s: f64,
    /// Commands to what the vehicle carries, after the last waypoint.
    pub last_payload: Vec<Payload>,
    /// Name of a built-in vehicle model, where the file says.
    pub model: Option<String>,
    /// Start and goal are part of an experiment's setting, and must stay where the file puts them.
    pub exact: bool,
}

/// A place to fly to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Waypoint {
    /// ENU, metres.
    pub position: Vector3<f64>,
    /// The stay there, in seconds.
    pub hold_s: f64,
    /// Speed on the way there, in m/s, where the file says.
    pub speed_m_s: Option<f64>,
    /// Commands to what the vehicle carries, before it sets out for the place.
    pub payload: Vec<Payload>,
    /// The survey or scan that it is part of, which several vehicles share.
    pub scan: Option<usize>,
}

/// A command to a camera, a servo, or something else that a vehicle carries.
#[derive(Debug, Clone, Copy)]
pub struct Payload {
    /// `MAV_CMD`.
    pub command: u64,
    /// Not a number where the file gives none.
    pub params: [f64; 7],
}

impl PartialEq for Payload {
    fn eq(&self, other: &Self) -> bool {
        self.command == other.command && self.params.map(f64::to_bits) == other.params.map(f64::to_bits)
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Ends {
    /// Land under it.
    #[default]
    Land,
    /// Fly home and land there.
    Return,
}

/// What is flown though it is probably a mistake.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Args)]
pub struct Allowances {
    /// Fly legs of more than 1000 m of a mission file.
    #[arg(long)]
    pub long_legs: bool,
    /// Fly a mission file whose neighbouring heights, one above the sea and one above home, differ by more
    /// than 30 m.
    #[arg(long)]
    pub mixed_heights: bool,
}

/// The content of one mission file, or of several together.
#[derive(Debug, Clone, Default)]
pub struct MissionSet {
    /// One mission that all fly in trail, or one for each vehicle.
    pub missions: Vec<Mission>,
    /// Parts of the files that have no effect.
    pub warnings: Vec<Warning>,
    /// The zones of the files' geofences.
    pub airspace: Airspace,
    /// Places to land at instead of home: ENU, metres, with the height of the way there.
    pub rally: Vec<Vector3<f64>>,
    /// The first height that counts from the terrain, in words.
    pub above_terrain: Option<String>,
    /// The world's origin on the earth, where a file spoke of latitudes.
    pub datum: Option<Datum>,
}

/// What becomes of each element of a file, and what comes of it as a whole.
#[derive(Debug)]
pub struct Account {
    pub elements: Vec<Element>,
    pub set: Result<MissionSet, MissionError>,
}

impl Account {
    fn of(draft: Draft, missions: Vec<Mission>) -> Self {
        let Draft { elements, warnings, airspace, rally, above_terrain, datum, fault, .. } = draft;
        let set = MissionSet { missions, warnings, airspace, rally, above_terrain, datum: Some(datum) };
        Self { elements, set: fault.map_or(Ok(set), Err) }
    }

    /// Reads a mission file, and goes on after what is refused; see [`MissionSet::read`].
    ///
    /// # Errors
    /// The text is none of what is known, or so broken that it has no elements.
    pub fn read(
        text: &str,
        file: &str,
        datum: Option<Datum>,
        allowances: Allowances,
    ) -> Result<Self, MissionError> {
        if text.len() > LARGEST_BYTES {
            return Err(MissionError::TooLarge { file: file.to_owned(), limit: LARGEST_BYTES });
        }
        if text.trim_start_matches('\u{feff}').starts_with(waypoint_file::HEADING) {
            return waypoint_file::read(text, file, datum, allowances);
        }
        if kml::is_markup(text) {
            return kml::read(text, file, datum, allowances);
        }
        let document = Document::parse(text, file)?;
        let root = document.root();
        if geojson::is_geojson(&root) {
            return geojson::read(&root, datum, allowances);
        }
        if root.optional("mission").is_some() {
            plan::read(&root, datum, allowances)
        } else if root.optional("agents").is_some() {
            Ok(Self { elements: Vec::new(), set: lsc::read(&root) })
        } else {
            Err(MissionError::Unknown { file: document.file().to_owned() })
        }
    }
}

impl MissionSet {
    /// Reads a QGroundControl plan, a `QGC WPL 110` file, KML, GeoJSON or an LSC mission; `file` is what
    /// errors call it.
    ///
    /// `datum` is where the world's origin is on the earth, if the world says. A plan that was drawn
    /// elsewhere, or flies in a world that does not say, has its planned home set on the origin.
    pub fn read(text: &str, file: &str, datum: Option<Datum>) -> Result<Self, MissionError> {
        Account::read(text, file, datum, Allowances::default())?.set
    }
}

/// Reads mission files in order; the first plan's datum holds for those after it.
pub fn read_files(
    paths: &[PathBuf],
    datum: Option<Datum>,
    allowances: Allowances,
) -> Result<MissionSet, MissionError> {
    let mut all = MissionSet::default();
    for path in paths {
        let set = account_of(path, all.datum.or(datum), allowances)?.set?;
        all.missions.extend(set.missions);
        all.warnings.extend(set.warnings);
        all.airspace.include(set.airspace);
        all.rally.extend(set.rally);
        all.above_terrain = all.above_terrain.or(set.above_terrain);
        all.datum = all.datum.or(set.datum);
    }
    Ok(all)
}

/// Reads a file, and gives an account of its elements.
pub fn account_of(
    path: &Path,
    datum: Option<Datum>,
    allowances: Allowances,
) -> Result<Account, MissionError> {
    let text = std::fs::read_to_string(path)
        .map_err(|cause| MissionError::Unreadable { path: path.to_owned(), cause })?;
    Account::read(&text, &path.display().to_string(), datum, allowances)
}
