//! Narrow passages ahead: places that two vehicles cannot pass at once.

use nalgebra::Vector3;

use crate::map::ClearanceMap;
use crate::path::Path;

/// The definition of a narrow passage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassageConfig {
    /// The distance to look ahead on the path, metres.
    pub look_m: f64,
    /// Free width below which a passage is narrow, metres.
    pub width_m: f64,
}

impl Default for PassageConfig {
    fn default() -> Self {
        PassageConfig { look_m: 8.0, width_m: 2.4 }
    }
}

/// A gap between two obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Middle of the gap (ENU, metres), at the path's height.
    pub centre: Vector3<f64>,
    /// Horizontal unit vector through the gap, the way the path goes.
    pub direction: Vector3<f64>,
    /// Free width between the obstacles, metres.
    pub width_m: f64,
    /// Where on the path it is, metres from the station asked from.
    pub distance_m: f64,
}

/// The first narrow passage on `path` within `look_m` of `from_m`.
///
/// A passage is a place where the path runs between two obstacles less than `width_m` apart. The gap is
/// looked at itself, by going to the middle between the obstacle points nearest on either side, so that it
/// does not depend on how the path runs through it: vehicles that come from both sides mean the same passage.
/// Of a gap with depth, as an opening in a wall, it is the middle of the part that is narrowest and known.
/// One obstacle beside the path is no passage.
///
/// A vehicle that is inside the passage, or has its middle just behind it, is told of it with distance 0.
pub fn first_passage(
    map: &ClearanceMap,
    path: &Path,
    from_m: f64,
    config: &PassageConfig,
) -> Option<Passage> {
    let step_m = map.voxels().config().resolution_m;
    let gaps = |from_m: f64, look_m: f64| {
        let end_m = (from_m + look_m).min(path.length_m());
        let samples = ((end_m - from_m) / step_m).floor().max(0.0) as usize;
        (0..=samples)
            .map(move |k| from_m + k as f64 * step_m)
            .filter_map(|station_m| Some((station_m, gap_at(map, path, station_m, config.width_m)?)))
    };
    let (first_m, _) = gaps(from_m, config.look_m).next()?;
    let here: Vec<_> = gaps(first_m, config.width_m).collect();
    let least = here.iter().map(|(_, gap)| gap.width_m()).min_by(f64::total_cmp)?;
    let narrow: Vec<_> = here.iter().filter(|(_, gap)| gap.width_m() <= least + step_m / 2.0).collect();
    let (station_m, gap) = *narrow.get(narrow.len() / 2)?;
    let centre = narrow.iter().map(|(_, gap)| gap.centre()).sum::<Vector3<f64>>() / narrow.len() as f64;
    Some(passage(path, from_m, *station_m, gap, centre))
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

fn passage(path: &Path, from_m: f64, station_m: f64, gap: &Gap, centre: Vector3<f64>) -> Passage {
    let across = gap.left - gap.right;
    let ahead = path.direction_at(station_m);
    let through = Vector3::new(across.y, -across.x, 0.0).try_normalize(1e-6).unwrap_or(ahead);
    let width_m = gap.width_m();
    let on_path = path.project_within(&centre, station_m - width_m, station_m + width_m);
    Passage {
        centre,
        direction: if through.dot(&ahead) < 0.0 { -through } else { through },
        width_m,
        distance_m: (on_path.station_m - from_m).max(0.0),
    }
}
