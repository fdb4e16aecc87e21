//! `[targets]`: the vehicles fly through the terrain, threats and no-fly zones of `[airspace]`, and arrive at their
//! targets together (P3). Their routes are planned before take-off, as the ground plans: each among those before it.

use nalgebra::Vector3;
use serde::Deserialize;
use skein_planning::airspace::{Airspace, NoFlyZone, ThreatZone};
use skein_swarm::assignment::assign;
use skein_swarm::route::{Effort, Planner, RouteCost, RouteError, arrival_slots, plan_in_turn};
use skein_world::Aabb;

use super::field::{ground_points, points, positive};

/// Inner waypoints of a route.
const WAYPOINTS: usize = 6;
/// Distance of routes from threat and no-fly zones: a vehicle's stray from its route, and its hull, in metres.
const MARGIN_M: f64 = 1.5;

/// The `[targets]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Targets {
    /// The targets (ENU, metres). Vehicles that share one arrive in a line across their way.
    #[serde(deserialize_with = "points")]
    places_m: Vec<Vector3<f64>>,
    /// The two ends of the line on which the vehicles stand, evenly, before they take off.
    #[serde(deserialize_with = "ground_points")]
    from_m: Vec<Vector3<f64>>,
    /// Distance between vehicles at one target, in metres.
    #[serde(deserialize_with = "positive")]
    spacing_m: f64,
}

/// Why there are no routes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TargetsError {
    #[error("{0} places, expected two: the ends of the line that the vehicles stand on")]
    Line(usize),
    #[error("expected at least one target")]
    NoTarget,
    #[error(
        "routes are planned around circles: expected `centre_m` and `radius_m` for each of `airspace.no_fly`, and no \
         `airspace.stay_inside`"
    )]
    Polygon,
    /// A start or a target is no place to plan from or to.
    #[error(transparent)]
    Route(#[from] RouteError),
    #[error(
        "no route was found for vehicle {vehicle} that keeps clear of terrain, zones and the others; leave more room between them"
    )]
    NoRoute { vehicle: usize },
}

impl Targets {
    /// Routes of so many vehicles that fly at `cruise_m_s` from `height_m` above where they stand to their targets (ENU,
    /// metres).
    pub fn routes(
        &self,
        vehicles: usize,
        bounds: &Aabb,
        airspace: &Airspace,
        height_m: f64,
        cruise_m_s: f64,
        seed: u64,
    ) -> Result<Vec<Vec<Vector3<f64>>>, TargetsError> {
        if !airspace.prisms.is_empty() || !airspace.stay_inside.is_empty() {
            return Err(TargetsError::Polygon);
        }
        let airspace = keeping_off(airspace, bounds);
        let ends = self.ends(vehicles, height_m, &airspace)?;
        let cost = cost(cruise_m_s);
        let plans = plan_in_turn(&airspace, cost, &ends, WAYPOINTS, |vehicle, problem| {
            let plan = Planner::Ground.plan(problem, Effort::default(), seed.wrapping_add(vehicle as u64));
            if plan.assessment.is_feasible() {
                Ok(plan)
            } else {
                Err(TargetsError::NoRoute { vehicle: vehicle + 1 })
            }
        })?;
        Ok(plans.into_iter().map(|plan| plan.route).collect())
    }

    /// From where to where each vehicle flies, so assigned that the straight ways are shortest together.
    fn ends(&self, vehicles: usize, height_m: f64, airspace: &Airspace) -> Result<Vec<Ends>, TargetsError> {
        let [one, other] = self.from_m[..] else { return Err(TargetsError::Line(self.from_m.len())) };
        let start = |k: usize| one.lerp(&other, (k as f64 + 0.5) / vehicles as f64) + Vector3::z() * height_m;
        let middle = one.lerp(&other, 0.5);
        let at_each = vehicles.div_ceil(self.places_m.len().max(1));
        let slots: Vec<_> = self
            .places_m
            .iter()
            .flat_map(|target| arrival_slots(target, &middle, at_each, self.spacing_m, airspace))
            .collect();
        let starts: Vec<_> = (0..vehicles).map(start).collect();
        let distances: Vec<Vec<f64>> =
            starts.iter().map(|start| slots.iter().map(|slot| (slot - start).norm()).collect()).collect();
        let taken = assign(&distances).ok_or(TargetsError::NoTarget)?;
        Ok(starts.into_iter().zip(taken.into_iter().filter_map(|slot| slots.get(slot).copied())).collect())
    }
}

/// The airspace of the routes: the round zones grown by the margin, in the bounds without it.
fn keeping_off(airspace: &Airspace, bounds: &Aabb) -> Airspace {
    let inset = Vector3::repeat(MARGIN_M);
    let threat = |zone: &ThreatZone| ThreatZone { radius_m: zone.radius_m + MARGIN_M, ..*zone };
    let no_fly = |zone: &NoFlyZone| NoFlyZone {
        radius_m: zone.radius_m + MARGIN_M,
        floor_m: zone.floor_m - MARGIN_M,
        ceiling_m: zone.ceiling_m + MARGIN_M,
        ..*zone
    };
    Airspace {
        lower: bounds.min + inset,
        upper: bounds.max - inset,
        threats: airspace.threats.iter().map(threat).collect(),
        no_fly: airspace.no_fly.iter().map(no_fly).collect(),
        ..airspace.clone()
    }
}

/// From where to where a vehicle flies.
type Ends = (Vector3<f64>, Vector3<f64>);

/// P3's cost at the scale of small vehicles: its distances shrink from a kilometre to a hundred metres and less.
fn cost(cruise_m_s: f64) -> RouteCost {
    RouteCost {
        time_weight_m_s: 0.25 * cruise_m_s,
        cruise_m_s,
        climb_m_s: 1.0,
        comfortable_clearance_m: 5.0,
        least_clearance_m: 2.0,
        repulsion_m2: 60.0,
        influence_m: 5.0,
        least_separation_m: 2.5,
        sample_m: 0.5,
        ..RouteCost::default()
    }
}
