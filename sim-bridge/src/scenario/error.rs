//! Faults in a scenario, in words that name the input at fault and the remedy.

use std::path::PathBuf;

use nalgebra::Vector3;
use skein_agent::AgentError;
use skein_world::{CloudError, CsvError, Lacking, SdfError, VehicleError};
use thiserror::Error;

use super::thin_solids::ThinSolids;
use crate::mission::MissionError;

/// Why a scenario cannot be flown. Lines, columns and vehicles are numbered from 1; places are ENU, in metres.
#[derive(Debug, Error)]
pub enum ScenarioError {
    #[error("unknown scenario `{name}`: expected one of {known}, or the path of a scenario file (.toml)")]
    Unknown { name: String, known: String },
    #[error("cannot read `{}`: {cause}", path.display())]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{file}:{line}:{column}: {}{message}", at_field(.field))]
    Malformed { file: String, line: usize, column: usize, field: String, message: String },
    #[error("{file}: {field}: {message}")]
    Contradiction { file: String, field: String, message: String },
    /// A world file that cannot be read as SDF.
    #[error(transparent)]
    Sdf(#[from] SdfError),
    /// A world of which something solid could not be read.
    #[error(transparent)]
    Lacking(#[from] Box<Lacking>),
    /// A world file that cannot be read as a list of boxes.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// A world file that cannot be read as a mesh or a cloud of points.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// A vehicle model that is unknown or malformed.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// A mission file that cannot be read.
    #[error(transparent)]
    Mission(#[from] MissionError),
    #[error(
        "scenario `{scenario}` has no vehicles: expected at least 1; give --vehicles N or [[vehicle]] tables"
    )]
    NoVehicles { scenario: String },
    #[error("{vehicles} vehicles are too many: expected at most {limit}")]
    TooManyVehicles { vehicles: usize, limit: usize },
    #[error("scenario `{scenario}` describes {described} vehicles, {wanted} were asked for")]
    TooFewDescribed { scenario: String, wanted: usize, described: usize },
    #[error("{place}, and the scenario's ground is not flat: expected heights above home or above the sea")]
    AboveTerrain { place: String },
    #[error(
        "{missions} missions for {vehicles} vehicles: give one mission that all fly in trail, or one for each vehicle"
    )]
    MissionCount { missions: usize, vehicles: usize },
    #[error("vehicle {vehicle}: start {} is inside obstacle `{obstacle}` (its hull overlaps by {overlap_m:.2} m); move the start", place(.position))]
    StartInObstacle { vehicle: usize, obstacle: String, position: Vector3<f64>, overlap_m: f64 },
    #[error("vehicle {vehicle}: obstacle `{obstacle}` is {above_m:.1} m above the start {}, from which it climbs {climbs_m} m; move the start, or lower `takeoff_height_m`", place(.position))]
    Overhead { vehicle: usize, obstacle: String, position: Vector3<f64>, above_m: f64, climbs_m: f64 },
    #[error("vehicle {vehicle}: {what} {} is outside the world, which reaches from {} to {}", place(.position), place(.min), place(.max))]
    OutsideBounds {
        vehicle: usize,
        what: String,
        position: Vector3<f64>,
        min: Vector3<f64>,
        max: Vector3<f64>,
    },
    #[error(
        "a mission goes {highest_m:.0} m above its home: expected at most {limit_m:.0} m, which a vehicle's map spans"
    )]
    TooHigh { highest_m: f64, limit_m: f64 },
    #[error("rally point {} is outside the world, which reaches from {} to {}", place(.position), place(.min), place(.max))]
    RallyOutside { position: Vector3<f64>, min: Vector3<f64>, max: Vector3<f64> },
    #[error("vehicle {vehicle}: {what} {} is not above the ground: expected a height above 0 m", place(.position))]
    BelowGround { vehicle: usize, what: String, position: Vector3<f64> },
    #[error("vehicle {vehicle}: {what} {} is in a no-fly zone, in a threat or in terrain: no path leads there", place(.position))]
    Closed { vehicle: usize, what: String, position: Vector3<f64> },
    #[error(
        "{what}s of vehicles {first} and {second} are {distance_m:.2} m apart: expected at least {least_m:.2} m; move one of them"
    )]
    TooClose { what: &'static str, first: usize, second: usize, distance_m: f64, least_m: f64 },
    #[error(
        "goal of vehicle {vehicle} is {distance_m:.2} m beside the start of vehicle {other}: expected at least {least_m:.2} m, or that very place; move one of them"
    )]
    GoalBesideStart { vehicle: usize, other: usize, distance_m: f64, least_m: f64 },
    /// Something on the way that a lidar does not see.
    #[error(transparent)]
    ThinSolids(#[from] ThinSolids),
    #[error("{vehicle}: {why}")]
    Agent { vehicle: String, why: AgentError },
    #[error("vehicle {vehicle} has nowhere to go: give it waypoints or a mission")]
    NoWaypoints { vehicle: usize },
    #[error("vehicle {vehicle}: no place for its {what} near {}: everything within {reach_m} m is too close to an obstacle, to another vehicle or to the bounds", place(.near))]
    NoRoom { vehicle: usize, what: &'static str, near: Vector3<f64>, reach_m: f64 },
}

fn at_field(field: &str) -> String {
    if field.is_empty() { String::new() } else { format!("field `{field}`: ") }
}

/// A position as people write it.
pub(super) fn place(p: &Vector3<f64>) -> String {
    format!("({:.2}, {:.2}, {:.2})", p.x, p.y, p.z)
}
