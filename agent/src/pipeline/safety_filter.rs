//! The safety filter: the last word on a velocity before it is flown.

use std::time::Duration;

use nalgebra::Vector3;
use skein_planning::{
    map::ClearanceMap,
    separation::{self, FilterConfig, Outcome, filter},
};

use super::{
    evasion::{Evasion, Room, Way},
    surroundings::Surroundings,
};
use crate::config::{Envelope, Fence};
use crate::positioning::excess_m;

/// Walls of closed places are kept clear of from so far, m: further than any vehicle needs to stop.
const WALLS_M: f64 = 15.0;
/// A vehicle that is hemmed in leaves its height where it has this much room, m.
const EVASION_M: f64 = 1.0;

/// The velocity that is flown (ENU, m/s), and whether it leads off the height out of where no distance can be kept.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    pub velocity: Vector3<f64>,
    pub evades: bool,
}

/// Makes a velocity safe.
pub trait VelocityFilter: std::fmt::Debug + Send {
    /// The vehicle is of this envelope from now on.
    fn handle(&mut self, envelope: &Envelope);

    /// The velocity nearest to the one desired that keeps all distances, or the way out of where none does. `others`
    /// are the neighbours, and what moves and tells nobody where it is.
    fn keep_apart(
        &mut self,
        now: Duration,
        request: separation::Motion,
        others: &[separation::Neighbour],
        surroundings: &Surroundings<'_>,
    ) -> Kept;
}

/// Keeps a vehicle apart from others, from obstacles, from the walls of its fence and of places that are closed.
#[derive(Clone, Debug)]
pub struct SafetyFilter {
    fence: Fence,
    climb_m_s: f64,
    config: FilterConfig,
    evasion: Evasion,
}

impl SafetyFilter {
    /// The filter of a vehicle of this envelope inside this fence.
    pub fn new(envelope: &Envelope, fence: Fence) -> Self {
        let (climb_m_s, config) = (envelope.climb_m_s, envelope.filter());
        Self { fence, climb_m_s, config, evasion: Evasion::default() }
    }

    /// The nearest points of the fence's walls, as far as the position may be off further in: the filter keeps clear of
    /// them as of obstacles. From outside they are open.
    fn fence_ahead(&self, position: Vector3<f64>, off_m: f64) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let Fence { min, max } = self.fence;
        let clearance_m = self.config.obstacle_clearance_m;
        let walls =
            [0, 1].into_iter().flat_map(move |axis| [(axis, min[axis], 1.0), (axis, max[axis], -1.0)]);
        walls.filter(move |(axis, wall, inwards)| (position[*axis] - wall) * inwards > 0.0).map(
            move |(axis, wall, _)| {
                let mut point = position;
                point[axis] = wall;
                nearer(point, &position, off_m, clearance_m)
            },
        )
    }
}

impl VelocityFilter for SafetyFilter {
    fn handle(&mut self, envelope: &Envelope) {
        (self.climb_m_s, self.config) = (envelope.climb_m_s, envelope.filter());
    }

    fn keep_apart(
        &mut self,
        now: Duration,
        request: separation::Motion,
        others: &[separation::Neighbour],
        surroundings: &Surroundings<'_>,
    ) -> Kept {
        let off_m = excess_m(request.sigma_m);
        let mut obstacles: Vec<_> =
            surroundings.obstacles.iter().copied().chain(self.fence_ahead(request.position, off_m)).collect();
        let solid = obstacles.len();
        let walls = surroundings.map.keep_out().map(|keep_out| keep_out.walls(&request.position, WALLS_M));
        let clearance_m = self.config.obstacle_clearance_m;
        let nearer = |wall| nearer(wall, &request.position, off_m, clearance_m);
        obstacles.extend(walls.unwrap_or_default().into_iter().map(nearer));
        let mut filtered = filter(&request, others, &obstacles, &self.config);
        if obstacles.len() > solid && matches!(filtered.outcome, Outcome::Infeasible { .. }) {
            // To touch somebody or something is worse than to enter a zone.
            obstacles.truncate(solid);
            filtered = filter(&request, others, &obstacles, &self.config);
        }
        let room = || room(request.position, surroundings.map, clearance_m);
        let Some(way) = self.evasion.decide(now, &filtered.outcome, surroundings.rank, room) else {
            return Kept { velocity: filtered.velocity, evades: false };
        };
        let mut desired = filtered.velocity;
        desired.z = way.sign() * self.climb_m_s;
        let request = separation::Motion { desired, planar: false, ..request };
        Kept { velocity: filter(&request, others, &obstacles, &self.config).velocity, evades: true }
    }
}

/// A wall as near as it may be to a vehicle whose position is off by so much; but not so near that it would have to
/// move, for what it does not know.
fn nearer(wall: Vector3<f64>, position: &Vector3<f64>, off_m: f64, clearance_m: f64) -> Vector3<f64> {
    let offset = wall - position;
    let distance_m = offset.norm();
    let moved_m = off_m.min(distance_m - clearance_m);
    if moved_m > 0.0 { wall - offset * (moved_m / distance_m) } else { wall }
}

/// Whether a vehicle can leave its height, as far as the map reaches and tells.
fn room(position: Vector3<f64>, map: &ClearanceMap, clearance_m: f64) -> Room {
    let leads_free = |way: Way| {
        let there = position + Vector3::z() * (way.sign() * EVASION_M);
        map.voxels().index_of(&there).is_some()
            && map.is_segment_clear(&position, &there, clearance_m)
            && map.is_open(&position, &there)
    };
    Room { up: leads_free(Way::Up), down: leads_free(Way::Down) }
}
