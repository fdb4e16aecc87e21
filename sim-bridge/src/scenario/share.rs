//! One mission for several vehicles: all fly its waypoints in trail, and each a piece of its surveys and
//! scans.

use crate::mission::{Mission, Waypoint};

/// A piece ends at a waypoint that is no further from its fair end than this share of it.
const NEAR_SHARE: f64 = 0.1;

/// The mission of each vehicle; together they fly every line once.
pub fn shared(mission: &Mission, vehicles: usize) -> Vec<Mission> {
    let mut own = vec![Mission { waypoints: Vec::new(), ..mission.clone() }; vehicles];
    for run in mission.waypoints.chunk_by(|one, next| one.scan == next.scan) {
        let is_scan = run.first().is_some_and(|first| first.scan.is_some());
        let pieces = if is_scan { pieces(run, vehicles) } else { vec![run.to_vec(); vehicles] };
        for (mission, piece) in own.iter_mut().zip(pieces) {
            mission.waypoints.extend(piece);
        }
    }
    own
}

/// Cuts lines into pieces of about the same length, each of which begins where the one before it ends.
fn pieces(run: &[Waypoint], count: usize) -> Vec<Vec<Waypoint>> {
    let length_m: f64 = run.windows(2).map(|leg| leg_m(&leg[0], &leg[1])).sum();
    let fair_m = length_m / count as f64;
    let mut pieces = Vec::new();
    let mut piece: Vec<Waypoint> = run.first().cloned().into_iter().collect();
    let (mut before_m, mut cut_m) = (0.0, fair_m);
    for leg in run.windows(2) {
        let to = &leg[1];
        let end_m = before_m + leg_m(&leg[0], to);
        while pieces.len() + 1 < count && cut_m < end_m - NEAR_SHARE * fair_m {
            // A cut that was almost at the beginning of this leg was made there.
            let share = ((cut_m - before_m) / (end_m - before_m)).max(0.0);
            let there =
                Waypoint { position: leg[0].position.lerp(&to.position, share), hold_s: 0.0, ..to.clone() };
            let from = Waypoint { payload: Vec::new(), ..there.clone() };
            piece.push(there);
            pieces.push(std::mem::replace(&mut piece, vec![from]));
            cut_m += fair_m;
        }
        piece.push(to.clone());
        if pieces.len() + 1 < count && cut_m <= end_m + NEAR_SHARE * fair_m {
            let here = Waypoint { payload: Vec::new(), hold_s: 0.0, ..to.clone() };
            pieces.push(std::mem::replace(&mut piece, vec![here]));
            cut_m += fair_m;
        }
        before_m = end_m;
    }
    pieces.push(piece);
    // A scan of a single place is for all.
    let first = run.first().cloned();
    pieces.resize(count, first.into_iter().collect());
    pieces
}

fn leg_m(from: &Waypoint, to: &Waypoint) -> f64 {
    (to.position - from.position).norm()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn at(x: f64, y: f64, scan: Option<usize>) -> Waypoint {
        Waypoint { position: Vector3::new(x, y, 5.0), scan, ..Waypoint::default() }
    }

    fn flown_m(waypoints: &[Waypoint]) -> f64 {
        waypoints.windows(2).map(|leg| leg_m(&leg[0], &leg[1])).sum()
    }

    /// Lines of 40 m, 10 m apart, there and back.
    fn field(lines: u32) -> Vec<Waypoint> {
        (0..lines)
            .flat_map(|line| {
                let (y, there) = (f64::from(line) * 10.0, f64::from(line % 2) * 40.0);
                [at(there, y, Some(1)), at(40.0 - there, y, Some(1))]
            })
            .collect()
    }

    #[test]
    fn pieces_are_of_one_length_and_leave_nothing_out() {
        for (lines, vehicles) in [(5, 2), (4, 3), (7, 4), (1, 3), (3, 1)] {
            let whole = field(lines);
            let pieces = pieces(&whole, vehicles);
            assert_eq!(pieces.len(), vehicles);
            let fair_m = flown_m(&whole) / vehicles as f64;
            for piece in &pieces {
                assert!(
                    (flown_m(piece) - fair_m).abs() < 0.21 * fair_m,
                    "{lines} {vehicles}: {}",
                    flown_m(piece)
                );
            }
            let sum: f64 = pieces.iter().map(|piece| flown_m(piece)).sum();
            assert!((sum - flown_m(&whole)).abs() < 1e-9);
            for (one, next) in pieces.iter().zip(pieces.iter().skip(1)) {
                assert_eq!(one.last().map(|w| w.position), next.first().map(|w| w.position));
            }
        }
    }

    #[test]
    fn plain_waypoints_are_flown_by_all_and_a_scan_of_one_place_too() {
        let mut waypoints = vec![at(-10.0, 0.0, None)];
        waypoints.extend(field(2));
        waypoints.push(at(0.0, -9.0, Some(2)));
        let mission = Mission { waypoints, ..Mission::default() };
        let own = shared(&mission, 2);
        for mission in &own {
            assert_eq!(mission.waypoints.first(), Some(&at(-10.0, 0.0, None)));
            assert_eq!(mission.waypoints.last().map(|w| w.position.y), Some(-9.0));
        }
        assert_eq!(own[0].waypoints[3].position, own[1].waypoints[1].position);
    }
}
