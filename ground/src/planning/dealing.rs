//! Targets dealt out to vehicles.

use nalgebra::Vector3;
use skein_planning::airspace::Airspace;
use skein_swarm::assignment::assign;
use skein_swarm::dealing::deal;
use skein_swarm::route::{RouteCost, arrival_slots};

/// A target, by number, and the place near it at which a vehicle arrives.
pub(super) type Stop = (usize, Vector3<f64>);

/// Where each vehicle arrives one after another: those that share a target beside one another, `spacing_m` apart. Every
/// target is visited, and so that the straight ways, with what they cost in zones, are cheapest together.
pub(super) fn stops(
    starts: &[(Vector3<f64>, RouteCost)],
    targets: &[Vector3<f64>],
    one_to_each: bool,
    spacing_m: f64,
    airspace: &Airspace,
) -> Option<Vec<Vec<Stop>>> {
    let direct = |who: usize, from: &Vector3<f64>, to: &Vector3<f64>| {
        starts[who].1.assess(&[*from, *to], airspace, &Default::default()).cost_m
    };
    let places: Vec<_> = starts.iter().map(|(start, _)| *start).collect();
    if one_to_each || starts.len() <= targets.len() {
        let dealt = deal(&places, targets, direct)?;
        let stops =
            |numbers: Vec<usize>| numbers.into_iter().map(|number| (number, targets[number])).collect();
        return Some(dealt.into_iter().map(stops).collect());
    }
    let shared = shared(&places, targets, direct)?;
    let mut stops = vec![Vec::new(); starts.len()];
    for (number, target) in targets.iter().enumerate() {
        let there: Vec<usize> = (0..starts.len()).filter(|who| shared[*who] == number).collect();
        let middle = there.iter().map(|who| places[*who]).sum::<Vector3<f64>>() / there.len().max(1) as f64;
        let slots = arrival_slots(target, &middle, there.len(), spacing_m, airspace);
        let costs: Vec<Vec<f64>> = there
            .iter()
            .map(|who| slots.iter().map(|slot| direct(*who, &places[*who], slot)).collect())
            .collect();
        for (who, slot) in there.iter().zip(assign(&costs)?) {
            stops[*who].push((number, slots[slot]));
        }
    }
    Some(stops)
}

/// The target of each vehicle, where there are more vehicles: each is visited, and none by many more than another.
fn shared(
    places: &[Vector3<f64>],
    targets: &[Vector3<f64>],
    direct: impl Fn(usize, &Vector3<f64>, &Vector3<f64>) -> f64,
) -> Option<Vec<usize>> {
    let at_each = places.len().div_ceil(targets.len());
    let costs: Vec<Vec<f64>> = (0..places.len())
        .map(|who| targets.iter().map(|target| direct(who, &places[who], target)).collect())
        .collect();
    // The first place at each target is worth more than all ways cost: so each is taken.
    let worth = costs.iter().flatten().copied().fold(0.0, f64::max) * places.len() as f64;
    let with_shares: Vec<Vec<f64>> = costs
        .iter()
        .map(|row| {
            let first = row.iter().map(|cost| cost - worth);
            first.chain((1..at_each).flat_map(|_| row.iter().copied())).collect()
        })
        .collect();
    Some(assign(&with_shares)?.into_iter().map(|column| column % targets.len()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stops_of(starts: &[[f64; 3]], targets: &[[f64; 3]]) -> Vec<Vec<usize>> {
        let airspace = Airspace { upper: Vector3::new(100.0, 100.0, 50.0), ..Airspace::default() };
        let starts: Vec<_> = starts.iter().map(|at| (Vector3::from(*at), RouteCost::default())).collect();
        let targets: Vec<_> = targets.iter().map(|at| Vector3::from(*at)).collect();
        let stops = stops(&starts, &targets, false, 5.0, &airspace).unwrap();
        stops.into_iter().map(|stops| stops.into_iter().map(|(number, _)| number).collect()).collect()
    }

    #[test]
    fn every_target_is_visited_though_most_vehicles_are_near_one() {
        let starts = [[1.0, 1.0, 9.0], [2.0, 1.0, 9.0], [3.0, 1.0, 9.0]];
        assert_eq!(stops_of(&starts, &[[1.0, 5.0, 9.0], [90.0, 90.0, 9.0]]), [vec![0], vec![0], vec![1]]);
        assert_eq!(stops_of(&starts[..1], &[[90.0, 90.0, 9.0], [1.0, 5.0, 9.0]]), [vec![1, 0]]);
    }

    #[test]
    fn those_who_share_a_target_arrive_beside_one_another() {
        let airspace = Airspace { upper: Vector3::new(100.0, 100.0, 50.0), ..Airspace::default() };
        let starts = [40.0, 60.0].map(|y| (Vector3::new(0.0, y, 9.0), RouteCost::default()));
        let stops = stops(&starts, &[Vector3::new(50.0, 50.0, 9.0)], false, 5.0, &airspace).unwrap();
        let places: Vec<_> = stops.iter().map(|stops| stops[0].1.y).collect();
        assert_eq!(places, [47.5, 52.5], "nobody crosses the other's way");
    }
}
