//! The other vehicles while one flies its route.

use nalgebra::Vector3;

use super::weights::RouteCost;

/// Parts into which flights are cut to compare vehicles at equal times.
pub const PARTS: usize = 32;

/// Parts of a flight that are looked at together: where these are far from one another, their parts are.
const STRETCH: usize = 8;

/// The places of a vehicle at the `PARTS + 1` cuts of its flight.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track {
    cuts: [Vector3<f64>; PARTS + 1],
    stretches: [Extent; PARTS / STRETCH],
}

/// The box around a stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extent {
    lower: Vector3<f64>,
    upper: Vector3<f64>,
}

/// The routes of vehicles that set out and arrive together ([`super::arrive_together`]): at any moment all have spent
/// the same share of the time that their routes take.
///
/// Between the cuts vehicles are taken to move straight, so that their least distance there is known exactly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traffic {
    tracks: Vec<Track>,
}

impl Traffic {
    /// Adds a vehicle that flies along these points (ENU, metres).
    pub fn add(&mut self, route: &[Vector3<f64>], cost: &RouteCost) {
        self.tracks.push(Track::along(route, cost));
    }

    /// Least distance from any of the vehicles while flying along these points with them, metres; infinite without any.
    pub fn separation_m(&self, route: &[Vector3<f64>], cost: &RouteCost) -> f64 {
        let mut least = f64::INFINITY;
        self.encounters(&Track::along(route, cost), f64::INFINITY, |distance_m| {
            least = least.min(distance_m)
        });
        least
    }

    /// Tells, for every part of the flight and every vehicle that comes nearer than `reach_m` in it, the least
    /// distance in that part, metres.
    pub(super) fn encounters(&self, own: &Track, reach_m: f64, mut tell: impl FnMut(f64)) {
        for other in &self.tracks {
            for stretch in 0..own.stretches.len() {
                if !own.stretches[stretch].is_near(&other.stretches[stretch], reach_m) {
                    continue;
                }
                for part in stretch * STRETCH..(stretch + 1) * STRETCH {
                    let before = other.cuts[part] - own.cuts[part];
                    let after = other.cuts[part + 1] - own.cuts[part + 1];
                    if is_beyond(&before, &after, reach_m) {
                        continue;
                    }
                    let distance_m = distance_from_origin(&before, &after);
                    if distance_m < reach_m {
                        tell(distance_m);
                    }
                }
            }
        }
    }
}

impl Track {
    /// The places along a route at equal times; always its start if that takes no time.
    pub(super) fn along(route: &[Vector3<f64>], cost: &RouteCost) -> Track {
        let time_s: f64 = route.windows(2).map(|leg| cost.leg_s(&(leg[1] - leg[0]))).sum();
        let step_s = time_s / PARTS as f64;
        let mut cuts = [route.last().copied().unwrap_or_default(); PARTS + 1];
        cuts[0] = route.first().copied().unwrap_or_default();
        let (mut next, mut flown_s) = (1, 0.0);
        for leg in route.windows(2) {
            let way = leg[1] - leg[0];
            let leg_s = cost.leg_s(&way);
            let velocity = if leg_s > 0.0 { way / leg_s } else { way };
            while next < PARTS && next as f64 * step_s < flown_s + leg_s {
                cuts[next] = leg[0] + velocity * (next as f64 * step_s - flown_s);
                next += 1;
            }
            flown_s += leg_s;
        }
        let stretches = std::array::from_fn(|k| Extent::of(&cuts[k * STRETCH..=(k + 1) * STRETCH]));
        Track { cuts, stretches }
    }
}

impl Extent {
    fn of(points: &[Vector3<f64>]) -> Extent {
        let nothing = Vector3::repeat(f64::INFINITY);
        let (lower, upper) =
            points.iter().fold((nothing, -nothing), |(lower, upper), at| (lower.inf(at), upper.sup(at)));
        Extent { lower, upper }
    }

    fn is_near(&self, other: &Extent, reach_m: f64) -> bool {
        (0..3).all(|axis| {
            self.lower[axis] - other.upper[axis] < reach_m && other.lower[axis] - self.upper[axis] < reach_m
        })
    }
}

/// A segment is beyond `reach_m` from the origin along an axis.
fn is_beyond(from: &Vector3<f64>, to: &Vector3<f64>, reach_m: f64) -> bool {
    (0..3).any(|axis| from[axis].min(to[axis]) > reach_m || from[axis].max(to[axis]) < -reach_m)
}

/// Least distance of a segment from the origin.
fn distance_from_origin(from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let way = to - from;
    let squared = way.norm_squared();
    let share = if squared > 0.0 { (-from.dot(&way) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (from + way * share).norm()
}
