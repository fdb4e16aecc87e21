//! Steering: the set-point of now, along the path with leave to move, else at a place; kept apart from everything
//! either way.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::SetPoint;
use skein_planning::{
    Path,
    local::{
        apf, braking,
        escape::Forces,
        moving::{MovingConfig, Tracker},
    },
    map::ClearanceMap,
    separation::{self, RepulsionConfig, repulsion},
};

use super::{
    acceleration::Acceleration,
    allowed::{Allowed, Wish},
    course::Following,
    hard_brakes::HardBrakes,
    local::{PathFollower, Place},
    safety_filter::{Kept, VelocityFilter},
    surroundings::Surroundings,
};
use crate::{config::Envelope, positioning::Motion};

/// The map tells so far ahead what is free, m: what is darkest is seen so far, and can be stopped for, if not gently.
const MAPPED_AHEAD_M: f64 = 9.0;
/// The rays of a scan count so far ahead, m: from there one slows down gently.
const SEEN_AHEAD_M: f64 = 40.0;
/// What the rays see nearer to the way than this may make it bend, m.
const BESIDE_WAY_M: f64 = 2.0;
/// Height differences below this are flown in planar mode, m.
const PLANAR_BAND_M: f64 = 0.4;
/// A hovering vehicle that others have pushed this far does not come back, m.
const GIVES_WAY_M: f64 = 1.0;
/// Speed at which a hovering vehicle goes back to its place, at most, m/s.
const STATION_KEEPING_M_S: f64 = 0.5;
/// Speed at which a vehicle that is to land goes to where it can, at most, m/s; further away, for each metre, 1/s.
const SETTLING_M_S: f64 = 1.0;
const SETTLING_SHARE: f64 = 0.5;
/// Speed at which a vehicle goes back to where paths lead, at most, m/s; nearer to it, for each metre, 1/s.
const BACK_M_S: f64 = 2.0;
const BACK_SHARE: f64 = 0.5;
/// It goes up or down no further beside its way than this, m.
const BACK_BESIDE_M: f64 = 1.0;
/// And at least, m/s.
const BACK_LEAST_M_S: f64 = 0.2;
/// Where the way back is seen free no further than this, m, another is looked for, that is free so far.
const BLOCKED_BACK_M: f64 = 5.0;
const FREE_BACK_M: f64 = 8.0;

/// Makes set-points.
#[derive(Debug)]
pub struct Steering {
    envelope: Envelope,
    acceleration: Acceleration,
    follower: Box<dyn PathFollower>,
    /// Moving things that tell nobody where they are.
    moving: Tracker,
    /// Those, as of the last set-point.
    movers: Vec<separation::Neighbour>,
    /// The forces on a vehicle that follows a path, as of the last set-point.
    forces: Forces,
    repulsion: RepulsionConfig,
    filter: Box<dyn VelocityFilter>,
    pub hard_brakes: HardBrakes,
    /// Where to hover while there is no leave to move.
    hover_at: Option<Vector3<f64>>,
    /// Where to go, without leave, to land there; `None` to follow the path.
    pub settles_at: Option<Vector3<f64>>,
}

/// Nearer to where a vehicle wants to be than this, m, others push it less, so that it gets there (Ge and Cui 2000).
const NEAR_END_M: f64 = 1.5;

/// A path that may be followed now, and the share of its attraction that is left.
#[derive(Debug)]
pub struct Lead<'a> {
    pub following: &'a mut Following,
    pub attraction: f64,
    /// Those who push it aside.
    pub repelled_by: &'a [separation::Neighbour],
    /// From the vehicle to where it wants to be in the end, m.
    pub to_go_m: f64,
}

impl Steering {
    /// Steers a vehicle of this envelope.
    pub fn new(
        envelope: Envelope,
        follower: Box<dyn PathFollower>,
        repulsion: RepulsionConfig,
        filter: Box<dyn VelocityFilter>,
    ) -> Self {
        let moving = Tracker::new(MovingConfig::default());
        Self {
            envelope,
            acceleration: Acceleration::default(),
            follower,
            moving,
            movers: Vec::new(),
            forces: Forces::default(),
            repulsion,
            filter,
            hard_brakes: HardBrakes::default(),
            hover_at: None,
            settles_at: None,
        }
    }

    /// The vehicle is of this envelope from now on.
    pub fn handle(&mut self, envelope: Envelope) {
        self.envelope = envelope;
        self.follower.handle(&envelope);
        self.filter.handle(&envelope);
    }

    /// Somebody else moves the vehicle, or nobody: whatever place it hovered at is not its place any more.
    pub fn rest(&mut self) {
        self.acceleration.forget();
        self.hover_at = None;
        self.settles_at = None;
        self.movers.clear();
        self.forces = Forces::default();
        self.follower.rest();
    }

    /// Moving things that tell nobody where they are, as of the last set-point.
    pub fn movers(&self) -> &[separation::Neighbour] {
        &self.movers
    }

    /// The forces on a vehicle that follows a path, as of the last set-point; none on one that does not.
    pub fn forces(&self) -> Forces {
        self.forces
    }

    /// Other places are closed than before: the place to hover at is looked for anew.
    pub fn look_for_a_place(&mut self) {
        self.hover_at = None;
    }

    /// Every place that was placed by the vehicle's position moves with it, m.
    pub fn shift(&mut self, by: &Vector3<f64>) {
        for place in [&mut self.hover_at, &mut self.settles_at].into_iter().flatten() {
            *place += by;
        }
        self.moving = Tracker::new(MovingConfig::default());
        self.movers.clear();
    }

    /// Takes in the obstacle points of a scan of `rays` rays that was taken at `stamp` and `origin`; metres ENU.
    pub fn look(
        &mut self,
        stamp: Duration,
        origin: &Vector3<f64>,
        returns: &[Vector3<f64>],
        rays: usize,
        map: &ClearanceMap,
    ) {
        self.moving.look(stamp, returns, map);
        self.follower.look(origin, returns, rays, map.keep_out());
    }

    /// Where a vehicle that brakes here and now comes to a stop, metres ENU.
    pub fn stop(&self, position: &Vector3<f64>, velocity: &Vector3<f64>) -> Vector3<f64> {
        position + velocity * (velocity.norm() / (2.0 * self.follower.braking().decel_m_s2))
    }

    /// The set-point for now: to where the vehicle settles, or along the path with a lead, else at a place; the latter
    /// two as far as that is `allowed`.
    pub fn steer(
        &mut self,
        now: Duration,
        motion: &Motion,
        lead: Option<Lead<'_>>,
        allowed: &Allowed,
        surroundings: &Surroundings<'_>,
    ) -> SetPoint {
        let envelope = self.envelope;
        let part_of = |wish| allowed.part_of(wish, &motion.position, &envelope);
        self.movers.clear();
        self.movers.extend(self.moving.moving(now));
        self.forces.pull = Vector3::zeros();
        let repelled_by = lead.as_ref().map_or(surroundings.neighbours, |lead| lead.repelled_by);
        let to_go_m = match (self.settles_at, &lead) {
            (Some(place), _) => (place - motion.position).norm(),
            (None, Some(lead)) => lead.to_go_m,
            (None, None) => f64::INFINITY,
        };
        let wish = match (self.settles_at, lead) {
            (Some(place), _) => self.aside(place, motion),
            (None, Some(Lead { following, .. })) if following.back_into.is_some() => {
                part_of(self.straight_back(following, motion, allowed, surroundings))
            }
            (None, Some(lead)) => part_of(self.along_path(lead, motion, allowed, surroundings)),
            (None, None) => part_of(self.keep_station(motion, surroundings.map)),
        };
        let with_movers = |others: &[_]| [others, &self.movers].concat();
        let others = with_movers(surroundings.neighbours);
        let push = repulsion(&motion.position, &wish.velocity, &with_movers(repelled_by), &self.repulsion);
        let push = push * (to_go_m / NEAR_END_M).min(1.0);
        self.forces.net = wish.velocity + push;
        let is_level = (wish.height_m - motion.position.z).abs() < PLANAR_BAND_M;
        let Envelope { cruise_m_s, climb_m_s, .. } = self.envelope;
        let mut desired = apf::limited(wish.velocity + push, cruise_m_s);
        desired.z = if is_level { 0.0 } else { desired.z.clamp(-climb_m_s, climb_m_s) };
        let request = separation::Motion {
            position: motion.position,
            velocity: motion.velocity,
            acceleration: self.acceleration.follow(now, motion.velocity),
            sigma_m: motion.position_sigma_m(),
            desired: self.follower.ease(desired),
            planar: is_level,
        };
        let Kept { velocity, evades } = self.filter.keep_apart(now, request, &others, surroundings);
        self.hard_brakes.take_in(now, &request.desired, &velocity);
        self.follower.flew(&velocity);
        if is_level && !evades {
            SetPoint::Planar { vx: velocity.x, vy: velocity.y, z: wish.height_m, yaw: None }
        } else {
            SetPoint::Velocity { velocity, yaw: None }
        }
    }

    /// To where it will land.
    fn aside(&mut self, place: Vector3<f64>, motion: &Motion) -> Wish {
        self.follower.pause();
        self.hover_at = None;
        let offset = place - motion.position;
        let far_m_s = (SETTLING_SHARE * offset.norm()).min(self.envelope.cruise_m_s);
        let velocity = apf::limited(offset, far_m_s.max(SETTLING_M_S));
        Wish { velocity, height_m: place.z }
    }

    /// Straight back to where paths lead, beside the map: no faster than the newest scan sees the way free.
    fn straight_back(
        &mut self,
        following: &mut Following,
        motion: &Motion,
        allowed: &Allowed,
        surroundings: &Surroundings<'_>,
    ) -> Wish {
        self.follower.pause();
        self.hover_at = None;
        let position = &motion.position;
        let hard = self.envelope.braking(self.envelope.brake_m_s2);
        let kept_m = self.envelope.obstacle_clearance_m();
        let seen_m = |ahead: &Vector3<f64>| match surroundings.sees {
            true => surroundings.rays.free_m(position, ahead, BACK_BESIDE_M),
            false => SEEN_AHEAD_M,
        };
        let cap_m_s = |ahead: &Vector3<f64>| braking::sensed_cap(seen_m(ahead) - kept_m, &hard);
        let level = |path: &Path| (path.end() - position).xy().push(0.0);
        let space = following.back_into;
        let off_m = level(&following.path).norm();
        let is_level_way = off_m > BACK_BESIDE_M || space.is_some_and(|space| space.is_beside(position));
        if is_level_way && seen_m(&level(&following.path)) < off_m.min(BLOCKED_BACK_M) {
            let is_free = |ahead: &Vector3<f64>, to_go_m: f64| seen_m(ahead) > to_go_m.min(FREE_BACK_M);
            let around = space.and_then(|space| space.way_around(position, surroundings.map, is_free));
            following.path = around.unwrap_or_else(|| following.path.clone());
        }
        following.station_m = following.path.project(position).station_m;
        let (end, offset) = (following.path.end(), level(&following.path));
        let free_m_s = if is_level_way { cap_m_s(&offset) } else { BACK_M_S };
        let gentle_m_s = |to_go_m: f64| (BACK_SHARE * to_go_m).clamp(BACK_LEAST_M_S, BACK_M_S);
        let most_m_s = gentle_m_s(offset.norm()).min(free_m_s).min(allowed.speed_m_s);
        let velocity = apf::limited(offset, most_m_s);
        if is_level_way {
            return Wish { velocity, height_m: following.path.start().z };
        }
        let climb_m = end.z - position.z;
        let climb_m_s = gentle_m_s(climb_m.abs()).min(climb_m.abs()) * climb_m.signum();
        Wish { velocity: velocity.xy().push(climb_m_s), height_m: end.z }
    }

    fn along_path(
        &mut self,
        lead: Lead<'_>,
        motion: &Motion,
        allowed: &Allowed,
        surroundings: &Surroundings<'_>,
    ) -> Wish {
        let map = surroundings.map;
        let Lead { following: Following { path, station_m, .. }, attraction, .. } = lead;
        self.hover_at = None;
        let ahead = path.direction_at(*station_m);
        let [mapped_m, seen_m] = self.free_ahead_m(&motion.position, &ahead, surroundings);
        let (gentle_m_s, _) = braking::speed_cap(path, *station_m, seen_m, self.follower.braking());
        let hard = self.envelope.braking(self.envelope.brake_m_s2);
        let cap_m_s = gentle_m_s.min(braking::sensed_cap(mapped_m, &hard));
        let place = Place { path, station_m: *station_m, position: &motion.position };
        let step = self.follower.follow(&place, cap_m_s.min(allowed.speed_m_s), attraction, map);
        *station_m = step.station_m;
        self.forces.pull = step.pull;
        Wish { velocity: step.velocity, height_m: step.carrot.z }
    }

    /// The free length of the way ahead, m: as far as the map tells, and as far as the newest scan saw.
    fn free_ahead_m(
        &self,
        position: &Vector3<f64>,
        ahead: &Vector3<f64>,
        surroundings: &Surroundings<'_>,
    ) -> [f64; 2] {
        if !surroundings.sees {
            return [MAPPED_AHEAD_M, SEEN_AHEAD_M];
        }
        let mapped_m = surroundings.map.voxels().sensed_free_m(position, ahead, MAPPED_AHEAD_M);
        let seen_m = surroundings.rays.free_m(position, ahead, BESIDE_WAY_M).min(SEEN_AHEAD_M);
        [mapped_m, seen_m.max(mapped_m)]
    }

    /// At the place where the vehicle came to a stop, or to where others have pushed it.
    fn keep_station(&mut self, motion: &Motion, map: &ClearanceMap) -> Wish {
        self.follower.pause();
        let place = self
            .hover_at
            .filter(|place| {
                (place - motion.position).norm() < GIVES_WAY_M || leads_out(&motion.position, place, map)
            })
            .unwrap_or_else(|| {
                open_place(&self.stop(&motion.position, &motion.velocity), &motion.position, map)
            });
        self.hover_at = Some(place);
        let back = apf::limited(place - motion.position, STATION_KEEPING_M_S);
        Wish { velocity: back, height_m: place.z }
    }
}

/// Where to hover instead of at `place`, if that is closed: the nearest place that is open, to its side, above or
/// below, and to which the way is free.
fn open_place(place: &Vector3<f64>, from: &Vector3<f64>, map: &ClearanceMap) -> Vector3<f64> {
    let Some(keep_out) = map.keep_out() else { return *place };
    let is_mapped = |there: &Vector3<f64>| map.voxels().index_of(there).is_some();
    let is_reached = |there: &Vector3<f64>| is_mapped(there) && map.is_segment_clear(from, there, 0.0);
    keep_out.way_out(place, is_reached).unwrap_or(*place)
}

/// Whether one place is closed and another is not.
fn leads_out(from: &Vector3<f64>, to: &Vector3<f64>, map: &ClearanceMap) -> bool {
    map.keep_out().is_some_and(|keep_out| keep_out.room_m(from) < 0.0 && keep_out.room_m(to) >= 0.0)
}
