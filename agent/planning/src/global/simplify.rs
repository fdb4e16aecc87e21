//! Fewer waypoints for the same way.

use nalgebra::Vector3;

use crate::map::ClearanceMap;
use crate::path::Path;

/// Sine of the angle below which two legs count as one line.
const COLLINEAR_SIN: f64 = 1e-6;

/// Of collinear waypoints keeps the ends only (Zhang 2019, elision).
#[must_use]
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
/// that it replaces has, if that is less: the way out of a tight place is not made tighter.
#[must_use]
pub fn simplify(map: &ClearanceMap, path: &Path, clearance_m: f64) -> Path {
    let path = elide_collinear(path);
    let points = path.points();
    let wanted = map.required(clearance_m);
    let mut kept: Vec<Vector3<f64>> = points.first().copied().into_iter().collect();
    let mut anchor = 0;
    while anchor + 1 < points.len() {
        let from = points[anchor];
        let mut reached = anchor + 1;
        let mut floor = wanted.min(map.segment_clearance(&from, &points[reached]));
        for candidate in anchor + 2..points.len() {
            floor = floor.min(map.segment_clearance(&points[candidate - 1], &points[candidate]));
            if map.segment_clearance(&from, &points[candidate]) >= floor {
                reached = candidate;
            }
        }
        kept.push(points[reached]);
        anchor = reached;
    }
    Path::new(kept).unwrap_or(path)
}
