//! A way on without the ground station: a vehicle plans for itself among the routes that it has last heard of (P3).

use nalgebra::Vector3;
use skein_planning::airspace::Airspace;
use skein_swarm::route::{Craft, Effort, Planner, RouteCost, RouteProblem, Traffic};
use skein_wire::Route;

use crate::{config::AgentConfig, neighbours::Neighbour};

/// Inner waypoints between two targets.
const WAYPOINTS: usize = 8;
/// A new way is worth it if it costs no more than this share of the old one.
const WORTH_IT: f64 = 0.98;

/// A vehicle's own knowledge of the air: what stands in it, the others' routes, and what a way costs.
pub struct WayOn {
    airspace: Airspace,
    traffic: Traffic,
    cost: RouteCost,
    seed: u64,
}

impl WayOn {
    /// Through this airspace among these others, at this cost. The same seed finds the same ways.
    pub fn through(airspace: Airspace, traffic: Traffic, cost: RouteCost, seed: u64) -> Self {
        Self { airspace, traffic, cost, seed }
    }

    /// For a vehicle with this share of its battery left, among the others as they were last heard.
    pub(crate) fn new(others: &[Neighbour], battery: f64, config: &AgentConfig) -> Self {
        let envelope = &config.envelope;
        let craft = Craft::of_body(
            (envelope.cruise_m_s, envelope.climb_m_s),
            envelope.endurance_s,
            envelope.separation_m,
            envelope.hull_m,
            config.takeoff_height_m,
        );
        let cost = craft.cost(battery);
        let mut traffic = Traffic::default();
        for other in others.iter().filter(|other| other.armed) {
            let ahead = other.way.iter().flat_map(|way| way.points().iter().skip(1).copied());
            traffic.add(&std::iter::once(other.position()).chain(ahead).collect::<Vec<_>>(), &cost);
        }
        let (lower, upper) = (config.fence.min.into(), config.fence.max.into());
        let airspace = Airspace { lower, upper, ..config.airspace.clone() }.keeping_off(craft.margin_m);
        Self::through(airspace, traffic, cost, config.seed)
    }

    /// A better way to what is left of `route` from its point with the number `next` on, from a place (ENU, metres):
    /// its targets stay, what is only the way there is searched for anew, by the improved particle swarm. None if there
    /// is nothing to search for, or nothing better that keeps clear of everything.
    ///
    /// It takes some milliseconds for each target.
    pub fn better(&self, route: &Route, next: usize, place: Vector3<f64>) -> Option<Route> {
        let left = route.points().get(next..)?.iter().map(|point| Vector3::from(*point));
        let left: Vec<_> = std::iter::once(place).chain(left).collect();
        let targets: Vec<_> = route.targets().filter(|(index, _)| *index >= next).collect();
        if targets.len() + 1 == left.len() {
            return None;
        }
        let (mut way, mut stops) = (vec![place], Vec::new());
        for (_, target) in targets {
            way.extend_from_slice(&self.leg(*way.last()?, target.into())?[1..]);
            stops.push(way.len() - 2);
        }
        let [old, new] = [&left, &way].map(|way| self.cost.assess(way, &self.airspace, &self.traffic));
        if !new.is_feasible() || old.is_feasible() && new.cost_m > WORTH_IT * old.cost_m {
            return None;
        }
        let points = way[1..].iter().map(|point| point.map(|m| (m * 100.0).round() / 100.0).into());
        Some(Route::new(points.collect()).ok()?.with_targets(&stops))
    }

    fn leg(&self, from: Vector3<f64>, to: Vector3<f64>) -> Option<Vec<Vector3<f64>>> {
        let mut problem =
            RouteProblem::new(&self.airspace, &self.traffic, self.cost, (from, to), WAYPOINTS).ok()?;
        let found = Planner::Onboard.plan(&mut problem, Effort::default(), self.seed);
        found.assessment.is_feasible().then_some(found.route)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use skein_planning::airspace::ThreatZone;

    use super::*;

    #[test]
    fn who_is_alone_flies_round_a_threat_through_all_targets_and_keeps_a_way_that_is_as_good() {
        let threats = vec![ThreatZone { centre: Vector2::new(50.0, 0.0), radius_m: 15.0 }];
        let (lower, upper) = (Vector3::new(-10.0, -50.0, 0.0), Vector3::new(120.0, 50.0, 40.0));
        let airspace = Airspace { lower, upper, threats, ..Airspace::default() };
        let cost = Craft::default().cost(1.0);
        let alone = WayOn::through(airspace.clone(), Traffic::default(), cost, 1);
        let here = Vector3::new(0.0, 2.0, 5.0);
        let points = vec![[50.0, 45.0, 5.0], [90.0, 0.0, 6.0], [60.0, 40.0, 6.0], [30.0, 40.0, 6.0]];
        let by_hand = Route::new(points).unwrap();
        let detour = by_hand.clone().with_targets(&[1, 3]);
        let better = alone.better(&detour, 0, here).unwrap();
        let targets: Vec<_> = better.targets().map(|(_, target)| target).collect();
        assert_eq!(targets, [[90.0, 0.0, 6.0], [30.0, 40.0, 6.0]]);
        let way = std::iter::once(here).chain(better.points().iter().map(|point| (*point).into()));
        let way: Vec<Vector3<f64>> = way.collect();
        assert!(way.windows(2).all(|leg| airspace.intrusion_m(&leg[0], &leg[1]) == 0.0), "{way:?}");
        assert_eq!(alone.better(&better, 0, here), None, "no other is that much better");
        assert_eq!(alone.better(&by_hand, 0, here), None, "every point is a target");
        let rest = alone.better(&detour, 2, Vector3::new(90.0, 0.0, 6.0)).unwrap();
        assert_eq!(rest.targets().count(), 1, "what it has passed is behind it");
    }
}
