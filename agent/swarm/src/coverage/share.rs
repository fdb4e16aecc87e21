//! Sharing ways fairly.

use nalgebra::Vector2;

/// A way that takes all vehicles equally long is cut into pieces of equal time, `leg_s` being that of a leg
/// of some length in metres.
pub fn cut_evenly(way: &[Vector2<f64>], pieces: usize, leg_s: &dyn Fn(f64) -> f64) -> Vec<Vec<Vector2<f64>>> {
    let takes_s = |leg: &[Vector2<f64>]| leg_s((leg[1] - leg[0]).norm());
    let piece_s = way.windows(2).map(takes_s).sum::<f64>() / pieces as f64;
    let mut routes: Vec<Vec<_>> = vec![Vec::new(); pieces];
    let Some(start) = way.first() else { return routes };
    routes[0].push(*start);
    let (mut piece, mut flown_s) = (0, 0.0);
    for leg in way.windows(2) {
        let whole_s = takes_s(leg);
        while piece + 1 < pieces && (piece + 1) as f64 * piece_s <= flown_s + whole_s {
            let share = if whole_s > 0.0 { ((piece + 1) as f64 * piece_s - flown_s) / whole_s } else { 0.0 };
            let cut = leg[0] + (leg[1] - leg[0]) * share;
            routes[piece].push(cut);
            piece += 1;
            routes[piece].push(cut);
        }
        routes[piece].push(leg[1]);
        flown_s += whole_s;
    }
    for route in &mut routes {
        route.dedup();
    }
    routes
}

/// The number of vehicles for each of some ways that take so long, one at least: so that the one that takes
/// longest for each of its vehicles gets the next.
pub fn vehicles_for(ways_s: &[f64], vehicles: usize) -> Vec<usize> {
    let mut counts = vec![1; ways_s.len()];
    for _ in ways_s.len()..vehicles {
        let each_s = |way: &usize| ways_s[*way] / counts[*way] as f64;
        let longest = (0..ways_s.len()).max_by(|one, other| each_s(one).total_cmp(&each_s(other)));
        if let Some(way) = longest {
            counts[way] += 1;
        }
    }
    counts
}
