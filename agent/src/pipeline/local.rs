//! The local planner of a vehicle: which velocity follows the path now, by a potential field or through openings in a
//! histogram; see [`skein_planning::local`].

use std::time::Duration;

use nalgebra::Vector3;
use skein_planning::{
    Path,
    airspace::KeepOut,
    local::{
        apf::{self, ApfConfig},
        braking::{self, BrakingConfig},
        moving::{MovingConfig, Tracker},
        speed::SpeedConfig,
        vfh::{Follower, Step, VfhConfig},
    },
    map::ClearanceMap,
    separation::Neighbour,
};

use crate::config::{Envelope, Layer, LocalPlanner, Planners};

/// The set-point loop's period.
const TICK_S: f64 = 0.02;
/// How far ahead the way is looked at for the speed cap, m.
const SENSED_AHEAD_M: f64 = 9.0;
/// Change of velocity that is asked for in openings, m/s^2: a pitch of 2.6 degrees, which leaves the autopilot something of 5.
const GENTLE_M_S2: f64 = 0.45;
/// Deceleration that slowing down in openings is planned with, m/s^2: it leaves as much for turning.
const GENTLE_BRAKE_M_S2: f64 = 0.7 * GENTLE_M_S2;
/// Openings are looked for among what is within this distance, m.
const OPENINGS_M: f64 = 8.0;
/// A scan may show an obstacle this much nearer than the one before did, m: who is no faster than that allows is not stopped
/// short by the safety filter.
const BESIDE_FILTER_M: f64 = 0.2;
/// What is this much further aside than the safety filter keeps does not stand in the way, m.
const BESIDE_WAY_M: f64 = 0.1;
/// Openings that are wide enough are passed at this distance, m.
const COMFORT_M: f64 = 0.8;

/// What turns a path into a velocity, with its memory.
#[derive(Debug)]
pub struct Local {
    braking: BrakingConfig,
    field: ApfConfig,
    /// Set-point of the field's speed, m/s.
    speed_m_s: f64,
    /// In place of the field: through openings in a histogram.
    openings: Option<Follower>,
    /// What moves and tells nobody where it is.
    moving: Tracker,
}

impl Local {
    /// The planner that `planners` names for a vehicle of this envelope, `filter_m` from obstacles at the nearest.
    #[must_use]
    pub fn new(envelope: &Envelope, planners: Planners, filter_m: f64) -> Self {
        let avoids = planners.without != Some(Layer::LocalAvoidance);
        let openings =
            (avoids && planners.local == LocalPlanner::Vfh).then(|| gentle_follower(envelope, filter_m));
        let brake_m_s2 = if openings.is_some() { GENTLE_BRAKE_M_S2 } else { envelope.brake_m_s2 };
        let field = ApfConfig::default();
        let repulsive_gain = if avoids { field.repulsive_gain } else { 0.0 };
        Self {
            braking: BrakingConfig {
                cruise_m_s: envelope.cruise_m_s,
                decel_m_s2: brake_m_s2,
                accel_m_s2: brake_m_s2,
                latency_s: envelope.latency_s,
                ..BrakingConfig::default()
            },
            field: ApfConfig { repulsive_gain, ..field },
            speed_m_s: 0.0,
            openings,
            moving: Tracker::new(MovingConfig::default()),
        }
    }

    /// Takes in the obstacle points of a scan of `rays` rays that was taken at `stamp` and `origin`; metres ENU. Nor do
    /// openings lead into what is closed.
    pub fn look(
        &mut self,
        stamp: Duration,
        origin: &Vector3<f64>,
        returns: &[Vector3<f64>],
        rays: usize,
        closed: Option<&KeepOut>,
    ) {
        self.moving.look(stamp, returns);
        let Some(follower) = &mut self.openings else { return };
        let unseen = closed.map(|closed| closed.seen_from(origin, rays, OPENINGS_M)).unwrap_or_default();
        if unseen.is_empty() {
            follower.look(origin, returns, rays);
        } else {
            follower.look(origin, &[returns, &unseen].concat(), rays);
        }
    }

    /// What moves and tells nobody where it is.
    pub fn moving<'a>(
        &'a self,
        now: Duration,
        map: &'a ClearanceMap,
    ) -> impl Iterator<Item = Neighbour> + 'a {
        self.moving.moving(now, map)
    }

    /// The velocity that follows `path` from about `station_m`, where the last call was. `attraction` is 1, and less while a
    /// local minimum is escaped from.
    pub fn follow(
        &mut self,
        path: &Path,
        station_m: f64,
        position: &Vector3<f64>,
        attraction: f64,
        map: &ClearanceMap,
    ) -> Step {
        let ahead = path.direction_at(station_m);
        let sensed_free_m = map.voxels().sensed_free_m(position, &ahead, SENSED_AHEAD_M);
        let (cap_m_s, _) = braking::speed_cap(path, station_m, sensed_free_m, &self.braking);
        if let Some(follower) = &mut self.openings {
            return follower.follow(path, station_m, position, cap_m_s, map);
        }
        self.speed_m_s = braking::ramp(self.speed_m_s, cap_m_s, TICK_S, &self.braking);
        let pulled = apf::follow(map, path, station_m, position, self.speed_m_s, attraction, &self.field);
        Step { velocity: pulled.velocity, carrot: pulled.carrot, station_m: pulled.station_m }
    }

    /// The set-point on its way to `wanted`: gently, if this planner flies so.
    #[must_use]
    pub fn ease(&self, wanted: Vector3<f64>) -> Vector3<f64> {
        self.openings.as_ref().map_or(wanted, |follower| follower.ease(&wanted, TICK_S))
    }

    /// The set-point that was sent in the end.
    pub fn flew(&mut self, set_point: &Vector3<f64>) {
        if let Some(follower) = &mut self.openings {
            follower.flew(set_point);
        }
    }

    /// There is no path to be followed now.
    pub fn pause(&mut self) {
        self.speed_m_s = 0.0;
    }

    /// Somebody else moves the vehicle, or nobody.
    pub fn rest(&mut self) {
        self.pause();
        if let Some(follower) = &mut self.openings {
            follower.rest();
        }
    }

    /// Where a vehicle that moves like this comes to a stop, metres ENU.
    #[must_use]
    pub fn stop(&self, position: &Vector3<f64>, velocity: &Vector3<f64>) -> Vector3<f64> {
        position + velocity * (velocity.norm() / (2.0 * self.braking.decel_m_s2))
    }
}

fn gentle_follower(envelope: &Envelope, filter_m: f64) -> Follower {
    let speed = SpeedConfig {
        hard_m_s2: envelope.brake_m_s2,
        latency_s: envelope.latency_s,
        gentle_m_s2: GENTLE_M_S2,
        brake_m_s2: GENTLE_BRAKE_M_S2,
        clearance_m: filter_m + BESIDE_FILTER_M,
        corridor_m: filter_m + BESIDE_WAY_M,
        ..SpeedConfig::default().cruising_at(envelope.cruise_m_s)
    };
    let safety_radius_m = envelope.hull_m + envelope.margin_m;
    Follower::new(VfhConfig { safety_radius_m, comfort_radius_m: COMFORT_M, ..VfhConfig::default() }, speed)
}
