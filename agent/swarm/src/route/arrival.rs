//! Arriving at the same time, next to one another.

use nalgebra::Vector3;

use skein_planning::airspace::Airspace;

/// The pace of vehicles that arrive together.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    /// Arrival of the last one, seconds after all set out.
    pub time_s: f64,
    /// Factor by which each is slower than at cruise: 1 is cruise, 2 half as fast.
    pub slowed: Vec<f64>,
    /// Time from the first arrival to the last, seconds.
    pub spread_s: f64,
}

/// Lets vehicles arrive together as soon as possible. `times_s` has what each route takes at cruise
/// ([`super::Assessment::time_s`]).
///
/// The last one flies at cruise. The others fly as much slower as their routes take less time, but at most `slowest`
/// times slower: who would have to arrives early, and the spread says by how much.
pub fn arrive_together(times_s: &[f64], slowest: f64) -> Arrival {
    let time_s = times_s.iter().copied().fold(0.0, f64::max);
    let slow = |own_s: &f64| if *own_s > 0.0 { (time_s / own_s).min(slowest) } else { slowest };
    let slowed: Vec<f64> = times_s.iter().map(slow).collect();
    let first_s = times_s.iter().zip(&slowed).map(|(own_s, slowed)| own_s * slowed).fold(time_s, f64::min);
    Arrival { time_s, slowed, spread_s: time_s - first_s }
}

/// Places around a target for so many vehicles to arrive at, in a line across the way to it, `spacing_m` apart. The
/// line is moved into the airspace where the target is at its edge.
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

    #[test]
    fn the_last_flies_at_cruise_and_nobody_slower_than_allowed() {
        let arrival = arrive_together(&[100.0, 80.0], 2.0);
        assert_eq!(arrival, Arrival { time_s: 100.0, slowed: vec![1.0, 1.25], spread_s: 0.0 });
        let arrival = arrive_together(&[100.0, 80.0, 40.0], 2.0);
        assert_eq!((arrival.slowed[2], arrival.spread_s), (2.0, 20.0));
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
