//! Evidence of obstacles in a window of voxels around the vehicle or the mission.

use std::ops::ControlFlow;
use std::time::Duration;

use nalgebra::Vector3;

use super::fading::{Fading, Stamp};
use super::{sweep, traverse};

/// Evidence at which a voxel counts as occupied.
const OCCUPIED: i8 = 2;
/// Added by a scan that hits a voxel: one hit makes an obstacle.
const HIT: i8 = 4;
/// Ceiling of evidence: an obstacle seen often is given up after this many less [`OCCUPIED`] scans saw
/// through it.
const CERTAIN: i8 = 12;
/// Floor of evidence of free space.
const FREE: i8 = -4;
/// More voxels than this are refused: about 1 GB.
const MAX_VOXELS: usize = 250_000_000;

/// Size and policy of a [`VoxelMap`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelMapConfig {
    /// Edge of a voxel, metres.
    pub resolution_m: f64,
    /// Size of the window along east, north and up, metres.
    pub size_m: [f64; 3],
    /// Rays are followed this far, metres; what is hit beyond is not taken in.
    pub max_range_m: f64,
    /// A planar lidar sees one layer of an obstacle that stands upright. A hit blocks this much of the column
    /// above it and below it, metres, which covers the vehicle's height and its vertical drift.
    pub vertical_extent_m: f64,
    /// Returns from below this height (ENU z, metres) are the ground: a tilted lidar meets it. They clear,
    /// and mark nothing.
    pub ground_m: f64,
    /// Time constant with which hits fade that no scan sees again, seconds; infinity keeps them for ever.
    ///
    /// A hit of evidence `e` is given up once `e exp(-t / tau) < 1`, see [`VoxelMap::fade`]. Two minutes keep a
    /// single hit for nearly three, and what was seen often for five: a dead end should outlast the way around it,
    /// for who forgets it on that way turns back into it.
    pub fade_tau_s: f64,
}

impl Default for VoxelMapConfig {
    fn default() -> Self {
        VoxelMapConfig {
            resolution_m: 0.2,
            size_m: [80.0, 80.0, 12.0],
            max_range_m: 12.0,
            vertical_extent_m: 0.6,
            ground_m: 0.5,
            fade_tau_s: 120.0,
        }
    }
}

/// Why a map cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    #[error("map: `{field}` is {value}, expected a positive number of metres")]
    NotPositive { field: &'static str, value: f64 },
    #[error("map: `vertical_extent_m` is {value}, expected 0 to 100 times `resolution_m`")]
    Extent { value: f64 },
    #[error(
        "map: `fade_tau_s` is {value}, expected a positive number of seconds, or infinity to keep all hits"
    )]
    Fading { value: f64 },
    #[error(
        "map: `size_m` / `resolution_m` makes {voxels:.0} voxels, expected at most {limit}; take a smaller window or larger voxels"
    )]
    TooLarge { voxels: f64, limit: usize },
}

/// The map's knowledge of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VoxelState {
    Unknown,
    /// Seen through, and not blocked.
    Free,
    /// Something was hit here, or above or below within [`VoxelMapConfig::vertical_extent_m`].
    Occupied,
}

/// Where a lidar ray ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayEnd {
    /// End of the ray (ENU, metres): the place of the return, or a point at maximum range on a ray without
    /// return.
    pub point: Vector3<f64>,
    pub hit: bool,
}

/// A voxel of the window: counts from its lowest corner along east, north and up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct VoxelIndex {
    pub x: usize,
    pub y: usize,
    /// Up: the layer.
    pub z: usize,
}

/// A voxel that became, or ceased to be, [`VoxelState::Occupied`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    pub voxel: VoxelIndex,
    /// Whether it is occupied now.
    pub occupied: bool,
}

/// Unknown, free and occupied space in a window of voxels, from lidar rays.
///
/// Evidence is a small count per voxel: a scan that hits a voxel adds to it, a scan that sees through it
/// subtracts, at most once per scan each, and a voxel that is hit in a scan is never cleared by the same
/// scan. So a lasting obstacle survives grazing rays, and one that has gone is forgotten within about a
/// second of being seen through. What no scan sees again fades ([`VoxelMap::fade`]).
///
/// Unknown space is for planners to judge. Skein plans through it optimistically, because nothing is known in
/// advance of a forest, and flies no faster than it can stop within what it has sensed
/// ([`crate::local::braking`]).
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::map::{RayEnd, VoxelMap, VoxelMapConfig, VoxelState};
///
/// let mut map = VoxelMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0)).unwrap();
/// let tree = Vector3::new(4.1, 0.1, 3.1);
/// map.integrate(Vector3::new(0.1, 0.1, 3.1), &[RayEnd { point: tree, hit: true }]);
/// assert_eq!(map.state(&tree), VoxelState::Occupied);
/// assert_eq!(map.state(&Vector3::new(2.1, 0.1, 3.1)), VoxelState::Free);
/// assert_eq!(map.state(&Vector3::new(6.1, 0.1, 3.1)), VoxelState::Unknown);
/// ```
#[derive(Clone, Debug)]
pub struct VoxelMap {
    config: VoxelMapConfig,
    /// World voxel of the window's lowest corner: the world position divided by the resolution.
    corner: Vector3<f64>,
    /// Voxels along x, y and z.
    counts: [usize; 3],
    /// Voxels above and below a hit that it blocks.
    extent: usize,
    /// x runs fastest, z slowest: flight is mostly level.
    cells: Vec<Cell>,
    /// The number of hit voxels of the column that block a voxel.
    blocked_by: Vec<u8>,
    scan: u16,
    fading: Fading,
    revision: u64,
    changes: Vec<Change>,
}

impl VoxelMap {
    /// An unknown window around `centre` (ENU, metres).
    ///
    /// # Errors
    /// A size that is not positive and finite, or that makes too many voxels; a time constant that is not
    /// positive.
    pub fn new(config: VoxelMapConfig, centre: Vector3<f64>) -> Result<VoxelMap, MapError> {
        let [east, north, up] = config.size_m;
        let positive = [
            ("resolution_m", config.resolution_m),
            ("size_m[0]", east),
            ("size_m[1]", north),
            ("size_m[2]", up),
            ("max_range_m", config.max_range_m),
        ];
        for (field, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(MapError::NotPositive { field, value });
            }
        }
        let extent = config.vertical_extent_m / config.resolution_m;
        if !(0.0..=100.0).contains(&extent) {
            return Err(MapError::Extent { value: config.vertical_extent_m });
        }
        if config.fade_tau_s.is_nan() || config.fade_tau_s <= 0.0 {
            return Err(MapError::Fading { value: config.fade_tau_s });
        }
        let sides = config.size_m.map(|side| (side / config.resolution_m).ceil().max(1.0));
        let voxels = sides[0] * sides[1] * sides[2];
        if voxels > MAX_VOXELS as f64 {
            return Err(MapError::TooLarge { voxels, limit: MAX_VOXELS });
        }
        let counts = sides.map(|side| side as usize);
        let total = counts[0] * counts[1] * counts[2];
        let mut map = VoxelMap {
            config,
            corner: Vector3::zeros(),
            counts,
            extent: extent.round() as usize,
            cells: vec![[0; 4]; total],
            blocked_by: vec![0; total],
            scan: 0,
            fading: Fading::new(config.fade_tau_s, HIT),
            revision: 0,
            changes: Vec::new(),
        };
        map.corner = map.corner_around(&centre);
        Ok(map)
    }

    pub fn config(&self) -> &VoxelMapConfig {
        &self.config
    }

    /// Voxels along east, north and up.
    pub fn counts(&self) -> [usize; 3] {
        self.counts
    }

    /// Grows with each change of what is occupied; equal revisions mean equal obstacles.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Takes one scan in: clears along the rays, then marks what was hit. Returns the voxels whose occupation
    /// changed, in the order in which it did.
    ///
    /// `origin` is the lidar's place (ENU, metres); a scan from outside the window, and rays with non-finite
    /// ends, are ignored. Rays reach to the configured maximum range or the window's border.
    pub fn integrate(&mut self, origin: Vector3<f64>, ends: &[RayEnd]) -> &[Change] {
        self.changes.clear();
        if self.index_of(&origin).is_none() {
            return &self.changes;
        }
        self.begin_scan();
        // Hits first, so that the rays of this scan find them marked and leave them be.
        for end in ends {
            if self.is_obstacle(&origin, end) {
                self.mark(&end.point);
            }
        }
        for end in ends {
            self.clear_along(&origin, end);
        }
        &self.changes
    }

    /// Sets the map's clock, and gives up hits of evidence `e` that no scan has seen again for
    /// [`fade_tau_s`](VoxelMapConfig::fade_tau_s) `* ln(e)`, to within a thirty-second of the time constant:
    /// they are unknown then. Returns the changes.
    ///
    /// Called before [`VoxelMap::integrate`], whose hits are taken to come at this time; a map whose clock is
    /// not set keeps everything. Evidence of free space stays: it differs from unknown space only in that one
    /// has looked there. So does what was [inserted](VoxelMap::insert). A voxel whose evidence rays have
    /// lowered since its last hit fades sooner, as of the next time it is looked up.
    pub fn fade(&mut self, now: Duration) -> &[Change] {
        self.changes.clear();
        self.fading.advance(now);
        while let Some(found) = self.fading.next() {
            let offset = found.offset as usize;
            let cell = self.cells[offset];
            let (evidence, stamp) = (evidence(cell), stamp(cell));
            // Inserted meanwhile: known for good.
            if stamp == 0 {
                continue;
            }
            if evidence < OCCUPIED {
                self.cells[offset] = stamped(cell, 0);
            } else if self.fading.has_faded(found, stamp, evidence) {
                self.set_evidence(self.voxel_at(offset), 0);
                self.cells[offset] = stamped(self.cells[offset], 0);
            }
        }
        &self.changes
    }

    /// Sets everything within `radius_m` of `centre` free: another vehicle flies there, so nothing stands
    /// there. Returns the changes.
    pub fn clear_ball(&mut self, centre: &Vector3<f64>, radius_m: f64) -> &[Change] {
        self.changes.clear();
        let local = self.to_local(centre);
        let radius = radius_m / self.config.resolution_m;
        let span = |axis: usize| {
            let low = (local[axis] - radius).floor().max(0.0);
            let high = (local[axis] + radius).floor().min(self.counts[axis] as f64 - 1.0);
            if low <= high { low as usize..high as usize + 1 } else { 0..0 }
        };
        let (xs, ys, zs) = (span(0), span(1), span(2));
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let offset = Vector3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5) - local;
                    if offset.norm_squared() <= radius * radius {
                        self.set_evidence(VoxelIndex { x, y, z }, FREE);
                    }
                }
            }
        }
        &self.changes
    }

    /// Marks the voxel at `point` as hit with certainty, as prior knowledge does: it does not fade. Returns
    /// the changes.
    pub fn insert(&mut self, point: &Vector3<f64>) -> &[Change] {
        self.changes.clear();
        if let Some(voxel) = self.index_of(point) {
            self.set_evidence(voxel, CERTAIN);
            let offset = self.offset(voxel);
            self.cells[offset] = stamped(self.cells[offset], 0);
        }
        &self.changes
    }

    /// The state of the place `point` (ENU, metres); unknown outside the window.
    pub fn state(&self, point: &Vector3<f64>) -> VoxelState {
        self.index_of(point).map_or(VoxelState::Unknown, |voxel| self.state_of(voxel))
    }

    /// Centres (ENU, metres) of the voxels in which something was hit, lowest layer first. Visits the whole
    /// window.
    pub fn hits(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let hit = self.cells.iter().enumerate().filter(|(_, cell)| evidence(**cell) >= OCCUPIED);
        hit.map(|(offset, _)| self.centre_of(self.voxel_at(offset)))
    }

    /// The free line of sight from `origin` along the horizontal direction `direction` before something unknown
    /// or occupied, at most `max_m`, metres. A place counts as seen when any voxel of its column within the
    /// vertical extent was seen: the beam of a tilted lidar passes over or under the vehicle's own layer.
    pub fn sensed_free_m(&self, origin: &Vector3<f64>, direction: &Vector3<f64>, max_m: f64) -> f64 {
        let level = Vector3::new(direction.x, direction.y, 0.0);
        let Some(unit) = level.try_normalize(1e-9) else { return 0.0 };
        let start = self.to_local(origin);
        let own = start.map(f64::floor);
        let end = start + unit * (max_m / self.config.resolution_m);
        let mut free_m = max_m;
        traverse(start, end, |[x, y, z]| {
            let seen = self
                .index(x, y, z)
                .is_some_and(|voxel| self.is_column_seen(voxel) && !self.is_blocked(voxel));
            // The vehicle's own voxel is where it is, whatever was seen of it.
            if seen || (f64::from(x) == own.x && f64::from(y) == own.y) {
                return ControlFlow::Continue(());
            }
            let nearest = Vector3::new(
                start.x.clamp(f64::from(x), f64::from(x) + 1.0),
                start.y.clamp(f64::from(y), f64::from(y) + 1.0),
                start.z,
            );
            free_m = ((nearest - start).norm() * self.config.resolution_m).min(max_m);
            ControlFlow::Break(())
        });
        free_m
    }

    /// Moves the window east and north so that `point` lies in its middle, once `point` comes within a
    /// quarter of the window's side from its border. What leaves the window is forgotten, what enters is
    /// unknown. The window's heights stay. Returns whether it moved.
    pub fn recentre(&mut self, point: &Vector3<f64>) -> bool {
        let local = self.to_local(point);
        if !local.iter().all(|c| c.is_finite()) {
            return false;
        }
        let wanted = self.corner_around(point);
        let mut shift = [0.0; 2];
        for axis in 0..2 {
            let side = self.counts[axis] as f64;
            if local[axis] < side / 4.0 || local[axis] > side * 3.0 / 4.0 {
                shift[axis] = wanted[axis] - self.corner[axis];
            }
        }
        if shift == [0.0; 2] {
            return false;
        }
        let shift = shift.map(|voxels| voxels.clamp(-1e9, 1e9) as i64);
        self.cells = shifted(&self.cells, self.counts, shift);
        self.blocked_by = shifted(&self.blocked_by, self.counts, shift);
        let counts = self.counts;
        self.fading.relocate(|offset| shifted_offset(offset, counts, shift));
        self.corner += Vector3::new(shift[0] as f64, shift[1] as f64, 0.0);
        self.revision += 1;
        true
    }

    /// The voxel at `point` (ENU, metres); `None` outside the window.
    pub fn index_of(&self, point: &Vector3<f64>) -> Option<VoxelIndex> {
        let local = self.to_local(point);
        let inside = (0..3).all(|axis| local[axis] >= 0.0 && local[axis] < self.counts[axis] as f64);
        inside.then(|| VoxelIndex { x: local.x as usize, y: local.y as usize, z: local.z as usize })
    }

    /// Centre of a voxel (ENU, metres).
    pub fn centre_of(&self, voxel: VoxelIndex) -> Vector3<f64> {
        let within = Vector3::new(voxel.x as f64 + 0.5, voxel.y as f64 + 0.5, voxel.z as f64 + 0.5);
        (self.corner + within) * self.config.resolution_m
    }

    /// The point of the window that is nearest to `point`, half a voxel inside its border.
    pub fn clamp(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let local = self.to_local(point);
        let inside = Vector3::from_fn(|axis, _| local[axis].clamp(0.5, self.counts[axis] as f64 - 0.5));
        (self.corner + inside) * self.config.resolution_m
    }

    /// `point` in voxels from the window's corner.
    pub(crate) fn to_local(&self, point: &Vector3<f64>) -> Vector3<f64> {
        point / self.config.resolution_m - self.corner
    }

    /// The voxel at signed counts from the corner, if it is in the window.
    pub(crate) fn index(&self, x: i32, y: i32, z: i32) -> Option<VoxelIndex> {
        let [nx, ny, nz] = self.counts;
        let voxel = VoxelIndex {
            x: usize::try_from(x).ok()?,
            y: usize::try_from(y).ok()?,
            z: usize::try_from(z).ok()?,
        };
        (voxel.x < nx && voxel.y < ny && voxel.z < nz).then_some(voxel)
    }

    /// Whether a voxel of the window is occupied.
    pub(crate) fn is_blocked(&self, voxel: VoxelIndex) -> bool {
        self.blocked_by[self.offset(voxel)] > 0
    }

    /// The occupation of a row of a layer: greater than 0 is occupied.
    pub(crate) fn row(&self, y: usize, z: usize) -> &[u8] {
        let start = self.offset(VoxelIndex { x: 0, y, z });
        &self.blocked_by[start..start + self.counts[0]]
    }

    fn state_of(&self, voxel: VoxelIndex) -> VoxelState {
        if self.is_blocked(voxel) {
            VoxelState::Occupied
        } else if evidence(self.cells[self.offset(voxel)]) == 0 {
            VoxelState::Unknown
        } else {
            VoxelState::Free
        }
    }

    fn is_column_seen(&self, voxel: VoxelIndex) -> bool {
        self.column(voxel).any(|z| evidence(self.cells[self.offset(VoxelIndex { z, ..voxel })]) != 0)
    }

    /// Layers within the vertical extent of a voxel.
    fn column(&self, voxel: VoxelIndex) -> std::ops::RangeInclusive<usize> {
        voxel.z.saturating_sub(self.extent)..=(voxel.z + self.extent).min(self.counts[2] - 1)
    }

    fn corner_around(&self, centre: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            (centre[axis] / self.config.resolution_m - self.counts[axis] as f64 / 2.0).round()
        })
    }

    fn offset(&self, voxel: VoxelIndex) -> usize {
        (voxel.z * self.counts[1] + voxel.y) * self.counts[0] + voxel.x
    }

    fn voxel_at(&self, offset: usize) -> VoxelIndex {
        let [nx, ny, _] = self.counts;
        VoxelIndex { x: offset % nx, y: offset / nx % ny, z: offset / (nx * ny) }
    }

    fn is_obstacle(&self, origin: &Vector3<f64>, end: &RayEnd) -> bool {
        let range = self.config.max_range_m;
        end.hit && end.point.z >= self.config.ground_m && (end.point - origin).norm_squared() <= range * range
    }

    fn begin_scan(&mut self) {
        if self.scan == u16::MAX {
            // Memory that was never written to stays so.
            self.cells.iter_mut().filter(|cell| scan(**cell) != 0).for_each(|cell| {
                *cell = with(evidence(*cell), 0, *cell);
            });
            self.scan = 0;
        }
        self.scan += 1;
    }

    fn mark(&mut self, point: &Vector3<f64>) {
        let Some(voxel) = self.index_of(point) else { return };
        let offset = self.offset(voxel);
        let cell = self.cells[offset];
        if scan(cell) == self.scan {
            return;
        }
        let was_inserted = evidence(cell) >= OCCUPIED && stamp(cell) == 0;
        let evidence = evidence(cell).max(0) + HIT;
        self.set_evidence(voxel, evidence.min(CERTAIN));
        if !was_inserted {
            let stamp = self.fading.hit(offset, stamp(cell));
            self.cells[offset] = stamped(self.cells[offset], stamp);
        }
    }

    fn clear_along(&mut self, origin: &Vector3<f64>, end: &RayEnd) {
        let ray = end.point - origin;
        let length = ray.norm();
        if !length.is_finite() {
            return;
        }
        let reach = if length > self.config.max_range_m { self.config.max_range_m / length } else { 1.0 };
        let start = self.to_local(origin);
        let stop = self.clipped(&start, &self.to_local(&(origin + ray * reach)));
        let [nx, ny, _] = self.counts;
        let now = self.scan;
        let cells = &mut self.cells;
        let mut lost = Vec::new();
        sweep(start, stop, [1, nx, nx * ny], |offset| {
            let cell = &mut cells[offset];
            if scan(*cell) != now {
                let lower = lowered(evidence(*cell));
                if evidence(*cell) == OCCUPIED {
                    lost.push(offset);
                } else {
                    *cell = with(lower, now, *cell);
                }
            }
        });
        for offset in lost {
            self.set_evidence(self.voxel_at(offset), lowered(OCCUPIED));
        }
    }

    /// The last point in the window of the segment from `start`, which is in it, to `end`; in voxels.
    fn clipped(&self, start: &Vector3<f64>, end: &Vector3<f64>) -> Vector3<f64> {
        const INSIDE: f64 = 1e-6;
        let delta = end - start;
        let high = Vector3::from(self.counts.map(|count| count as f64 - INSIDE));
        let mut share = 1.0_f64;
        for axis in 0..3 {
            if end[axis] < 0.0 {
                share = share.min(-start[axis] / delta[axis]);
            } else if end[axis] > high[axis] {
                share = share.min((high[axis] - start[axis]) / delta[axis]);
            }
        }
        (start + delta * share.max(0.0)).zip_map(&high, |c, high| c.clamp(0.0, high))
    }

    /// Writes evidence, and carries a change of occupation into the column.
    fn set_evidence(&mut self, voxel: VoxelIndex, evidence: i8) {
        let offset = self.offset(voxel);
        let was = self::evidence(self.cells[offset]) >= OCCUPIED;
        let is = evidence >= OCCUPIED;
        self.cells[offset] = with(evidence, self.scan, self.cells[offset]);
        if was == is {
            return;
        }
        for z in self.column(voxel) {
            let voxel = VoxelIndex { z, ..voxel };
            let offset = self.offset(voxel);
            let count = &mut self.blocked_by[offset];
            let before = *count;
            *count = if is { before + 1 } else { before - 1 };
            if (before == 0) != (*count == 0) {
                self.revision += 1;
                self.changes.push(Change { voxel, occupied: is });
            }
        }
    }
}

/// What a scan writes to: evidence (0 is never seen, [`OCCUPIED`] and more is hit) in the first byte, the
/// stamp of the last hit in the second, and in the others the last scan that touched the voxel. Scans are
/// counted to `u16::MAX`, and from 1 again. All are read and written together, for every voxel of every ray.
type Cell = [u8; 4];

fn evidence(cell: Cell) -> i8 {
    cell[0] as i8
}

fn stamp(cell: Cell) -> Stamp {
    cell[1]
}

fn scan(cell: Cell) -> u16 {
    (u32::from_le_bytes(cell) >> 16) as u16
}

/// The cell with other evidence, of another scan.
fn with(evidence: i8, scan: u16, cell: Cell) -> Cell {
    let kept = u32::from_le_bytes(cell) & 0xff00;
    (u32::from(scan) << 16 | kept | u32::from(evidence as u8)).to_le_bytes()
}

fn stamped(cell: Cell, stamp: Stamp) -> Cell {
    [cell[0], stamp, cell[2], cell[3]]
}

/// Evidence after a scan saw through a voxel. Zero is left out: it means never seen.
fn lowered(evidence: i8) -> i8 {
    let lower = (evidence - 1).max(FREE);
    if lower == 0 { -1 } else { lower }
}

/// `values` of a window that has moved by `shift` voxels.
fn shifted<T: Copy + Default>(values: &[T], counts: [usize; 3], shift: [i64; 2]) -> Vec<T> {
    let [nx, ny, _] = counts;
    let mut moved = vec![T::default(); values.len()];
    let overlap = |count: usize, shift: i64| {
        let lost = usize::try_from(shift.unsigned_abs()).unwrap_or(usize::MAX).min(count);
        // (first kept in the old window, its place in the new one, how many)
        if shift >= 0 { (lost, 0, count - lost) } else { (0, lost, count - lost) }
    };
    let (from_x, to_x, width) = overlap(nx, shift[0]);
    let (from_y, to_y, height) = overlap(ny, shift[1]);
    for (old, new) in values.chunks_exact(nx * ny).zip(moved.chunks_exact_mut(nx * ny)) {
        for row in 0..height {
            let source = (from_y + row) * nx + from_x;
            let target = (to_y + row) * nx + to_x;
            new[target..target + width].copy_from_slice(&old[source..source + width]);
        }
    }
    moved
}

/// Where the voxel at `offset` is in a window that has moved by `shift` voxels, if it still is in it.
fn shifted_offset(offset: usize, counts: [usize; 3], shift: [i64; 2]) -> Option<usize> {
    let [nx, ny, _] = counts;
    let x = usize::try_from((offset % nx) as i64 - shift[0]).ok().filter(|x| *x < nx)?;
    let y = usize::try_from((offset / nx % ny) as i64 - shift[1]).ok().filter(|y| *y < ny)?;
    Some((offset / (nx * ny) * ny + y) * nx + x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> VoxelMap {
        let config =
            VoxelMapConfig { size_m: [10.0, 10.0, 6.0], fade_tau_s: 30.0, ..VoxelMapConfig::default() };
        VoxelMap::new(config, Vector3::new(0.0, 0.0, 3.0)).unwrap()
    }

    fn hit(x: f64, y: f64, z: f64) -> RayEnd {
        RayEnd { point: Vector3::new(x, y, z), hit: true }
    }

    const EYE: Vector3<f64> = Vector3::new(-3.9, 0.1, 3.1);

    #[test]
    fn a_hit_blocks_its_column_but_not_beyond_the_extent() {
        let mut map = small();
        let changes = map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]).to_vec();
        assert_eq!(changes.len(), 7);
        assert!(changes.iter().all(|change| change.occupied));
        for (z, state) in
            [(2.5, VoxelState::Occupied), (3.7, VoxelState::Occupied), (3.9, VoxelState::Unknown)]
        {
            assert_eq!(map.state(&Vector3::new(2.1, 0.1, z)), state, "z {z}");
        }
        assert_eq!(map.hits().count(), 1);
    }

    #[test]
    fn a_voxel_hit_in_a_scan_is_not_cleared_by_its_other_rays() {
        let mut map = small();
        for _ in 0..20 {
            map.integrate(EYE, &[hit(2.1, 0.1, 3.1), hit(4.1, 0.1, 3.1)]);
        }
        assert_eq!(map.state(&Vector3::new(2.1, 0.1, 3.1)), VoxelState::Occupied);
        assert_eq!(map.state(&Vector3::new(4.1, 0.1, 3.1)), VoxelState::Occupied);
    }

    #[test]
    fn what_has_gone_is_forgotten_after_being_seen_through() {
        let mut map = small();
        let gone = Vector3::new(2.1, 0.1, 3.1);
        for _ in 0..50 {
            map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        }
        let mut scans = 0;
        while map.state(&gone) == VoxelState::Occupied {
            map.integrate(EYE, &[hit(4.1, 0.1, 3.1)]);
            scans += 1;
            assert!(scans <= 12, "still there after {scans} scans");
        }
        assert_eq!(map.state(&gone), VoxelState::Free);
        assert!(scans >= 8, "forgotten after {scans} scans only");
        assert_eq!(
            map.state(&Vector3::new(2.1, 0.1, 3.5)),
            VoxelState::Unknown,
            "its column is given up with it"
        );
    }

    #[test]
    fn many_rays_through_a_voxel_count_once_per_scan() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        let through: Vec<_> = (0..50).map(|k| hit(4.1, 0.1 + f64::from(k) * 1e-3, 3.1)).collect();
        map.integrate(EYE, &through);
        assert_eq!(map.state(&Vector3::new(2.1, 0.1, 3.1)), VoxelState::Occupied);
    }

    #[test]
    fn the_ground_is_no_obstacle() {
        let mut map = small();
        assert!(map.integrate(EYE, &[hit(2.1, 0.1, 0.1)]).is_empty());
        assert_eq!(map.state(&Vector3::new(2.1, 0.1, 0.1)), VoxelState::Free);
    }

    #[test]
    fn returns_beyond_the_range_clear_but_do_not_mark() {
        let config =
            VoxelMapConfig { max_range_m: 3.0, size_m: [10.0, 10.0, 6.0], ..VoxelMapConfig::default() };
        let mut map = VoxelMap::new(config, Vector3::new(0.0, 0.0, 3.0)).unwrap();
        assert!(map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]).is_empty());
        assert_eq!(map.state(&Vector3::new(-1.1, 0.1, 3.1)), VoxelState::Free);
        assert_eq!(map.state(&Vector3::new(-0.5, 0.1, 3.1)), VoxelState::Unknown);
    }

    #[test]
    fn rays_from_outside_or_to_nowhere_are_ignored() {
        let mut map = small();
        assert!(map.integrate(Vector3::new(50.0, 0.0, 3.0), &[hit(2.1, 0.1, 3.1)]).is_empty());
        assert!(map.integrate(EYE, &[hit(f64::NAN, 0.1, 3.1), hit(f64::INFINITY, 0.1, 3.1)]).is_empty());
        assert!(map.integrate(Vector3::new(f64::NAN, 0.0, 3.0), &[hit(2.1, 0.1, 3.1)]).is_empty());
    }

    #[test]
    fn a_place_where_a_vehicle_flies_is_cleared() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        let changes = map.clear_ball(&Vector3::new(2.2, 0.1, 3.2), 0.4).to_vec();
        assert_eq!(changes.len(), 7);
        assert_eq!(map.hits().count(), 0);
    }

    #[test]
    fn rolling_keeps_what_stays_and_forgets_what_leaves() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1), hit(-3.9, 2.1, 3.1)]);
        assert!(!map.recentre(&Vector3::new(2.0, 0.0, 3.0)), "still in the middle half");
        assert!(map.recentre(&Vector3::new(4.0, 0.0, 3.0)));
        assert_eq!(map.state(&Vector3::new(2.1, 0.1, 3.1)), VoxelState::Occupied);
        assert_eq!(map.hits().count(), 1);
        assert_eq!(map.state(&Vector3::new(8.9, 0.1, 3.1)), VoxelState::Unknown);
        assert!(map.recentre(&Vector3::new(100.0, -100.0, 3.0)));
        assert_eq!(map.hits().count(), 0);
    }

    #[test]
    fn sight_ends_at_the_unknown_and_at_obstacles() {
        let mut map = small();
        let east = Vector3::x();
        map.integrate(EYE, &[RayEnd { point: Vector3::new(0.05, 0.1, 3.5), hit: false }]);
        let seen = map.sensed_free_m(&EYE, &east, 12.0);
        assert!((seen - 4.1).abs() < 0.21, "tilted beam counts within the extent: {seen}");
        map.integrate(EYE, &[hit(-1.9, 0.1, 3.1)]);
        assert!((map.sensed_free_m(&EYE, &east, 12.0) - 1.9).abs() < 0.11);
        assert_eq!(map.sensed_free_m(&EYE, &east, 1.0), 1.0);
    }

    const AT: Vector3<f64> = Vector3::new(2.1, 0.1, 3.1);

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    /// The first whole second at which `map` has given up what was hit at [`AT`].
    fn fades_at(map: &mut VoxelMap) -> Option<u64> {
        (0..400).find(|second| {
            map.fade(seconds(*second));
            map.state(&AT) != VoxelState::Occupied
        })
    }

    #[test]
    fn a_single_hit_fades_sooner_than_a_solid_one() {
        // 30 s ln 4 = 41.6 s, 30 s ln 12 = 74.5 s.
        for (hits, expected) in [(1, 41.6), (3, 74.5), (50, 74.5)] {
            let mut map = small();
            for _ in 0..hits {
                map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
            }
            let faded = fades_at(&mut map).unwrap() as f64;
            assert!(faded >= expected && faded <= expected + 2.0, "{hits} hits fade after {faded} s");
            assert_eq!(map.state(&AT), VoxelState::Unknown);
            assert_eq!(map.hits().count(), 0);
            assert_eq!(map.fading.len(), 0, "nothing is left to look up");
            assert_eq!(map.state(&Vector3::new(-1.9, 0.1, 3.1)), VoxelState::Free, "free space stays");
        }
    }

    #[test]
    fn fading_tells_the_whole_column() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        assert!(map.fade(seconds(40)).is_empty());
        let revision = map.revision();
        let changes = map.fade(seconds(44)).to_vec();
        assert_eq!(changes.len(), 7);
        assert!(changes.iter().all(|change| !change.occupied));
        assert!(map.revision() > revision);
        assert!(map.fade(seconds(45)).is_empty(), "told once");
    }

    #[test]
    fn what_is_seen_again_and_again_never_fades() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        for second in (0..1000).step_by(20) {
            assert!(map.fade(seconds(second)).is_empty(), "gone at {second} s");
            map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
            assert_eq!(map.fading.len(), 1, "looked up once at a time");
        }
        // Seen through now and then, and hit again.
        for second in 1000..2000 {
            let end = if second % 20 < 4 { hit(4.1, 0.1, 3.1) } else { hit(2.1, 0.1, 3.1) };
            map.fade(seconds(second));
            map.integrate(EYE, &[end]);
            assert_eq!(map.state(&AT), VoxelState::Occupied, "gone at {second} s");
        }
        assert_eq!(map.fading.len(), 2);
    }

    #[test]
    fn a_hit_after_a_voxel_was_given_up_fades_like_a_first_one() {
        for after in [1, 20, 41] {
            let mut map = small();
            map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
            map.fade(seconds(after));
            map.clear_ball(&AT, 0.1);
            map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
            let faded = fades_at(&mut map).unwrap() as f64 - after as f64;
            assert!((40.6..=43.6).contains(&faded), "{faded} s after a hit at {after} s");
        }
    }

    #[test]
    fn what_is_known_beforehand_does_not_fade() {
        let mut map = small();
        map.insert(&AT);
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        assert_eq!(fades_at(&mut map), None, "also when it is hit");
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        map.insert(&AT);
        assert_eq!(fades_at(&mut map), None, "also when it was hit before");
        map.clear_ball(&AT, 0.1);
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        map.fade(seconds(500));
        assert_eq!(map.state(&AT), VoxelState::Unknown, "but what is hit after it has gone does");
    }

    #[test]
    fn an_infinite_time_constant_keeps_everything() {
        let config = VoxelMapConfig { fade_tau_s: f64::INFINITY, ..*small().config() };
        let mut map = VoxelMap::new(config, Vector3::new(0.0, 0.0, 3.0)).unwrap();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        assert!(map.fade(Duration::from_secs(1_000_000_000)).is_empty());
        assert_eq!(map.state(&AT), VoxelState::Occupied);
        assert_eq!(map.fading.len(), 0);
    }

    #[test]
    fn a_clock_that_leaps_forgets_and_one_that_steps_back_does_not() {
        // 240 s are eight time constants, after which stamps are used again.
        for leap in [76, 239, 240, 241, 280, 100_000] {
            let mut map = small();
            map.fade(seconds(1000));
            (0..3).for_each(|_| drop(map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]).to_vec()));
            assert!(map.fade(seconds(0)).is_empty());
            assert_eq!(map.fade(seconds(1000 + leap)).len(), 7, "after {leap} s");
        }
    }

    #[test]
    fn hits_fade_where_the_window_has_taken_them() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1), hit(-3.9, 2.1, 3.1)]);
        assert_eq!(map.fading.len(), 2);
        assert!(map.recentre(&Vector3::new(4.0, -3.0, 3.0)));
        assert_eq!(map.fading.len(), 1, "what has left is dropped");
        map.integrate(Vector3::new(4.1, -3.1, 3.1), &[hit(7.1, -3.1, 3.1)]);
        map.fade(seconds(20));
        map.integrate(Vector3::new(4.1, -3.1, 3.1), &[hit(7.1, -3.1, 3.1)]);
        map.fade(seconds(44));
        assert_eq!(map.state(&AT), VoxelState::Unknown);
        assert_eq!(map.state(&Vector3::new(7.1, -3.1, 3.1)), VoxelState::Occupied);
    }

    #[test]
    fn scans_are_told_apart_after_their_count_begins_anew() {
        let mut map = small();
        map.integrate(EYE, &[hit(2.1, 0.1, 3.1)]);
        // Whatever scan first touched a voxel, its number comes again.
        for _ in 0..usize::from(u16::MAX) {
            map.integrate(EYE, &[]);
        }
        let before = map.state(&AT);
        for _ in 0..3 {
            map.integrate(EYE, &[hit(4.1, 0.1, 3.1)]);
        }
        assert_eq!((before, map.state(&AT)), (VoxelState::Occupied, VoxelState::Free), "seen through thrice");
    }

    #[test]
    fn a_time_constant_that_is_none_is_refused() {
        for fade_tau_s in [0.0, -1.0, f64::NAN] {
            let bad = VoxelMapConfig { fade_tau_s, ..VoxelMapConfig::default() };
            let error = VoxelMap::new(bad, Vector3::zeros()).unwrap_err();
            assert!(error.to_string().contains("fade_tau_s"), "{error}");
        }
    }

    #[test]
    fn unsound_sizes_are_refused_by_name() {
        let bad = VoxelMapConfig { resolution_m: f64::NAN, ..VoxelMapConfig::default() };
        let error = VoxelMap::new(bad, Vector3::zeros()).unwrap_err();
        assert!(error.to_string().contains("resolution_m"));
        let huge = VoxelMapConfig { size_m: [1e6, 1e6, 1e3], ..VoxelMapConfig::default() };
        assert!(matches!(VoxelMap::new(huge, Vector3::zeros()), Err(MapError::TooLarge { .. })));
    }
}
