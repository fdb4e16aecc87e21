//! Fewer waypoints for the same way.

use nalgebra::Vector3;

use super::Potential;
use super::astar::Disc;
use crate::map::ClearanceMap;
use crate::path::Path;

/// Sine of the angle below which two legs count as one line.
const COLLINEAR_SIN: f64 = 1e-6;

/// Costs that differ by less are the same, metres.
const LEAST_GAIN_M: f64 = 1e-6;

/// Of collinear waypoints keeps the ends only (Zhang 2019, elision).
pub fn elide_collinear(path: &Path) -> Path {
    let mut kept: Vec<Vector3<f64>> = Vec::new();
    for point in path.points() {
        if let [.., before, last] = kept.as_slice() {
            let (came, goes) = (last - before, point - last);
            let straight = came.cross(&goes).norm() <= COLLINEAR_SIN * came.norm() * goes.norm();
            if straight && came.dot(&goes) > 0.0 {
                kept.pop();
            }
        }
        kept.push(*point);
    }
    Path::new(kept).unwrap_or_else(|| path.clone())
}

/// Straightens a path: from each waypoint kept, goes straight to the furthest one in sight.
///
/// In sight means that all voxels of the straight line have `clearance_m`, or as much as the part of the path
/// that it replaces has, if that is less: the way out of a tight place is not made tighter. Nor does a straight line
/// lead further through places that are closed ([`ClearanceMap::keep_out`]) than what it replaces.
pub fn simplify(map: &ClearanceMap, path: &Path, clearance_m: f64) -> Path {
    simplify_around(map, path, clearance_m, &[], &Potential::default())
}

/// As [`simplify`], leads no deeper into a disc than the path does, and costs no more: a way that was made longer for a
/// potential stays so.
pub fn simplify_around(
    map: &ClearanceMap,
    path: &Path,
    clearance_m: f64,
    discs: &[Disc],
    potential: &Potential,
) -> Path {
    let path = elide_collinear(path);
    let points = path.points();
    let wanted = map.required(clearance_m);
    let mut kept: Vec<Vector3<f64>> = points.first().copied().into_iter().collect();
    let mut anchor = 0;
    while anchor + 1 < points.len() {
        let from = points[anchor];
        let mut reached = anchor + 1;
        let mut floor = wanted.min(map.segment_clearance(&from, &points[reached]));
        let mut inside_m = map.inside_m(&from, &points[reached]);
        let mut cost = potential.along(&from, &points[reached]);
        let mut depths: Vec<f64> = discs.iter().map(|disc| depth_m(disc, &from, &points[reached])).collect();
        for candidate in anchor + 2..points.len() {
            let (before, to) = (&points[candidate - 1], &points[candidate]);
            floor = floor.min(map.segment_clearance(before, to));
            inside_m += map.inside_m(before, to);
            cost += potential.along(before, to);
            for (depth, disc) in depths.iter_mut().zip(discs) {
                *depth = depth.max(depth_m(disc, before, to));
            }
            let is_no_deeper = |(depth, disc): (&f64, &Disc)| depth_m(disc, &from, to) <= *depth;
            if depths.iter().zip(discs).all(is_no_deeper)
                && map.segment_clearance(&from, to) >= floor
                && map.inside_m(&from, to) <= inside_m
                && potential.along(&from, to) <= cost + LEAST_GAIN_M
            {
                reached = candidate;
            }
        }
        kept.push(points[reached]);
        anchor = reached;
    }
    Path::new(kept).unwrap_or(path)
}

/// The greatest depth in a disc along a straight line, metres; 0 outside.
fn depth_m(disc: &Disc, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let (offset, leg) = ((disc.centre - from).xy(), (to - from).xy());
    let along = offset.dot(&leg) / leg.norm_squared();
    let nearest = if along.is_finite() { leg * along.clamp(0.0, 1.0) } else { leg };
    (disc.radius_m - (offset - nearest).norm()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::{PotentialConfig, PotentialObstacle};
    use crate::map::VoxelMapConfig;

    #[test]
    fn a_way_around_a_disc_is_not_straightened_through_it() {
        let map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
        let around = [[-4.0, 0.0], [-3.0, 2.0], [-1.0, 3.0], [1.0, 3.0], [3.0, 2.0], [4.0, 0.0]];
        let path = Path::new(around.map(|[x, y]| Vector3::new(x, y, 3.0)).to_vec()).unwrap();
        assert_eq!(simplify(&map, &path, 0.5).points().len(), 2, "nothing is in the way");
        let disc = Disc { centre: Vector3::new(0.0, 0.0, 3.0), radius_m: 2.5 };
        let kept = simplify_around(&map, &path, 0.5, &[disc], &Potential::default());
        let deepest = |path: &Path| {
            path.points().windows(2).map(|leg| depth_m(&disc, &leg[0], &leg[1])).fold(0.0, f64::max)
        };
        assert!(deepest(&kept) <= deepest(&path), "{kept:?}");
        assert!(kept.points().len() > 2);
    }

    #[test]
    fn a_way_around_what_repels_is_not_straightened_past_it() {
        let map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
        let around = [[-4.0, 0.0], [-2.0, 1.5], [2.0, 1.5], [4.0, 0.0]];
        let path = Path::new(around.map(|[x, y]| Vector3::new(x, y, 3.0)).to_vec()).unwrap();
        let repels = PotentialObstacle { centre: Vector3::new(0.0, 0.0, 3.0), influence_m: 2.0 };
        let config = PotentialConfig::default();
        let potential =
            Potential::felt(path.points().first().unwrap(), &Vector3::x(), &[repels], &map, &config);
        assert_eq!(simplify_around(&map, &path, 0.5, &[], &potential).points().len(), 4);
        assert_eq!(simplify_around(&map, &path, 0.5, &[], &Potential::default()).points().len(), 2);
    }
}
