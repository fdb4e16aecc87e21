//! The cost of a route (P3).

use nalgebra::Vector3;

use skein_planning::airspace::Airspace;

use super::traffic::{PARTS, Track, Traffic};
use super::weights::RouteCost;

/// Distance below which the repulsion grows no more, metres: it would be infinite where two vehicles meet.
const CORE_M: f64 = 1.0;

/// A route's cost and its parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Assessment {
    pub length_m: f64,
    /// Time flown at cruise, seconds.
    pub time_s: f64,
    /// `H`, metres.
    pub height_m: f64,
    pub repulsion_m: f64,
    /// Share of what is in the battery.
    pub energy: f64,
    /// `1 - cos` of the turns, summed.
    pub turning: f64,
    /// Square of the share of the reserve that is used.
    pub reserve_used: f64,
    pub violation_m: f64,
    /// The whole cost, metres.
    pub cost_m: f64,
}

impl Assessment {
    /// The route violates nothing.
    pub fn is_feasible(&self) -> bool {
        self.violation_m <= 0.0
    }
}

impl RouteCost {
    /// The cost of flying along these points (ENU, metres) among others. `O(legs (zones + samples) + PARTS vehicles)`.
    pub fn assess(&self, route: &[Vector3<f64>], airspace: &Airspace, traffic: &Traffic) -> Assessment {
        self.assess_below(f64::INFINITY, route, airspace, traffic)
    }

    /// The same, as far as it is needed to know whether the cost is below a limit. All its parts only ever add to it,
    /// so what has reached the limit is left there.
    pub(super) fn assess_below(
        &self,
        limit_m: f64,
        route: &[Vector3<f64>],
        airspace: &Airspace,
        traffic: &Traffic,
    ) -> Assessment {
        let mut sum = Assessment::default();
        for leg in route.windows(2) {
            self.add_way(&(leg[1] - leg[0]), &mut sum);
        }
        sum.turning = route.windows(3).map(turn).sum();
        self.add_endurance(&mut sum);
        self.weigh(&mut sum);
        for leg in route.windows(2) {
            if sum.cost_m >= limit_m {
                return sum;
            }
            self.add_surroundings(&leg[0], &leg[1], airspace, &mut sum);
            self.weigh(&mut sum);
        }
        if sum.cost_m < limit_m {
            self.add_encounters(&Track::along(route, self), traffic, &mut sum);
            self.weigh(&mut sum);
        }
        sum
    }

    /// The cost of a leg by itself, without others and endurance.
    pub fn assess_leg(&self, from: &Vector3<f64>, to: &Vector3<f64>, airspace: &Airspace) -> Assessment {
        let mut sum = Assessment::default();
        self.add_way(&(to - from), &mut sum);
        self.add_surroundings(from, to, airspace, &mut sum);
        self.weigh(&mut sum);
        sum
    }

    fn weigh(&self, sum: &mut Assessment) {
        sum.cost_m = self.length_weight * sum.length_m
            + self.time_weight_m_s * sum.time_s
            + self.height_weight * sum.height_m
            + sum.repulsion_m
            + self.energy_weight_m * sum.energy
            + self.smoothness_weight_m * sum.turning
            + self.reserve_weight_m * sum.reserve_used
            + self.violation_weight * sum.violation_m;
    }

    fn add_way(&self, way: &Vector3<f64>, sum: &mut Assessment) {
        let leg_s = self.leg_s(way);
        sum.length_m += way.norm();
        sum.time_s += leg_s;
        sum.energy += self.energy(leg_s, way.z.max(0.0));
    }

    fn add_surroundings(
        &self,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        airspace: &Airspace,
        sum: &mut Assessment,
    ) {
        sum.violation_m += airspace.intrusion_m(from, to) + airspace.outside_m(from, to, self.border_m);
        let terrain_m = airspace.terrain_bound_m(from, to);
        let high_m = self.comfortable_clearance_m.max(self.least_clearance_m) + terrain_m;
        if from.z.min(to.z) >= high_m {
            return;
        }
        let way = to - from;
        let length_m = way.norm();
        let samples = (length_m / self.sample_m).ceil().max(1.0);
        let part_m = length_m / samples;
        for k in 0..samples as usize {
            let point = from + way * ((k as f64 + 0.5) / samples);
            if point.z >= high_m {
                continue;
            }
            let clearance_m = if terrain_m > 0.0 { airspace.clearance_m(&point) } else { point.z };
            let lack = (1.0 - clearance_m / self.comfortable_clearance_m).max(0.0);
            sum.height_m += lack * lack * part_m;
            if clearance_m < self.least_clearance_m {
                sum.violation_m += part_m;
            }
        }
    }

    fn add_encounters(&self, track: &Track, traffic: &Traffic, sum: &mut Assessment) {
        let part_m = sum.length_m / PARTS as f64;
        traffic.encounters(track, self.influence_m.max(self.least_separation_m), |distance_m| {
            let closeness = (1.0 / distance_m.max(CORE_M) - 1.0 / self.influence_m).max(0.0);
            sum.repulsion_m += 0.5 * self.repulsion_m2 * closeness * closeness * part_m;
            if distance_m < self.least_separation_m {
                sum.violation_m += part_m;
            }
        });
    }

    fn add_endurance(&self, sum: &mut Assessment) {
        let beyond_s = sum.time_s - (1.0 - self.reserve) * self.endurance_s;
        if beyond_s > 0.0 {
            let used = beyond_s / (self.reserve * self.endurance_s);
            sum.reserve_used = used * used;
            sum.violation_m += (sum.time_s - self.endurance_s).max(0.0) * self.cruise_m_s;
        }
    }
}

/// `1 - cos` of the angle by which a way turns at the middle of three points.
fn turn(points: &[Vector3<f64>]) -> f64 {
    let (before, after) = (points[1] - points[0], points[2] - points[1]);
    let lengths = (before.norm_squared() * after.norm_squared()).sqrt();
    if lengths > 0.0 { 1.0 - before.dot(&after) / lengths } else { 0.0 }
}
