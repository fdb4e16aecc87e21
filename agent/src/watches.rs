//! Watches: conditions of the vehicle that are reported at the moment they change.

use nalgebra::Vector3;
use skein_planning::airspace::StayInside;

use crate::config::Fence;
use crate::neighbours::Neighbour;
use crate::positioning::{Estimate, Motion, excess_m};
use crate::report::Report;

/// Energy at which only landing is left.
const BATTERY_EMERGENCY: f64 = 0.08;
/// Centre-to-centre distance at which a neighbour is too close, m; the safety filter keeps more.
const EMERGENCY_DISTANCE_M: f64 = 1.0;
/// Distance at which it is clear again, m.
const CLEAR_DISTANCE_M: f64 = 1.2;
/// A vehicle so far outside the fence breaches it: less is an estimate's noise, m.
const FENCE_TOLERANCE_M: f64 = 0.3;

/// A position that was too uncertain is one to fly by again below this share of the limit.
const TRUSTED_BELOW: f64 = 0.8;

/// A condition that is told once when it begins and once when it ends.
#[derive(Debug, Default)]
struct Edge(bool);

impl Edge {
    fn rises(&mut self, on: bool) -> bool {
        let rose = on && !self.0;
        self.0 = on;
        rose
    }

    fn turns(&mut self, on: bool) -> Option<bool> {
        let turned = self.0 != on;
        self.0 = on;
        turned.then_some(on)
    }
}

/// Everything that is watched on one vehicle.
#[derive(Debug, Default)]
pub struct Watches {
    low: Edge,
    critical: Edge,
    outside: Edge,
    doubted: Edge,
    /// The position is too uncertain, and becomes so above a limit.
    uncertain: bool,
    close: Edge,
}

impl Watches {
    /// Battery: low when there is a reason to return; critical by its charge, if that is known.
    pub fn battery(&mut self, charge: Option<f64>, why_low: Option<String>) -> Vec<Report> {
        let mut reports = Vec::new();
        if self.low.rises(why_low.is_some()) {
            reports.extend(why_low.map(Report::BatteryLow));
        }
        if self.critical.rises(charge.is_some_and(|charge| charge <= BATTERY_EMERGENCY)) {
            reports.push(Report::BatteryCritical);
        }
        reports
    }

    /// Position: why it is none to fly by, if so. Too uncertain is one above `limit_m`, until it is well below.
    pub fn position(&mut self, estimate: &Estimate, limit_m: f64) -> Option<String> {
        let sigma_m = estimate.motion.map_or(0.0, |motion| motion.value.position_sigma_m());
        self.uncertain = sigma_m > if self.uncertain { TRUSTED_BELOW * limit_m } else { limit_m };
        let uncertain =
            || format!("the position is uncertain by {sigma_m:.1} m, more than {limit_m} m (sigma_limit_m)");
        let shock = || estimate.shock.filter(|_| self.uncertain).map(|shock| shock.to_string());
        let doubt = estimate.doubt.map(|doubt| doubt.to_string());
        doubt.or_else(shock).or_else(|| self.uncertain.then(uncertain))
    }

    /// The same in the air, as news; `why` is what [`position`](Self::position) says.
    pub fn doubt(&mut self, why: Option<&str>, sigma_m: f64) -> Option<Report> {
        self.doubted.turns(why.is_some()).map(|_| match why {
            Some(why) => Report::PositionDoubted { why: why.to_owned(), sigma_m },
            None => Report::PositionTrusted,
        })
    }

    /// On the ground nothing is doubted in the air.
    pub fn stand(&mut self) {
        self.doubted = Edge::default();
    }

    /// Geofence: the vehicle is outside of its box, or of where it is to stay, by more than its position may be off.
    pub fn fence(&mut self, motion: &Motion, fence: &Fence, stay_inside: &[StayInside]) -> Option<Report> {
        let off_m = FENCE_TOLERANCE_M + excess_m(motion.position_sigma_m());
        let has_left = stay_inside.iter().any(|area| area.room_m(&motion.position) < -off_m);
        let outside = has_left
            || (0..3).any(|axis| {
                let tolerance_m = FENCE_TOLERANCE_M + excess_m(motion.axis_sigma_m(axis));
                motion.position[axis] < fence.min[axis] - tolerance_m
                    || motion.position[axis] > fence.max[axis] + tolerance_m
            });
        self.outside.rises(outside).then_some(Report::FenceBreached)
    }

    /// Separation: a neighbour in the air is inside the emergency distance.
    pub fn separation(&mut self, position: Vector3<f64>, neighbours: &[Neighbour]) -> Option<Report> {
        let nearest = neighbours
            .iter()
            .filter(|neighbour| neighbour.armed)
            .map(|neighbour| ((neighbour.position() - position).norm(), &neighbour.node))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let limit = if self.close.0 { CLEAR_DISTANCE_M } else { EMERGENCY_DISTANCE_M };
        let too_close = nearest.filter(|(distance, _)| *distance < limit);
        self.close.turns(too_close.is_some()).map(|_| match too_close {
            Some((_, node)) => Report::TooClose(node.clone()),
            None => Report::Clear,
        })
    }
}
