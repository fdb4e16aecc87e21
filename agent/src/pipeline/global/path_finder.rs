//! The seam of global planners.

use nalgebra::Vector3;
use skein_planning::{
    Path, Region,
    global::{
        Potential,
        astar::{Disc, Plan, PlanError, Request},
        simplify_around,
    },
    map::ClearanceMap,
};

/// Most voxels that a search at one height expands.
pub const LEVEL_BUDGET: usize = 100_000;

/// From where to where a path is wanted, and by what kind of vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Where the vehicle is, m ENU.
    pub start: Vector3<f64>,
    /// Where it shall go, m ENU.
    pub goal: Vector3<f64>,
    /// A potential that makes some places dearer.
    pub potential: Potential,
    /// Standing vehicles and ghosts, to be gone around if that is possible.
    pub discs: Vec<Disc>,
    /// The box that the path stays in.
    pub within: Region,
    /// Radius of the sphere around the vehicle, m.
    pub hull_m: f64,
    /// Clearance wanted between hull and obstacles, m.
    pub margin_m: f64,
}

impl Task {
    /// Whether a search that stays at one height, if heights differ by no more than `planar_band_m`, does so.
    pub fn is_level(&self, planar_band_m: f64) -> bool {
        (self.goal.z - self.start.z).abs() <= planar_band_m
    }

    /// The request of one search, around these of its discs.
    pub fn request<'a>(&'a self, discs: &'a [Disc]) -> Request<'a> {
        Request { start: self.start, goal: self.goal, potential: &self.potential, discs, within: self.within }
    }
}

/// A path that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// From the start towards the goal.
    pub path: Path,
    /// The clearance it keeps, m. A path without one was not looked for in the map, and is kept whatever the map
    /// learns.
    pub clearance_m: Option<f64>,
    /// Whether it was searched for at the height of its start alone.
    pub is_level: bool,
}

impl Found {
    /// A plan in one layer that keeps this clearance, without the corners it can do without.
    pub fn of(
        plan: &Plan,
        map: &ClearanceMap,
        clearance_m: f64,
        discs: &[Disc],
        potential: &Potential,
    ) -> Self {
        let path = simplify_around(map, &plan.path, clearance_m, discs, potential);
        Self { path, clearance_m: Some(clearance_m), is_level: true }
    }
}

/// Finds a path through the map, a little in each tick.
pub trait PathFinder: std::fmt::Debug + Send {
    /// Begins anew; [`advance`](Self::advance) does the work. What was found out before may serve again.
    fn begin(&mut self);

    /// Goes on with the same task for about as long as `allowance` expansions of A* in one layer take, and takes what
    /// was used from it. `None` if there is no answer yet.
    fn advance(
        &mut self,
        task: &Task,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<Result<Found, PlanError>>;
}
