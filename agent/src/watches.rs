//! Watches: conditions of the vehicle that are reported at the moment they change.

use nalgebra::Vector3;

use crate::config::Fence;
use crate::neighbours::Neighbour;
use crate::report::Report;

/// Energy at which only landing is left.
const BATTERY_EMERGENCY: f64 = 0.08;
/// Centre-to-centre distance at which a neighbour is too close, m; the safety filter keeps more.
const EMERGENCY_DISTANCE_M: f64 = 1.0;
/// Distance at which it is clear again, m.
const CLEAR_DISTANCE_M: f64 = 1.2;
/// How far outside the fence is a breach and not an estimate's noise, m.
const FENCE_TOLERANCE_M: f64 = 0.3;

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

    /// Geofence: the vehicle is outside.
    pub fn fence(&mut self, position: Vector3<f64>, fence: &Fence) -> Option<Report> {
        let outside = (0..3).any(|axis| {
            position[axis] < fence.min[axis] - FENCE_TOLERANCE_M
                || position[axis] > fence.max[axis] + FENCE_TOLERANCE_M
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
