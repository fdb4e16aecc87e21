//! Narrow stretches of a path: places that two vehicles cannot pass at once.

use nalgebra::Vector3;

use crate::map::{ClearanceMap, VoxelState};
use crate::path::Path;

/// The definition of a narrow stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassageConfig {
    /// The distance to look ahead on the path for its beginning, metres.
    pub look_m: f64,
    /// Free width below which a place is narrow, metres.
    pub width_m: f64,
    /// A wide part of the path that is shorter than this is no place to let anybody pass, metres.
    pub room_m: f64,
    /// A stretch is looked along no further than this, metres.
    pub most_m: f64,
}

impl Default for PassageConfig {
    fn default() -> Self {
        PassageConfig { look_m: 8.0, width_m: 2.4, room_m: 3.0, most_m: 24.0 }
    }
}

/// A place in a narrow stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Middle between the obstacles on either side (ENU, metres), at the path's height.
    pub centre: Vector3<f64>,
    /// Horizontal unit vector through the gap, the way the path goes.
    pub direction: Vector3<f64>,
}

/// From one piece of a stretch to the next, metres.
pub const PIECE_M: f64 = 1.0;
/// A gap is looked for at every so many metres of the path.
const SAMPLE_M: f64 = 0.4;
/// The stretch begins so far before what is narrow and ends so far behind it, metres.
const MARGIN_M: f64 = 1.0;

/// The first narrow stretch on `path` that begins within `look_m` of `from_m`, piece by piece in the order in which they
/// are flown through; nothing if there is none.
///
/// A place is narrow where the path runs between two obstacles less than `width_m` apart. The gap is
/// looked at itself, by going to the middle between the obstacle points nearest on either side, so that it
/// does not depend on how the path runs through it: vehicles that come from both sides mean the same place.
/// One obstacle beside the path makes nothing narrow. Where the path leads out of what the vehicle has seen, nothing is
/// known to be narrow.
pub fn narrow_stretch(map: &ClearanceMap, path: &Path, from_m: f64, config: &PassageConfig) -> Vec<Piece> {
    let gaps = narrow_samples(map, path, from_m, config);
    let (Some(first), Some(last)) = (gaps.first(), gaps.last()) else { return Vec::new() };
    let before = Piece { centre: first.centre - first.direction * MARGIN_M, ..*first };
    let behind = Piece { centre: last.centre + last.direction * MARGIN_M, ..*last };
    let through: Vec<Piece> = std::iter::once(before).chain(gaps.iter().copied()).chain([behind]).collect();
    evenly(&through)
}

/// Places along a line through others, no further than [`PIECE_M`] apart, each flown through like the nearest of these.
fn evenly(through: &[Piece]) -> Vec<Piece> {
    let Some(line) = Path::new(through.iter().map(|piece| piece.centre).collect()) else { return Vec::new() };
    let steps = (line.length_m() / PIECE_M).ceil().max(1.0);
    let nearest = |place: &Vector3<f64>| {
        let far_m = |piece: &&Piece| (piece.centre - place).norm();
        through.iter().min_by(|a, b| far_m(a).total_cmp(&far_m(b)))
    };
    let place = |k: usize| line.point_at(line.length_m() * k as f64 / steps);
    let piece = |centre: Vector3<f64>| nearest(&centre).map(|nearest| Piece { centre, ..*nearest });
    (0..=steps as usize).filter_map(|k| piece(place(k))).collect()
}

/// The gaps of the first stretch, in the order in which they are flown through.
fn narrow_samples(map: &ClearanceMap, path: &Path, from_m: f64, config: &PassageConfig) -> Vec<Piece> {
    let mut found = Vec::new();
    let (mut station_m, mut ends_m) = (from_m, from_m + config.look_m);
    let mut most_m = f64::INFINITY;
    let mut was_seen = false;
    while station_m <= path.length_m().min(ends_m).min(most_m) {
        let place = path.point_at(station_m);
        let is_seen = map.voxels().state(&place) != VoxelState::Unknown;
        if was_seen && !is_seen {
            break;
        }
        was_seen = is_seen;
        if let Some(gap) = gap_at(map, path, station_m, config.width_m) {
            if found.is_empty() {
                most_m = station_m + config.most_m;
            }
            ends_m = station_m + config.room_m;
            found.extend(gap.piece(&path.direction_at(station_m)));
        }
        station_m += SAMPLE_M;
    }
    found
}

/// Whether a path is less than `width_m` wide within `around_m` of a station.
pub fn is_narrow_around(
    map: &ClearanceMap,
    path: &Path,
    station_m: f64,
    around_m: f64,
    width_m: f64,
) -> bool {
    let samples = (around_m / SAMPLE_M).ceil() as i32;
    let station = |k: i32| station_m + f64::from(k) * SAMPLE_M;
    let mut stations =
        (-samples..=samples).map(station).filter(|at_m| (0.0..=path.length_m()).contains(at_m));
    stations.any(|at_m| gap_at(map, path, at_m, width_m).is_some())
}

/// The obstacle points on the left and on the right that close a gap.
#[derive(Clone, Copy)]
struct Gap {
    left: Vector3<f64>,
    right: Vector3<f64>,
}

impl Gap {
    fn width_m(&self) -> f64 {
        (self.left - self.right).norm()
    }

    fn centre(&self) -> Vector3<f64> {
        (self.left + self.right) / 2.0
    }

    /// The way through it, as a path goes that leads `ahead`.
    fn piece(&self, ahead: &Vector3<f64>) -> Option<Piece> {
        let across = self.left - self.right;
        let through = Vector3::new(across.y, -across.x, 0.0).try_normalize(1e-6)?;
        let direction = if through.dot(ahead) < 0.0 { -through } else { through };
        Some(Piece { centre: self.centre(), direction })
    }
}

/// The gap less than `width_m` wide that the path runs through at a station.
fn gap_at(map: &ClearanceMap, path: &Path, station_m: f64, width_m: f64) -> Option<Gap> {
    let place = path.point_at(station_m);
    // One of the two sides is nearer than half the width.
    if map.clearance(&place) >= width_m / 2.0 {
        return None;
    }
    let ahead = path.direction_at(station_m);
    let left = Vector3::new(-ahead.y, ahead.x, 0.0).try_normalize(1e-6)?;
    let gap = nearest_sides(map, &place, &left, width_m)?;
    (gap.width_m() < width_m).then(|| narrowed(map, gap, width_m))?
}

/// The obstacle points nearest to `place` on its two sides, within `width_m`.
fn nearest_sides(map: &ClearanceMap, place: &Vector3<f64>, left: &Vector3<f64>, width_m: f64) -> Option<Gap> {
    // A side begins this far off straight ahead and behind: sine of 30 degrees.
    const ASIDE: f64 = 0.5;
    let around = map.obstacles_around(place, width_m);
    let nearest = |side: f64| {
        let on_side = around.points().map(|point| point - place);
        let on_side = on_side.filter(|offset| offset.dot(left) * side > ASIDE * offset.norm());
        on_side.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared())).map(|offset| place + offset)
    };
    Some(Gap { left: nearest(1.0)?, right: nearest(-1.0)? })
}

/// The gap where it is narrowest, found by going to the middle a few times over.
fn narrowed(map: &ClearanceMap, mut gap: Gap, width_m: f64) -> Option<Gap> {
    const ROUNDS: usize = 4;
    for _ in 0..ROUNDS {
        let across = (gap.left - gap.right).try_normalize(1e-6)?;
        gap = nearest_sides(map, &gap.centre(), &across, width_m)?;
    }
    (gap.width_m() < width_m).then_some(gap)
}
