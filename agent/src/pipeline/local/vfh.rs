//! The vector field histogram as local planner: through openings, gently.

use nalgebra::Vector3;
use skein_planning::{
    airspace::KeepOut,
    local::{
        braking::BrakingConfig,
        speed::SpeedConfig,
        vfh::{Follower, Step, VfhConfig},
    },
    map::ClearanceMap,
};

use super::path_follower::{PathFollower, Place, TICK_S};
use crate::config::Envelope;

/// Change of velocity that is asked for, m/s^2: a pitch of 2.6 degrees, which leaves the autopilot something of 5.
const GENTLE_M_S2: f64 = 0.45;
/// Deceleration that slowing down is planned with, m/s^2: it leaves as much for turning.
const GENTLE_BRAKE_M_S2: f64 = 0.7 * GENTLE_M_S2;
/// Openings are looked for among what is within this distance, m.
const OPENINGS_M: f64 = 8.0;
/// A scan may show an obstacle this much nearer than the one before did, m: who is no faster than that allows is not
/// stopped short by the safety filter.
const BESIDE_FILTER_M: f64 = 0.2;
/// What is this much further aside than the safety filter keeps does not stand in the way, m.
const BESIDE_WAY_M: f64 = 0.1;
/// Openings that are wide enough are passed at this distance, m.
const COMFORT_M: f64 = 0.8;

/// Follows a path through the openings in a histogram.
#[derive(Clone, Debug)]
pub struct Vfh {
    braking: BrakingConfig,
    follower: Follower,
}

impl Vfh {
    /// The planner of a vehicle of this envelope.
    pub fn new(envelope: &Envelope) -> Self {
        Self::with_speed(envelope, Self::speed(envelope))
    }

    /// The speeds of a vehicle of this envelope.
    pub fn speed(envelope: &Envelope) -> SpeedConfig {
        let filter_m = envelope.obstacle_clearance_m();
        SpeedConfig {
            hard_m_s2: envelope.brake_m_s2,
            latency_s: envelope.latency_s,
            gentle_m_s2: GENTLE_M_S2,
            brake_m_s2: GENTLE_BRAKE_M_S2,
            clearance_m: filter_m + BESIDE_FILTER_M,
            corridor_m: filter_m + BESIDE_WAY_M,
            ..SpeedConfig::default().cruising_at(envelope.cruise_m_s)
        }
    }

    /// The planner of a vehicle of this envelope at a speed of one's own.
    pub fn with_speed(envelope: &Envelope, speed: SpeedConfig) -> Self {
        let safety_radius_m = envelope.hull_m + envelope.margin_m;
        let histogram = VfhConfig { safety_radius_m, comfort_radius_m: COMFORT_M, ..VfhConfig::default() };
        Self { braking: envelope.braking(GENTLE_BRAKE_M_S2), follower: Follower::new(histogram, speed) }
    }
}

impl PathFollower for Vfh {
    fn braking(&self) -> &BrakingConfig {
        &self.braking
    }

    fn handle(&mut self, envelope: &Envelope) {
        *self = Self::new(envelope);
    }

    fn follow(&mut self, place: &Place<'_>, cap_m_s: f64, _attraction: f64, map: &ClearanceMap) -> Step {
        self.follower.follow(place.path, place.station_m, place.position, cap_m_s, map)
    }

    /// Nor do openings lead into what is closed.
    fn look(
        &mut self,
        origin: &Vector3<f64>,
        returns: &[Vector3<f64>],
        rays: usize,
        closed: Option<&KeepOut>,
    ) {
        let unseen = closed.map(|closed| closed.seen_from(origin, rays, OPENINGS_M)).unwrap_or_default();
        if unseen.is_empty() {
            self.follower.look(origin, returns, rays);
        } else {
            self.follower.look(origin, &[returns, &unseen].concat(), rays);
        }
    }

    fn ease(&self, wanted: Vector3<f64>) -> Vector3<f64> {
        self.follower.ease(&wanted, TICK_S)
    }

    fn flew(&mut self, set_point: &Vector3<f64>) {
        self.follower.flew(set_point);
    }

    fn rest(&mut self) {
        self.follower.rest();
    }
}
