//! The potential field as local planner: pulled along the path, pushed away by what is near.

use skein_planning::{
    local::{
        apf::{self, ApfConfig},
        braking::{self, BrakingConfig},
        vfh::Step,
    },
    map::ClearanceMap,
};

use super::path_follower::{PathFollower, Place, TICK_S};
use crate::config::Envelope;

/// The field, and the speed that it has reached.
#[derive(Clone, Debug)]
pub struct Apf {
    braking: BrakingConfig,
    field: ApfConfig,
    speed_m_s: f64,
}

impl Apf {
    /// The field of a vehicle of this envelope.
    pub fn new(envelope: &Envelope) -> Self {
        Self::with_field(envelope, ApfConfig::default())
    }

    /// The same with gains and reaches of one's own.
    pub fn with_field(envelope: &Envelope, field: ApfConfig) -> Self {
        Self { braking: envelope.braking(envelope.brake_m_s2), field, speed_m_s: 0.0 }
    }
}

impl PathFollower for Apf {
    fn braking(&self) -> &BrakingConfig {
        &self.braking
    }

    fn handle(&mut self, envelope: &Envelope) {
        self.braking = envelope.braking(envelope.brake_m_s2);
    }

    fn follow(&mut self, place: &Place<'_>, cap_m_s: f64, attraction: f64, map: &ClearanceMap) -> Step {
        self.speed_m_s = braking::ramp(self.speed_m_s, cap_m_s, TICK_S, &self.braking);
        let Place { path, station_m, position } = *place;
        let pulled = apf::follow(map, path, station_m, position, self.speed_m_s, attraction, &self.field);
        Step {
            velocity: pulled.velocity,
            carrot: pulled.carrot,
            station_m: pulled.station_m,
            pull: pulled.attraction,
        }
    }

    fn pause(&mut self) {
        self.speed_m_s = 0.0;
    }
}
