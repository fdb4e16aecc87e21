//! The published speed (Xu 2023): 0.5 m/s while anything is within `dmax`, else the trapezoid.

use nalgebra::Vector3;
use skein_agent::Envelope;
use skein_agent::pipeline::local::{PathFollower, Place, Step, Vfh};
use skein_planning::airspace::KeepOut;
use skein_planning::local::{braking::BrakingConfig, speed::SpeedConfig, vfh::VfhConfig};
use skein_planning::map::ClearanceMap;

/// The published speed where an obstacle is seen, m/s.
pub const SLOW_M_S: f64 = 0.5;

/// The same openings and set-points at the published speed. Whatever else keeps a distance is the safety filter's.
#[derive(Debug)]
pub struct Published {
    vfh: Vfh,
    braking: BrakingConfig,
    sees: bool,
}

impl Published {
    pub fn new(envelope: &Envelope) -> Self {
        let braking = envelope.braking(envelope.brake_m_s2);
        // What it stops for and slows down for itself is what the filter does.
        let speed = SpeedConfig { brake_m_s2: envelope.brake_m_s2, ..Vfh::speed(envelope) };
        Self { vfh: Vfh::with_speed(envelope, speed), braking, sees: false }
    }
}

impl PathFollower for Published {
    fn braking(&self) -> &BrakingConfig {
        &self.braking
    }

    fn handle(&mut self, envelope: &Envelope) {
        *self = Self::new(envelope);
    }

    fn follow(&mut self, place: &Place<'_>, cap_m_s: f64, attraction: f64, map: &ClearanceMap) -> Step {
        let cap_m_s = if self.sees { cap_m_s.min(SLOW_M_S) } else { cap_m_s };
        self.vfh.follow(place, cap_m_s, attraction, map)
    }

    fn look(
        &mut self,
        origin: &Vector3<f64>,
        returns: &[Vector3<f64>],
        rays: usize,
        closed: Option<&KeepOut>,
    ) {
        let far_m = VfhConfig::default().far_m;
        let is_near = |point: &&Vector3<f64>| (*point - origin).xy().norm() <= far_m;
        let near: Vec<_> = returns.iter().filter(is_near).copied().collect();
        self.sees = !near.is_empty();
        self.vfh.look(origin, &near, rays, closed);
    }

    fn ease(&self, wanted: Vector3<f64>) -> Vector3<f64> {
        self.vfh.ease(wanted)
    }

    fn flew(&mut self, set_point: &Vector3<f64>) {
        self.vfh.flew(set_point);
    }

    fn rest(&mut self) {
        self.vfh.rest();
    }
}
