//! The weights of a route's cost (P3).

use nalgebra::Vector3;

/// The weights of P3's cost, `f = sum_i (phi1 L_i + phi2 t_i + phi3 H_i)` over a route's legs, plus the repulsion
/// between vehicles, energy and smoothness. P3 gives none of them. The cost is in metres: what it would cost to fly so much further.
///
/// * `L`: length.
/// * `t`: time flown. P3's `t` is what is left of the endurance, which a cost must not reward spending. A leg takes as
///   long as its length at cruise or its climb at the rate of climb, whichever is longer.
/// * `H`: `max(0, 1 - c / c0)^2` summed along the route, with the clearance `c` above the terrain and the comfortable
///   one, `c0`.
/// * Repulsion: `1/2 eta (1/rho - 1/rho0)^2` for `rho <= rho0`, summed along the route, with the distance `rho` of each
///   other vehicle at that time.
/// * Energy: the share of what is in the battery that the route takes. Climbing takes as much more than hovering as
///   the air takes up of it. It weighs nothing in the published comparison.
/// * Smoothness: `1 - cos` of the angle by which the route turns, summed over its waypoints. It weighs nothing there
///   either.
/// * Endurance: nothing while more than the reserve is left, then a penalty that grows with the square of what is
///   used of the reserve.
/// * Violation: metres flown in threat or no-fly zones, too low, or too near another vehicle, and what is flown after
///   the endurance is spent. A route without any is feasible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteCost {
    /// `phi1`.
    pub length_weight: f64,
    /// `phi2`, metres per second.
    pub time_weight_m_s: f64,
    /// `phi3`.
    pub height_weight: f64,
    /// Speed of cruise, m/s.
    pub cruise_m_s: f64,
    /// Rate of climb and descent, m/s.
    pub climb_m_s: f64,
    /// `c0`: clearance above the terrain from which height costs nothing, metres.
    pub comfortable_clearance_m: f64,
    /// Clearance above the terrain that is required, metres.
    pub least_clearance_m: f64,
    /// `eta`, metres squared.
    pub repulsion_m2: f64,
    /// `rho0`: where the repulsion begins, metres.
    pub influence_m: f64,
    /// Separation from other vehicles that is required, metres.
    pub least_separation_m: f64,
    /// Seconds that a vehicle can fly, with what is in its battery.
    pub endurance_s: f64,
    /// Climb at which a vehicle takes twice as much power as in hover, m/s: about the speed of the air through its
    /// rotors.
    pub lift_m_s: f64,
    /// Cost of all that is in the battery, metres.
    pub energy_weight_m: f64,
    /// Cost of a turn by a right angle, metres.
    pub smoothness_weight_m: f64,
    /// Share of the endurance that is kept in reserve.
    pub reserve: f64,
    /// Cost of the whole reserve, metres.
    pub reserve_weight_m: f64,
    /// Cost of a metre of violation, metres.
    pub violation_weight: f64,
    /// Distance kept from the border of areas that are stayed inside of, metres.
    pub border_m: f64,
    /// Distance of the samples at which the clearance is looked at, metres, where mountains are near.
    pub sample_m: f64,
}

impl Default for RouteCost {
    fn default() -> Self {
        RouteCost {
            length_weight: 1.0,
            time_weight_m_s: 5.0,
            height_weight: 4.0,
            cruise_m_s: 20.0,
            climb_m_s: 8.0,
            comfortable_clearance_m: 100.0,
            least_clearance_m: 30.0,
            repulsion_m2: 1e4,
            influence_m: 60.0,
            least_separation_m: 20.0,
            endurance_s: 600.0,
            lift_m_s: 5.0,
            energy_weight_m: 0.0,
            smoothness_weight_m: 0.0,
            reserve: 0.2,
            reserve_weight_m: 2000.0,
            violation_weight: 10.0,
            border_m: 0.0,
            sample_m: 25.0,
        }
    }
}

impl RouteCost {
    /// The same weights for vehicles that keep so far from one another and from the ground, m: all distances of the
    /// default, whose vehicles keep 20 m and 30 m, grow with these. Speeds in m/s.
    pub fn scaled(cruise_m_s: f64, climb_m_s: f64, separation_m: f64, clearance_m: f64) -> Self {
        let default = Self::default();
        let apart = separation_m / default.least_separation_m;
        let high = clearance_m / default.least_clearance_m;
        Self {
            time_weight_m_s: default.time_weight_m_s * cruise_m_s / default.cruise_m_s,
            cruise_m_s,
            climb_m_s,
            comfortable_clearance_m: default.comfortable_clearance_m * high,
            least_clearance_m: clearance_m,
            repulsion_m2: default.repulsion_m2 * apart * apart,
            influence_m: default.influence_m * apart,
            least_separation_m: separation_m,
            sample_m: default.sample_m * high.max(0.02),
            ..default
        }
    }

    /// The share of what is in the battery that such a flight takes.
    pub(super) fn energy(&self, time_s: f64, ascent_m: f64) -> f64 {
        (time_s + ascent_m / self.lift_m_s) / self.endurance_s
    }

    /// The time of a leg, seconds.
    pub(super) fn leg_s(&self, way: &Vector3<f64>) -> f64 {
        (way.norm() / self.cruise_m_s).max(way.z.abs() / self.climb_m_s)
    }
}
