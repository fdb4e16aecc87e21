//! Arriving at the same time, next to one another.

use nalgebra::Vector3;

use crate::airspace::Airspace;

/// How vehicles fly their routes so that they arrive together.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    /// When the last one arrives, seconds after all set out.
    pub time_s: f64,
    /// The constant speed of each, m/s.
    pub speeds_m_s: Vec<f64>,
    /// How long before the last one the first one arrives, seconds.
    pub spread_s: f64,
}

/// The speeds at which vehicles arrive together as soon as possible.
///
/// The last one flies as fast as its route allows: `speeds_m_s.1`, or less where a leg climbs or sinks so steeply that it
/// would exceed `climb_m_s`. The others fly as much slower as their routes are shorter, but none slower than
/// `speeds_m_s.0`: who would have to arrives early, and the spread says by how much.
#[must_use]
pub fn arrive_together(routes: &[&[Vector3<f64>]], speeds_m_s: (f64, f64), climb_m_s: f64) -> Arrival {
    let (slowest_m_s, fastest_m_s) = speeds_m_s;
    let length_m =
        |route: &[Vector3<f64>]| -> f64 { route.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum() };
    let most_m_s = |route: &[Vector3<f64>]| {
        route.windows(2).fold(fastest_m_s, |most, leg| {
            let way = leg[1] - leg[0];
            if way.z.abs() > 0.0 { most.min(climb_m_s * way.norm() / way.z.abs()) } else { most }
        })
    };
    let time_s = routes.iter().map(|route| length_m(route) / most_m_s(route)).fold(0.0, f64::max);
    let speeds_m_s: Vec<f64> = routes
        .iter()
        .map(|route| if time_s > 0.0 { (length_m(route) / time_s).max(slowest_m_s) } else { 0.0 })
        .collect();
    let arrivals = routes.iter().zip(&speeds_m_s).map(|(route, speed)| length_m(route) / speed);
    let first_s = arrivals.fold(time_s, f64::min);
    Arrival { time_s, speeds_m_s, spread_s: time_s - first_s }
}

/// Places around a target for so many vehicles to arrive at, in a line across the way to it, `spacing_m` apart. The line is
/// moved into the airspace where the target is at its edge.
#[must_use]
pub fn arrival_slots(
    target: &Vector3<f64>,
    from: &Vector3<f64>,
    vehicles: usize,
    spacing_m: f64,
    airspace: &Airspace,
) -> Vec<Vector3<f64>> {
    let way = target - from;
    let across = Vector3::new(-way.y, way.x, 0.0).try_normalize(1e-9).unwrap_or_else(Vector3::y);
    let half = 0.5 * vehicles.saturating_sub(1) as f64;
    let ends = [-half, half].map(|k| target + across * (k * spacing_m));
    let shift: Vector3<f64> = ends.iter().map(|end| airspace.nearest_inside(end) - end).sum();
    (0..vehicles).map(|k| target + shift + across * ((k as f64 - half) * spacing_m)).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn straight(length_m: f64, climb_m: f64) -> Vec<Vector3<f64>> {
        vec![Vector3::zeros(), Vector3::new(length_m, 0.0, climb_m)]
    }

    #[test]
    fn the_longest_route_is_flown_fastest_and_the_shortest_no_slower_than_allowed() {
        let routes = [straight(2000.0, 0.0), straight(1600.0, 0.0), straight(500.0, 0.0)];
        let routes: Vec<&[_]> = routes.iter().map(Vec::as_slice).collect();
        let arrival = arrive_together(&routes[..2], (10.0, 25.0), 8.0);
        assert_eq!(arrival, Arrival { time_s: 80.0, speeds_m_s: vec![25.0, 20.0], spread_s: 0.0 });
        let arrival = arrive_together(&routes, (10.0, 25.0), 8.0);
        assert_eq!((arrival.speeds_m_s[2], arrival.spread_s), (10.0, 30.0));
    }

    #[test]
    fn a_steep_leg_slows_everybody() {
        let routes = [straight(300.0, 400.0), straight(500.0, 0.0)];
        let routes: Vec<&[_]> = routes.iter().map(Vec::as_slice).collect();
        let arrival = arrive_together(&routes, (5.0, 25.0), 8.0);
        assert_eq!(arrival.speeds_m_s, vec![10.0, 10.0], "8 m/s up are 10 m/s along 3, 4, 5");
    }

    proptest! {
        #[test]
        fn slots_are_apart_and_inside(y in 0.0..200.0_f64, from in 0.0..200.0_f64, vehicles in 1..5_usize) {
            let airspace = Airspace { upper: Vector3::new(200.0, 200.0, 50.0), ..Airspace::default() };
            let target = Vector3::new(200.0, y, 20.0);
            let slots = arrival_slots(&target, &Vector3::new(0.0, from, 0.0), vehicles, 20.0, &airspace);
            prop_assert_eq!(slots.len(), vehicles);
            for pair in slots.windows(2) {
                prop_assert!(((pair[1] - pair[0]).norm() - 20.0).abs() < 1e-9);
            }
            for slot in slots {
                prop_assert!((airspace.nearest_inside(&slot) - slot).norm() < 1e-9, "{slot}");
            }
        }
    }
}
