//! Where other vehicles are while one flies its route.

use nalgebra::Vector3;

/// Parts into which flights are cut to compare vehicles at equal times.
pub const PARTS: usize = 32;

/// Where a vehicle is at the `PARTS + 1` cuts of its flight.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track {
    cuts: [Vector3<f64>; PARTS + 1],
    lower: Vector3<f64>,
    upper: Vector3<f64>,
}

/// The routes of vehicles that set out and arrive together, each at a constant speed of its own: at any moment all have
/// flown the same share of their routes.
///
/// Between the cuts vehicles are taken to move straight, so that their least distance there is known exactly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traffic {
    tracks: Vec<Track>,
}

impl Traffic {
    /// Adds a vehicle that flies along these points (ENU, metres).
    pub fn add(&mut self, route: &[Vector3<f64>]) {
        self.tracks.push(Track::along(route));
    }

    /// How many vehicles there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tracks.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tracks.is_empty()
    }

    /// Least distance from any of the vehicles while flying along these points with them, metres; infinite without any.
    #[must_use]
    pub fn separation_m(&self, route: &[Vector3<f64>]) -> f64 {
        let mut least = f64::INFINITY;
        self.encounters(&Track::along(route), f64::INFINITY, |distance_m| least = least.min(distance_m));
        least
    }

    /// Tells, for every part of the flight and every vehicle that comes nearer than `reach_m` in it, the least distance in
    /// that part, metres.
    pub(super) fn encounters(&self, own: &Track, reach_m: f64, mut tell: impl FnMut(f64)) {
        for other in self.tracks.iter().filter(|other| own.is_near(other, reach_m)) {
            let mut before = Vector3::zeros();
            for (part, (theirs, ours)) in other.cuts.iter().zip(&own.cuts).enumerate() {
                let offset = theirs - ours;
                if part > 0 && !is_beyond(&before, &offset, reach_m) {
                    let distance_m = distance_from_origin(&before, &offset);
                    if distance_m < reach_m {
                        tell(distance_m);
                    }
                }
                before = offset;
            }
        }
    }
}

impl Track {
    /// The points at equal shares of a route's length; all at its start if it has no length.
    pub(super) fn along(route: &[Vector3<f64>]) -> Track {
        let start = route.first().copied().unwrap_or_default();
        let mut cuts = [route.last().copied().unwrap_or_default(); PARTS + 1];
        let length_m: f64 = route.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        let step_m = length_m / PARTS as f64;
        let (mut next, mut flown_m) = (1, 0.0);
        cuts[0] = start;
        for leg in route.windows(2) {
            let way = leg[1] - leg[0];
            let leg_m = way.norm();
            while next < PARTS && (next as f64) * step_m < flown_m + leg_m {
                cuts[next] = leg[0] + way * ((next as f64 * step_m - flown_m) / leg_m);
                next += 1;
            }
            flown_m += leg_m;
        }
        let (lower, upper) =
            cuts.iter().fold((start, start), |(lower, upper), at| (lower.inf(at), upper.sup(at)));
        Track { cuts, lower, upper }
    }

    fn is_near(&self, other: &Track, reach_m: f64) -> bool {
        (0..3).all(|axis| {
            self.lower[axis] - other.upper[axis] < reach_m && other.lower[axis] - self.upper[axis] < reach_m
        })
    }
}

/// Whether a segment is beyond `reach_m` from the origin along an axis.
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
