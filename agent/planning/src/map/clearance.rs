//! Distance to the nearest obstacle, kept up to date as the map changes.

use std::ops::ControlFlow;
use std::time::Duration;

use nalgebra::Vector3;

use super::voxel::{Change, MapError, RayEnd, VoxelIndex, VoxelMap, VoxelMapConfig};
use super::{Sectors, traverse};
use crate::airspace::KeepOut;
use crate::path::Path;

/// No obstacle within the truncation distance.
const FAR: [i8; 2] = [i8::MIN, i8::MIN];

/// An obstacle near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The obstacle's point nearest to the one asked about, at the same height (ENU, metres).
    pub point: Vector3<f64>,
    /// Horizontal distance to it, metres.
    pub distance_m: f64,
}

/// A [`VoxelMap`] with the distance to the nearest obstacle at every place.
///
/// Clearance is horizontal, within the layer of the place asked about: voxels block the column above and
/// below them ([`VoxelMapConfig::vertical_extent_m`]), so that a layer holds all that a vehicle at this
/// height could touch. This is the distance that matters to an upright, wider than tall vehicle among upright
/// obstacles. It is measured to the occupied voxel's nearest face, exact to the truncation distance and no
/// further.
///
/// Layers that are *tracked* hold a distance field (the offset of each voxel to the nearest occupied one)
/// which changes repair locally; the others are searched when asked. The answers are the same.
///
/// What must not be flown in though nothing stands there is no obstacle: see [`ClearanceMap::keep_out`].
#[derive(Clone, Debug)]
pub struct ClearanceMap {
    voxels: VoxelMap,
    /// Truncation distance in voxels.
    reach: i32,
    /// Offsets within the truncation distance.
    brush: Vec<[i8; 2]>,
    layers: Vec<Option<Layer>>,
    keep_out: Option<KeepOut>,
}

/// Of each voxel of a layer, the offset to the nearest occupied one, or [`FAR`].
#[derive(Clone, Debug, PartialEq)]
struct Layer {
    offsets: Vec<[i8; 2]>,
}

impl ClearanceMap {
    /// An unknown map around `centre` (ENU, metres) whose distances are exact to `truncation_m` (2.5 m is
    /// usual).
    ///
    /// # Errors
    /// As [`VoxelMap::new`]; a truncation that is not positive or more than 100 voxels.
    pub fn new(
        config: VoxelMapConfig,
        centre: Vector3<f64>,
        truncation_m: f64,
    ) -> Result<ClearanceMap, MapError> {
        let voxels = VoxelMap::new(config, centre)?;
        let reach = truncation_m / config.resolution_m;
        if !(truncation_m > 0.0 && reach <= 100.0) {
            return Err(MapError::NotPositive { field: "truncation_m", value: truncation_m });
        }
        // Half a voxel more, because distance counts from the face.
        let reach = (reach + 0.5).ceil() as i32;
        let mut brush = Vec::new();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if dx * dx + dy * dy <= reach * reach {
                    brush.push([dx as i8, dy as i8]);
                }
            }
        }
        let layers = vec![None; voxels.counts()[2]];
        Ok(ClearanceMap { voxels, reach, brush, layers, keep_out: None })
    }

    /// The same map of a world in which some places are known to be closed: searches keep out of them.
    pub fn with_keep_out(self, keep_out: KeepOut) -> ClearanceMap {
        ClearanceMap { keep_out: Some(keep_out), ..self }
    }

    /// From now on these places are known to be closed, in place of those before.
    pub fn set_keep_out(&mut self, keep_out: KeepOut) {
        self.keep_out = Some(keep_out);
    }

    /// Keeps so far out of zones, and so high above terrain, from now on; see [`KeepOut::new`].
    pub fn set_margins(&mut self, margin_m: f64, terrain_clearance_m: f64) {
        if let Some(keep_out) = &mut self.keep_out {
            keep_out.set_margins(margin_m, terrain_clearance_m);
        }
    }

    /// The places that are closed, if any are known.
    pub fn keep_out(&self) -> Option<&KeepOut> {
        self.keep_out.as_ref()
    }

    /// Whether the straight way between two points is open all along.
    pub fn is_open(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        self.inside_m(from, to) == 0.0
    }

    /// The length of the straight way between two points that is closed, metres.
    pub(crate) fn inside_m(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        self.keep_out.as_ref().map_or(0.0, |keep_out| keep_out.inside_m(from, to))
    }

    pub fn voxels(&self) -> &VoxelMap {
        &self.voxels
    }

    /// Distance beyond which clearance is not told apart, metres.
    pub fn truncation_m(&self) -> f64 {
        (f64::from(self.reach) - 0.5) * self.voxels.config().resolution_m
    }

    /// Takes a lidar scan in; see [`VoxelMap::integrate`].
    pub fn integrate(&mut self, origin: Vector3<f64>, ends: &[RayEnd]) {
        let changes = self.voxels.integrate(origin, ends).to_vec();
        self.repair(&changes);
    }

    /// Gives up hits that were not seen again; see [`VoxelMap::fade`].
    pub fn fade(&mut self, now: Duration) {
        let changes = self.voxels.fade(now).to_vec();
        self.repair(&changes);
    }

    /// Marks an obstacle known beforehand; see [`VoxelMap::insert`].
    pub fn insert(&mut self, point: &Vector3<f64>) {
        let changes = self.voxels.insert(point).to_vec();
        self.repair(&changes);
    }

    /// Sets a ball free; see [`VoxelMap::clear_ball`].
    pub fn clear_ball(&mut self, centre: &Vector3<f64>, radius_m: f64) {
        let changes = self.voxels.clear_ball(centre, radius_m).to_vec();
        self.repair(&changes);
    }

    /// Moves the window with the vehicle; see [`VoxelMap::recentre`]. Tracked layers stay tracked.
    pub fn recentre(&mut self, point: &Vector3<f64>) -> bool {
        let moved = self.voxels.recentre(point);
        if moved {
            for z in 0..self.layers.len() {
                if self.layers[z].is_some() {
                    self.layers[z] = Some(Layer::of(&self.voxels, &self.brush, z));
                }
            }
        }
        moved
    }

    /// Tracks the layer at a height (ENU z, metres): answers about it are looked up from now on. Costs about
    /// a millisecond the first time, nothing after. Heights outside the window are ignored.
    pub fn track(&mut self, height_m: f64) {
        let layer = self.voxels.to_local(&Vector3::new(0.0, 0.0, height_m)).z.floor();
        if layer >= 0.0 && layer < self.layers.len() as f64 {
            self.track_layer(layer as usize);
        }
    }

    /// Horizontal distance from `point` to the nearest obstacle in its layer, metres, at most
    /// [`ClearanceMap::truncation_m`]; 0 inside an obstacle. Places outside the window have no known
    /// obstacle.
    pub fn clearance(&self, point: &Vector3<f64>) -> f64 {
        self.nearest(point).map_or(self.truncation_m(), |nearest| nearest.distance_m)
    }

    /// The nearest obstacle in the layer of `point`, if there is one within [`ClearanceMap::truncation_m`].
    pub fn nearest(&self, point: &Vector3<f64>) -> Option<Nearest> {
        let voxel = self.voxels.index_of(point)?;
        let offset = self.offset_at(voxel);
        if offset == FAR {
            return None;
        }
        let nearest = self.face_point(voxel, offset, point);
        let distance_m = (nearest - point).norm();
        (distance_m < self.truncation_m()).then_some(Nearest { point: nearest, distance_m })
    }

    /// The nearest obstacle point in each direction around `point`, of those within `radius_m`, in its layer.
    pub fn obstacles_around(&self, point: &Vector3<f64>, radius_m: f64) -> Sectors {
        let mut sectors = Sectors::new(*point);
        let Some(centre) = self.voxels.index_of(point) else { return sectors };
        if self.clearance(point) >= radius_m {
            return sectors;
        }
        let span = (radius_m / self.voxels.config().resolution_m).ceil() as usize;
        let [nx, ny, _] = self.voxels.counts();
        let (x0, x1) = (centre.x.saturating_sub(span), (centre.x + span + 1).min(nx));
        for y in centre.y.saturating_sub(span)..(centre.y + span + 1).min(ny) {
            for (x, blocked) in self.voxels.row(y, centre.z)[x0..x1].iter().enumerate() {
                if *blocked == 0 {
                    continue;
                }
                let offset = [(x + x0) as i64 - centre.x as i64, y as i64 - centre.y as i64];
                let nearest = self.face_point(centre, offset, point);
                if (nearest - point).norm_squared() <= radius_m * radius_m {
                    sectors.add(nearest);
                }
            }
        }
        sectors
    }

    /// Whether every voxel that the segment passes through has at least `clearance_m` (from the voxel's
    /// centre).
    pub fn is_segment_clear(&self, from: &Vector3<f64>, to: &Vector3<f64>, clearance_m: f64) -> bool {
        self.segment_clearance(from, to) >= self.required(clearance_m)
    }

    /// Whether the stretch of `path` between two stations has at least `clearance_m` in every voxel: no need to plan
    /// anew.
    pub fn is_path_clear(&self, path: &Path, from_m: f64, to_m: f64, clearance_m: f64) -> bool {
        let inner = path.points().iter().zip(path.stations()).filter(|(_, at)| **at > from_m && **at < to_m);
        let mut before = path.point_at(from_m);
        inner.map(|(point, _)| *point).chain([path.point_at(to_m)]).all(|point| {
            let from = std::mem::replace(&mut before, point);
            self.is_segment_clear(&from, &point, clearance_m)
        })
    }

    /// Distance from `origin` along the horizontal `direction` to the first occupied voxel, metres, if there
    /// is one within `max_m`.
    pub fn ray(&self, origin: &Vector3<f64>, direction: &Vector3<f64>, max_m: f64) -> Option<f64> {
        let unit = Vector3::new(direction.x, direction.y, 0.0).try_normalize(1e-9)?;
        let resolution_m = self.voxels.config().resolution_m;
        let start = self.voxels.to_local(origin);
        let mut found = None;
        traverse(start, start + unit * (max_m / resolution_m), |[x, y, z]| {
            match self.voxels.index(x, y, z) {
                Some(voxel) if self.voxels.is_blocked(voxel) => {
                    found = Some(entry(start, unit, [x, y]) * resolution_m);
                    ControlFlow::Break(())
                }
                Some(_) => ControlFlow::Continue(()),
                None => ControlFlow::Break(()),
            }
        });
        found
    }

    /// Least squared distance, in voxels, from the voxels of a segment to an occupied one.
    pub(crate) fn segment_clearance(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> i32 {
        let mut least = i32::MAX;
        traverse(self.voxels.to_local(from), self.voxels.to_local(to), |[x, y, z]| {
            if let Some(voxel) = self.voxels.index(x, y, z) {
                least = least.min(squared(self.offset_at(voxel)));
            }
            if least == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        least
    }

    /// The squared distance between voxel centres, in voxels, that a clearance asks for.
    pub(crate) fn required(&self, clearance_m: f64) -> i32 {
        let voxels = clearance_m.min(self.truncation_m()) / self.voxels.config().resolution_m + 0.5;
        // Rounding errors must not ask for more than the clearance.
        (voxels * voxels - 1e-9).ceil().max(1.0) as i32
    }

    /// The clearance that a squared distance between voxel centres stands for, metres.
    pub(crate) fn clearance_of(&self, squared: i32) -> f64 {
        if squared == i32::MAX {
            return self.truncation_m();
        }
        (f64::from(squared).sqrt() - 0.5).max(0.0) * self.voxels.config().resolution_m
    }

    /// As [`ClearanceMap::track`], for a layer by its number; whether that took work.
    pub(crate) fn track_layer(&mut self, z: usize) -> bool {
        let Some(slot @ None) = self.layers.get_mut(z) else { return false };
        *slot = Some(Layer::of(&self.voxels, &self.brush, z));
        true
    }

    /// Squared distance, in voxels, to the nearest occupied voxel; `i32::MAX` beyond the truncation.
    pub(crate) fn squared_at(&self, voxel: VoxelIndex) -> i32 {
        squared(self.offset_at(voxel))
    }

    /// The same along a row of a layer that is tracked; of one that is not, nothing.
    pub(crate) fn row_squared(&self, y: usize, z: usize) -> impl Iterator<Item = i32> + '_ {
        let [nx, ..] = self.voxels.counts();
        let layer = self.layers.get(z).and_then(Option::as_ref);
        let row = layer.and_then(|layer| layer.offsets.get(y * nx..(y + 1) * nx));
        row.unwrap_or_default().iter().map(|offset| squared(*offset))
    }

    /// Carries changes of occupation into the tracked layers. What counts is whether a voxel is occupied now,
    /// not the change.
    fn repair(&mut self, changes: &[Change]) {
        for Change { voxel, .. } in changes {
            if let Some(layer) = &mut self.layers[voxel.z] {
                if self.voxels.is_blocked(*voxel) {
                    layer.add(&self.voxels, &self.brush, *voxel);
                } else {
                    layer.remove(&self.voxels, self.reach, &self.brush, *voxel);
                }
            }
        }
    }

    fn offset_at(&self, voxel: VoxelIndex) -> [i8; 2] {
        let [nx, ny, _] = self.voxels.counts();
        match &self.layers[voxel.z] {
            Some(layer) => layer.offsets[voxel.y * nx + voxel.x],
            None => {
                let reach = self.reach as usize;
                let (x0, x1) = (voxel.x.saturating_sub(reach), (voxel.x + reach + 1).min(nx));
                let mut best = FAR;
                for y in voxel.y.saturating_sub(reach)..(voxel.y + reach + 1).min(ny) {
                    for (x, blocked) in self.voxels.row(y, voxel.z)[x0..x1].iter().enumerate() {
                        let offset = [(x + x0) as i32 - voxel.x as i32, y as i32 - voxel.y as i32];
                        let within = offset[0] * offset[0] + offset[1] * offset[1] <= self.reach * self.reach;
                        if *blocked > 0 && within {
                            best = nearer(best, offset.map(|c| c as i8));
                        }
                    }
                }
                best
            }
        }
    }

    /// The point nearest to `point` on the occupied voxel that lies at `offset` from `voxel`, at the height
    /// of `point`.
    fn face_point<T: Into<i64>>(
        &self,
        voxel: VoxelIndex,
        offset: [T; 2],
        point: &Vector3<f64>,
    ) -> Vector3<f64> {
        let local = self.voxels.to_local(point);
        let [dx, dy] = offset.map(Into::into);
        let (x, y) = ((voxel.x as i64 + dx) as f64, (voxel.y as i64 + dy) as f64);
        let nearest = Vector3::new(local.x.clamp(x, x + 1.0), local.y.clamp(y, y + 1.0), local.z);
        let mut world = point + (nearest - local) * self.voxels.config().resolution_m;
        world.z = point.z;
        world
    }
}

impl Layer {
    fn of(voxels: &VoxelMap, brush: &[[i8; 2]], z: usize) -> Layer {
        let [nx, ny, _] = voxels.counts();
        let mut layer = Layer { offsets: vec![FAR; nx * ny] };
        for y in 0..ny {
            for (x, blocked) in voxels.row(y, z).iter().enumerate() {
                if *blocked > 0 {
                    layer.add(voxels, brush, VoxelIndex { x, y, z });
                }
            }
        }
        layer
    }

    /// Offers an occupied voxel to all voxels around it.
    fn add(&mut self, voxels: &VoxelMap, brush: &[[i8; 2]], site: VoxelIndex) {
        let [nx, ny, _] = voxels.counts();
        for offset in brush {
            if let Some([x, y]) = before(site, *offset, nx, ny) {
                let slot = &mut self.offsets[y * nx + x];
                *slot = nearer(*slot, *offset);
            }
        }
    }

    /// Takes back a voxel that is occupied no more: those it was nearest to are given their next nearest.
    fn remove(&mut self, voxels: &VoxelMap, reach: i32, brush: &[[i8; 2]], gone: VoxelIndex) {
        let [nx, ny, _] = voxels.counts();
        let mut bereft = Vec::new();
        for offset in brush {
            if let Some([x, y]) = before(gone, *offset, nx, ny)
                && self.offsets[y * nx + x] == *offset
            {
                bereft.push([x, y]);
            }
        }
        if bereft.is_empty() {
            return;
        }
        let span = 2 * reach as usize;
        let mut sites = Vec::new();
        let (x0, x1) = (gone.x.saturating_sub(span), (gone.x + span + 1).min(nx));
        for y in gone.y.saturating_sub(span)..(gone.y + span + 1).min(ny) {
            for (x, blocked) in voxels.row(y, gone.z)[x0..x1].iter().enumerate() {
                if *blocked > 0 {
                    sites.push([x + x0, y]);
                }
            }
        }
        for [x, y] in bereft {
            let mut best = FAR;
            for site in &sites {
                let offset = [site[0] as i32 - x as i32, site[1] as i32 - y as i32];
                if offset[0] * offset[0] + offset[1] * offset[1] <= reach * reach {
                    best = nearer(best, offset.map(|c| c as i8));
                }
            }
            self.offsets[y * nx + x] = best;
        }
    }
}

/// The voxel of a layer from which `site` lies at `offset`, if it is in the window.
fn before(site: VoxelIndex, offset: [i8; 2], nx: usize, ny: usize) -> Option<[usize; 2]> {
    let x = site.x.checked_add_signed(-isize::from(offset[0]))?;
    let y = site.y.checked_add_signed(-isize::from(offset[1]))?;
    (x < nx && y < ny).then_some([x, y])
}

/// The nearer of two offsets; of equally near ones the lesser, so that the order of changes leaves no trace.
fn nearer(a: [i8; 2], b: [i8; 2]) -> [i8; 2] {
    let (da, db) = (squared(a), squared(b));
    if db < da || (db == da && b < a) { b } else { a }
}

fn squared(offset: [i8; 2]) -> i32 {
    if offset == FAR {
        return i32::MAX;
    }
    let [dx, dy] = offset.map(i32::from);
    dx * dx + dy * dy
}

/// Distance at which a ray from `start` along the unit vector `unit` enters a cell, in voxels.
fn entry(start: Vector3<f64>, unit: Vector3<f64>, cell: [i32; 2]) -> f64 {
    let mut enter = 0.0_f64;
    for axis in 0..2 {
        if unit[axis] != 0.0 {
            let low = (f64::from(cell[axis]) - start[axis]) / unit[axis];
            let high = (f64::from(cell[axis]) + 1.0 - start[axis]) / unit[axis];
            enter = enter.max(low.min(high));
        }
    }
    enter
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn map() -> ClearanceMap {
        let config =
            VoxelMapConfig { size_m: [12.0, 12.0, 4.0], fade_tau_s: 30.0, ..VoxelMapConfig::default() };
        ClearanceMap::new(config, Vector3::new(0.0, 0.0, 2.0), 2.5).unwrap()
    }

    #[test]
    fn clearance_is_the_distance_to_the_voxels_face() {
        let mut map = map();
        map.insert(&Vector3::new(1.1, 0.1, 2.1));
        let place = Vector3::new(0.1, 0.1, 2.3);
        assert!((map.clearance(&place) - 0.9).abs() < 1e-9);
        let nearest = map.nearest(&place).unwrap();
        assert!((nearest.point - Vector3::new(1.0, 0.1, 2.3)).norm() < 1e-9);
        assert_eq!(map.clearance(&Vector3::new(1.15, 0.05, 2.1)), 0.0);
        assert!(map.nearest(&Vector3::new(-3.0, 0.1, 2.1)).is_none());
        assert_eq!(map.clearance(&Vector3::new(100.0, 0.0, 2.0)), map.truncation_m());
    }

    #[test]
    fn other_heights_are_other_layers() {
        let mut map = map();
        map.insert(&Vector3::new(1.1, 0.1, 1.1));
        assert_eq!(map.clearance(&Vector3::new(1.1, 0.1, 1.7)), 0.0, "within the extent");
        assert_eq!(map.clearance(&Vector3::new(1.1, 0.1, 2.1)), map.truncation_m());
    }

    #[test]
    fn rays_stop_at_the_first_face() {
        let mut map = map();
        map.insert(&Vector3::new(2.1, 0.1, 2.1));
        let from = Vector3::new(0.1, 0.1, 2.1);
        assert!((map.ray(&from, &Vector3::x(), 5.0).unwrap() - 1.9).abs() < 1e-9);
        assert!(map.ray(&from, &Vector3::x(), 1.5).is_none());
        assert!(map.ray(&from, &Vector3::y(), 5.0).is_none());
    }

    #[test]
    fn a_path_is_blocked_only_where_the_obstacle_is() {
        let mut map = map();
        map.insert(&Vector3::new(3.1, 1.1, 2.1));
        let bend =
            vec![Vector3::new(-3.0, 0.1, 2.1), Vector3::new(3.1, 0.1, 2.1), Vector3::new(3.1, 4.0, 2.1)];
        let path = Path::new(bend).unwrap();
        assert!(!map.is_path_clear(&path, 0.0, path.length_m(), 0.3));
        assert!(map.is_path_clear(&path, 0.0, 6.0, 0.3));
        assert!(map.is_path_clear(&path, 8.0, path.length_m(), 0.3));
    }

    #[test]
    fn obstacles_around_hold_the_nearest_of_each_side() {
        let mut map = map();
        for x in [-1.1, 0.9, 1.3] {
            map.insert(&Vector3::new(x, 0.1, 2.1));
        }
        let around: Vec<_> =
            map.obstacles_around(&Vector3::new(0.1, 0.1, 2.1), 1.5).points().map(|p| p.x).collect();
        assert_eq!(around.len(), 2, "{around:?}");
        assert!((around[0] - 0.8).abs() < 1e-9 && (around[1] + 1.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn repaired_distances_equal_searched_ones(
            steps in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64, 0.0..1.2_f64, prop::bool::weighted(0.7)), 1..40),
            roll in prop::option::of((-8.0..8.0_f64, -8.0..8.0_f64)),
        ) {
            let mut tracked = map();
            tracked.track(2.1);
            let mut searched = map();
            for (x, y, radius, add) in steps {
                let place = Vector3::new(x, y, 2.1);
                for map in [&mut tracked, &mut searched] {
                    if add { map.insert(&place) } else { map.clear_ball(&place, radius) }
                }
            }
            if let Some((x, y)) = roll {
                for map in [&mut tracked, &mut searched] {
                    map.recentre(&Vector3::new(x, y, 2.0));
                }
            }
            let [nx, ny, _] = tracked.voxels().counts();
            let z = 10;
            for (y, x) in (0..ny).flat_map(|y| (0..nx).map(move |x| (y, x))) {
                let voxel = VoxelIndex { x, y, z };
                prop_assert_eq!(tracked.offset_at(voxel), searched.offset_at(voxel));
            }
        }

        #[test]
        fn a_faded_map_equals_one_of_what_is_left(
            scans in prop::collection::vec((0_u64..60, prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64), 1..8)), 1..30),
            known in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64), 0..4),
            roll in prop::option::of((-8.0..8.0_f64, -8.0..8.0_f64)),
        ) {
            let height_m = 2.1;
            let mut faded = map();
            faded.track(height_m);
            for (x, y) in known {
                faded.insert(&Vector3::new(x, y, height_m));
            }
            let mut now_s = 0;
            for (pause_s, hits) in scans {
                now_s += pause_s;
                let ends: Vec<_> =
                    hits.iter().map(|(x, y)| RayEnd { point: Vector3::new(*x, *y, height_m), hit: true }).collect();
                faded.fade(Duration::from_secs(now_s));
                faded.integrate(Vector3::new(0.1, 0.1, height_m), &ends);
            }
            if let Some((x, y)) = roll {
                faded.recentre(&Vector3::new(x, y, 2.0));
            }
            faded.fade(Duration::from_secs(now_s + 43));

            let centre = faded.voxels().centre_of(VoxelIndex { x: 30, y: 30, z: 10 }) - Vector3::repeat(0.1);
            let mut rebuilt = ClearanceMap::new(*faded.voxels().config(), centre, 2.5).unwrap();
            for hit in faded.voxels().hits() {
                rebuilt.insert(&hit);
            }
            rebuilt.track(height_m);
            let [nx, ny, _] = faded.voxels().counts();
            for (y, x) in (0..ny).flat_map(|y| (0..nx).map(move |x| (y, x))) {
                let voxel = VoxelIndex { x, y, z: 10 };
                prop_assert_eq!(faded.offset_at(voxel), rebuilt.offset_at(voxel));
            }
        }
    }
}
