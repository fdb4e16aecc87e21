//! Perception: lidar scans and the vehicle's own pose become a map; neighbours are taken out of the scans first.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_planning::airspace::{Airspace, KeepOut};
use skein_planning::map::{ClearanceMap, FreeRays, MapError, RayEnd, Sectors, VoxelMapConfig};
use skein_planning::separation;
use skein_wire::Scan;

use crate::config::{AgentConfig, Envelope, Fence};

/// Edge of a voxel, m.
const RESOLUTION_M: f64 = 0.2;
/// Rays are followed this far, m: further than any vehicle here needs to stop.
const MAP_RANGE_M: f64 = 10.0;
/// Of rays that end beyond the map, one in so many is followed in each scan; the next scan follows others.
const FAR_RAYS: u32 = 3;
/// Clearance is not told apart beyond this, m.
const CLEARANCE_RANGE_M: f64 = 2.5;
/// The window is at most this wide, m.
const WIDEST_WINDOW_M: f64 = 120.0;
/// The window is at most this high, m.
pub const TALLEST_WINDOW_M: f64 = 160.0;
/// A higher one is narrower than the widest, so that it holds no more, m.
const TALL_M: f64 = 40.0;
/// A hit blocks this much of the column above and below it, m: the hull's height, and how well height is held.
const VERTICAL_EXTENT_M: f64 = 0.4;
/// Returns from lower than this above the take-off place are the ground.
const GROUND_M: f64 = 0.4;
/// Obstacle points this near are told to the safety filter at least, m.
const NEAR_M: f64 = 6.0;
/// Returns this near a neighbour are the neighbour, m.
const NEIGHBOUR_M: f64 = 0.8;
/// Returns this near the skin of something that moves are of it, m: it is not where it was expected to the last.
const MOVER_M: f64 = 0.4;
/// Returns nearer than this are the vehicle's own frame, m.
const OWN_FRAME_M: f64 = 0.15;

/// What only the upright lidar sees is level: it reaches so far to both sides of its plane, m.
const ROW_HALF_M: f64 = 3.0;
/// What the level lidar has seen nearer than this, over ground, is upright, m.
const UPRIGHT_M: f64 = 0.5;

/// The map reaches this far above the highest waypoint, m: as far as a path may climb over something, and more.
const ABOVE_WAYPOINTS_M: f64 = 4.0;
/// A path may pass under something, this far below the lowest waypoint, m.
const BELOW_WAYPOINTS_M: f64 = 1.0;
/// No path is lower than this above the take-off place, m.
const LEAST_HEIGHT_M: f64 = 0.6;
/// Beyond every map, m.
pub(super) const FAR_CORNER: Vector3<f64> = Vector3::new(1e9, 1e9, 1e9);
/// Paths keep this far out of zones, m: what a vehicle strays from its path, the error of its position, and its hull.
pub const ZONE_MARGIN_M: f64 = 1.0;
/// Paths keep this high above terrain that is known, m.
const TERRAIN_CLEARANCE_M: f64 = 1.0;

/// Margins around known places follow the accuracy of the position in such steps, m.
const ALLOWANCE_STEP_M: f64 = 0.25;

/// Where the vehicle was, and how it lay, when a scan was taken. World ENU, body FLU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub position: Vector3<f64>,
    /// Body to world.
    pub attitude: UnitQuaternion<f64>,
}

/// Another vehicle, as it was heard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Other {
    /// ENU, m.
    pub position: Vector3<f64>,
    /// Error beyond what every margin allows for, m.
    pub off_m: f64,
}

/// The map a vehicle makes of what it senses.
#[derive(Clone, Debug)]
pub struct Perception {
    map: ClearanceMap,
    fence: Fence,
    home: Vector3<f64>,
    /// Floor and ceiling of the map, m.
    heights_m: [f64; 2],
    last_scan: Option<Duration>,
    ends: Vec<RayEnd>,
    rays: FreeRays,
    near: Vec<Vector3<f64>>,
    /// Obstacle points this near are told to the safety filter, m.
    near_m: f64,
    returns: Vec<Vector3<f64>>,
    ground_m: f64,
    rolls: bool,
    /// Width that margins around known places have for the vehicle's position, m.
    allows_for_m: f64,
    /// Which of the far rays the newest scan followed.
    far_ray: u32,
}

impl Perception {
    /// An empty map of where the mission of this configuration may fly.
    pub fn of_mission(config: &AgentConfig) -> Result<Self, MapError> {
        let mut perception = Self::new(&config.fence, Vector3::from(config.home), heights(config))?;
        perception.handle(&config.envelope);
        if config.airspace == Airspace::default() {
            return Ok(perception);
        }
        let keep_out = KeepOut::new(config.airspace.clone(), ZONE_MARGIN_M, TERRAIN_CLEARANCE_M);
        Ok(perception.with_keep_out(keep_out))
    }

    /// An empty map of the space between the heights `floor_m` and `ceiling_m` inside the fence, metres ENU: no path
    /// leaves these heights. A fence too wide for one map is covered by a window that rolls along with the vehicle.
    pub fn new(fence: &Fence, home: Vector3<f64>, [floor_m, ceiling_m]: [f64; 2]) -> Result<Self, MapError> {
        let height_m = (ceiling_m.min(fence.max[2]) - floor_m).min(TALLEST_WINDOW_M);
        let width_m = [0, 1].map(|axis| fence.max[axis] - fence.min[axis] + 4.0 * RESOLUTION_M);
        let widest_m = WIDEST_WINDOW_M * (TALL_M / height_m.max(TALL_M)).sqrt();
        let rolls = width_m.iter().any(|width| *width > widest_m);
        let size = [width_m[0].min(widest_m), width_m[1].min(widest_m), height_m];
        let middle = |axis: usize| (fence.min[axis] + fence.max[axis]) / 2.0;
        let middle_m = floor_m + height_m / 2.0;
        let centre = match rolls {
            true => Vector3::new(home.x, home.y, middle_m),
            false => Vector3::new(middle(0), middle(1), middle_m),
        };
        let config = VoxelMapConfig {
            resolution_m: RESOLUTION_M,
            size_m: size,
            max_range_m: MAP_RANGE_M,
            ground_m: home.z + GROUND_M,
            vertical_extent_m: VERTICAL_EXTENT_M,
            ..VoxelMapConfig::default()
        };
        Ok(Self {
            map: ClearanceMap::new(config, centre, CLEARANCE_RANGE_M)?,
            fence: *fence,
            home,
            heights_m: [floor_m, ceiling_m],
            last_scan: None,
            ends: Vec::new(),
            rays: FreeRays::default(),
            near: Vec::new(),
            near_m: NEAR_M,
            returns: Vec::new(),
            ground_m: config.ground_m,
            rolls,
            allows_for_m: 0.0,
            far_ray: 0,
        })
    }

    /// The vehicle is of this envelope from now on.
    pub fn handle(&mut self, envelope: &Envelope) {
        self.near_m = NEAR_M.max(envelope.filter().obstacle_reach_m()).min(MAP_RANGE_M);
    }

    /// The same of a world in which some places are known to be closed.
    #[must_use]
    pub fn with_keep_out(self, keep_out: KeepOut) -> Self {
        Self { map: self.map.with_keep_out(keep_out), ..self }
    }

    /// These places are known to be closed from now on, in place of those before.
    pub fn close(&mut self, airspace: Airspace) {
        let [margin_m, clearance_m] =
            [ZONE_MARGIN_M, TERRAIN_CLEARANCE_M].map(|kept_m| kept_m + self.allows_for_m);
        self.map.set_keep_out(KeepOut::new(airspace, margin_m, clearance_m));
    }

    /// Lets paths come as low and as high as these heights too, m ENU; where the map does not reach so far it is made
    /// anew, and keeps what it has seen.
    pub fn reach(&mut self, heights_m: impl IntoIterator<Item = f64>) {
        let least_m = self.home.z + LEAST_HEIGHT_M;
        let [mut floor_m, mut ceiling_m] = self.heights_m;
        for height_m in heights_m.into_iter().filter(|height_m| height_m.is_finite()) {
            floor_m = floor_m.min((height_m - BELOW_WAYPOINTS_M).max(least_m));
            ceiling_m = ceiling_m.max(height_m);
        }
        if [floor_m, ceiling_m] == self.heights_m {
            return;
        }
        self.make_anew([floor_m, ceiling_m], &Vector3::zeros());
    }

    /// Moves all that has been seen, because the position that it was placed by has jumped by as much; ENU, m.
    pub fn shift(&mut self, by: &Vector3<f64>) {
        for point in self.near.iter_mut().chain(&mut self.returns) {
            *point += by;
        }
        self.make_anew(self.heights_m, by);
    }

    /// Makes the map anew for these heights, with what it has seen moved.
    fn make_anew(&mut self, heights_m: [f64; 2], moved: &Vector3<f64>) {
        let Ok(mut anew) = Self::new(&self.fence, self.home, heights_m) else { return };
        if let Some(keep_out) = self.map.keep_out() {
            anew = anew.with_keep_out(keep_out.clone());
        }
        if self.rolls {
            let voxels = self.map.voxels();
            anew.map.recentre(&((voxels.clamp(&FAR_CORNER) + voxels.clamp(&-FAR_CORNER)) / 2.0 + moved));
        }
        for seen in self.map.voxels().hits() {
            let point = seen + moved;
            anew.map.integrate(point, &[RayEnd { point, hit: true }]);
        }
        (self.map, self.heights_m) = (anew.map, anew.heights_m);
    }

    /// Widens the margins around known places by how far the vehicle's position may be off, in steps; m.
    pub fn allow_for(&mut self, off_m: f64) {
        let off_m = (off_m / ALLOWANCE_STEP_M).ceil() * ALLOWANCE_STEP_M;
        let shrinks_little =
            (ALLOWANCE_STEP_M..=1.5 * ALLOWANCE_STEP_M).contains(&(self.allows_for_m - off_m));
        if off_m != self.allows_for_m && !shrinks_little {
            self.allows_for_m = off_m;
            self.map.set_margins(ZONE_MARGIN_M + off_m, TERRAIN_CLEARANCE_M + off_m);
        }
    }

    pub fn map(&self) -> &ClearanceMap {
        &self.map
    }

    /// The map, to let a planner track the layers it searches.
    pub fn map_mut(&mut self) -> &mut ClearanceMap {
        &mut self.map
    }

    /// The nearest obstacle point in each direction, of the newest scan; metres ENU.
    pub fn obstacles(&self) -> &[Vector3<f64>] {
        &self.near
    }

    /// All obstacle points within the range of the map, of the newest scan; metres ENU. Neither neighbours are among
    /// them nor the ground, which a beam meets when the vehicle pitches.
    pub fn returns(&self) -> &[Vector3<f64>] {
        &self.returns
    }

    /// The rays of the newest scan, which reach further than the map.
    pub fn rays(&self) -> &FreeRays {
        &self.rays
    }

    /// When the newest scan was taken.
    pub fn last_scan(&self) -> Option<Duration> {
        self.last_scan
    }

    /// Takes in a scan that was taken at `pose`, while `neighbours` were at these positions, and `movers`, which tell
    /// nobody: they are kept clear of, and not remembered. What no scan has seen again for long is forgotten; without
    /// scans nothing is. A scan of which half is no measurement is none, and returns `false`.
    pub fn take_in(
        &mut self,
        scan: &Scan,
        pose: &Pose,
        neighbours: &[Other],
        movers: &[separation::Neighbour],
    ) -> bool {
        let measured = scan.ranges_m.iter().filter(|range| is_measured(**range)).count();
        if 2 * measured <= scan.ranges_m.len() {
            return false;
        }
        self.last_scan = Some(scan.stamp);
        self.ends.clear();
        self.rays.clear();
        self.returns.clear();
        let mut near = Sectors::new(pose.position);
        let to_world = pose.attitude.to_rotation_matrix();
        self.far_ray = (self.far_ray + 1) % FAR_RAYS;
        for (ray, &range) in (0_u32..).zip(&scan.ranges_m) {
            if !is_measured(range) {
                continue;
            }
            let range = f64::from(range);
            let hit = range.is_finite() && range <= scan.max_range_m;
            let (sin, cos) = (scan.angle_min + f64::from(ray) * scan.angle_step).sin_cos();
            let reach = if hit { range } else { scan.max_range_m };
            let point = pose.position + to_world * Vector3::new(reach * cos, reach * sin, 0.0);
            self.rays.add(RayEnd { point, hit: hit && point.z > self.ground_m });
            // The voxels are wider than the rays are far apart.
            if (!hit || range > MAP_RANGE_M) && ray % FAR_RAYS != self.far_ray {
                continue;
            }
            let off_m = |other: &Other| (point - other.position).norm();
            if hit && neighbours.iter().any(|other| off_m(other) < NEIGHBOUR_M) {
                // The way to the neighbour is free; what lies behind it is not known.
                let point = pose.position + (point - pose.position) * (1.0 - (NEIGHBOUR_M / range).min(1.0));
                self.ends.push(RayEnd { point, hit: false });
                continue;
            }
            if hit && range < MAP_RANGE_M && point.z > self.ground_m {
                self.returns.push(point);
                if range < self.near_m {
                    near.add(point);
                }
            }
            let is_of = |mover: &separation::Neighbour| {
                (point - mover.position).xy().norm() < mover.radius_m + MOVER_M
            };
            if hit && movers.iter().any(is_of) {
                let point = pose.position + (point - pose.position) * (1.0 - (MOVER_M / range).min(1.0));
                self.ends.push(RayEnd { point, hit: false });
                continue;
            }
            // Where a neighbour may be, given both errors, is nothing to remember; but it is kept clear of.
            if hit && neighbours.iter().any(|other| off_m(other) < NEIGHBOUR_M + other.off_m) {
                continue;
            }
            self.ends.push(RayEnd { point, hit });
        }
        for (distance, direction) in [(scan.up_m, Vector3::z()), (scan.down_m, -Vector3::z())] {
            let point = distance.map(|distance| pose.position + to_world * direction * f64::from(distance));
            let near_neighbour = |point: &Vector3<f64>| {
                neighbours.iter().any(|other| (point - other.position).norm() < NEIGHBOUR_M + other.off_m)
            };
            // Only what stands near the column matters: what lies far below a cone's edge is no obstacle yet.
            if let Some(point) = point.filter(|point| !near_neighbour(point)) {
                self.ends.push(RayEnd { point, hit: true });
            }
        }
        let rows = self.rows(scan, pose, neighbours);
        let is_near = |point: &&Vector3<f64>| (*point - pose.position).norm() < self.near_m;
        rows.iter().filter(is_near).for_each(|point| near.add(*point));
        self.near = near.points().collect();
        if self.rolls {
            self.map.recentre(&pose.position);
        }
        self.map.fade(scan.stamp);
        self.map.integrate(pose.position, &self.ends);
        for point in rows {
            // The way there was not looked along.
            self.map.integrate(point, &[RayEnd { point, hit: true }]);
        }
        true
    }

    /// What the upright lidar sees and the level one does not: cables, bars, edges of roofs. It sees a slice
    /// of them, so each point stands for a row across its plane, as a point of the level one stands for a
    /// column.
    fn rows(&self, scan: &Scan, pose: &Pose, neighbours: &[Other]) -> Vec<Vector3<f64>> {
        let to_world = pose.attitude.to_rotation_matrix();
        let Some(side) = (to_world * Vector3::y()).xy().try_normalize(1e-6) else { return Vec::new() };
        let step = std::f64::consts::TAU / scan.upright_m.len().max(1) as f64;
        let mut seen: Vec<Vector3<f64>> = Vec::new();
        for (ray, &range) in (0_u32..).zip(&scan.upright_m) {
            let range = f64::from(range);
            if !(OWN_FRAME_M..MAP_RANGE_M.min(scan.max_range_m)).contains(&range) {
                continue;
            }
            let (sin, cos) = (f64::from(ray) * step).sin_cos();
            let point = pose.position + to_world * Vector3::new(range * cos, 0.0, range * sin);
            let is_one = seen.last().is_some_and(|last| (last - point).norm() < 0.5 * RESOLUTION_M);
            let is_other = |other: &Other| (point - other.position).norm() < NEIGHBOUR_M + other.off_m;
            if point.z > self.ground_m && !is_one && !neighbours.iter().any(is_other) {
                seen.push(point);
            }
        }
        let is_upright =
            |point: &Vector3<f64>| self.returns.iter().any(|other| (other - point).xy().norm() < UPRIGHT_M);
        let half = (ROW_HALF_M / RESOLUTION_M) as i32;
        let thin = seen.into_iter().filter(|point| !is_upright(point));
        let row = |point: Vector3<f64>| {
            (-half..=half).map(move |k| point + (side * (f64::from(k) * RESOLUTION_M)).push(0.0))
        };
        thin.flat_map(row).collect()
    }
}

/// Whether a ray tells something, if only that nothing came back from beyond the greatest range (infinite): not a NaN,
/// nor nearer than the vehicle's own frame.
fn is_measured(range_m: f32) -> bool {
    f64::from(range_m) >= OWN_FRAME_M
}

/// The least and the greatest height in the world at which a mission may fly, metres.
fn heights(config: &AgentConfig) -> [f64; 2] {
    let [_, _, home_m] = config.home;
    let waypoints = config.waypoints.iter().chain(&config.rally).map(|[_, _, z]| *z);
    let heights = || waypoints.clone().chain([config.return_altitude_m, home_m + config.takeoff_height_m]);
    let lowest_m = heights().fold(f64::INFINITY, f64::min) - BELOW_WAYPOINTS_M;
    [lowest_m.max(home_m + LEAST_HEIGHT_M), heights().fold(0.0, f64::max) + ABOVE_WAYPOINTS_M]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What 720 rays return over flat ground, and of a wall across the way ahead.
    fn scan(pose: &Pose, wall_m: f64) -> Scan {
        let angle_step = std::f64::consts::TAU / 720.0;
        let range = |ray: u32| {
            let (sin, cos) = (f64::from(ray) * angle_step).sin_cos();
            let direction = pose.attitude * Vector3::new(cos, sin, 0.0);
            let ground = if direction.z < 0.0 { pose.position.z / -direction.z } else { f64::INFINITY };
            let wall =
                if direction.x > 0.0 { (wall_m - pose.position.x) / direction.x } else { f64::INFINITY };
            ground.min(wall) as f32
        };
        Scan {
            stamp: Duration::ZERO,
            angle_min: 0.0,
            angle_step,
            max_range_m: 40.0,
            ranges_m: (0..720).map(range).collect(),
            up_m: None,
            down_m: None,
            upright_m: Vec::new(),
        }
    }

    fn seen(height_m: f64, pitch_deg: f64, wall_m: f64) -> Vec<Vector3<f64>> {
        let fence = Fence { min: [-30.0, -30.0, -1.0], max: [30.0, 30.0, 10.0] };
        let mut perception = Perception::new(&fence, Vector3::zeros(), [0.6, 5.0]).unwrap();
        let pose = Pose {
            position: Vector3::new(0.0, 0.0, height_m),
            attitude: UnitQuaternion::from_euler_angles(0.0, pitch_deg.to_radians(), 0.0),
        };
        perception.take_in(&scan(&pose, wall_m), &pose, &[], &[]);
        perception.returns().to_vec()
    }

    #[test]
    fn the_ground_that_a_pitched_beam_meets_is_no_obstacle() {
        // Nose down by 12 degrees at 0.9 m, beams meet the ground 4.3 m ahead.
        assert!(seen(0.9, 12.0, 100.0).is_empty());
        assert!(!seen(0.9, 12.0, 2.0).is_empty(), "but a wall is");
    }

    #[test]
    fn what_only_the_upright_lidar_sees_stands_for_a_row_across() {
        let fence = Fence { min: [-30.0, -30.0, -1.0], max: [30.0, 30.0, 10.0] };
        let mut perception = Perception::new(&fence, Vector3::zeros(), [0.6, 8.0]).unwrap();
        let pose = Pose { position: Vector3::new(0.0, 0.0, 3.0), attitude: UnitQuaternion::identity() };
        // A cable 5 m ahead and 0.5 m higher, and a wall 8 m behind, which the level lidar sees too.
        let ray = |ray: usize| match ray {
            57 => (5.0_f64.hypot(0.5)) as f32,
            1800 => 8.0,
            1805 => (8.0 / (1805.0_f64 * std::f64::consts::TAU / 3600.0).cos().abs()) as f32,
            _ => f32::INFINITY,
        };
        let mut seen = Scan { upright_m: (0..3600).map(ray).collect(), ..scan(&pose, 100.0) };
        seen.ranges_m[360] = 8.0;
        perception.take_in(&seen, &pose, &[], &[]);
        let clearance_m = |x, y, z| perception.map().clearance(&Vector3::new(x, y, z));
        for y in [-2.5, 0.0, 2.5] {
            assert!(clearance_m(5.0, y, 3.5) < 0.3, "the cable at {y}");
        }
        assert!(clearance_m(5.0, 4.5, 3.5) > 1.0 && clearance_m(5.0, 0.0, 5.5) > 1.0, "it ends somewhere");
        assert!(clearance_m(-8.0, 1.5, 3.0) > 1.0, "what is upright is no row");
        let ahead = perception.obstacles().iter().filter(|point| point.x > 4.5).count();
        assert!(ahead >= 8, "the filter keeps off {ahead} points of it");
    }

    #[test]
    fn what_is_far_away_is_not_among_the_returns() {
        assert!(seen(3.0, 0.0, 12.0).is_empty());
        assert!(seen(3.0, 0.0, 4.0).iter().all(|point| point.z > 2.0));
    }

    #[test]
    fn a_ray_without_a_measurement_leaves_its_way_unknown_and_half_a_scan_of_them_is_none() {
        let fence = Fence { min: [-30.0, -30.0, -1.0], max: [30.0, 30.0, 10.0] };
        let pose = Pose { position: Vector3::new(0.0, 0.0, 3.0), attitude: UnitQuaternion::identity() };
        let free_m = |invalid: f32, rays: std::ops::Range<usize>| {
            let mut perception = Perception::new(&fence, Vector3::zeros(), [0.6, 5.0]).unwrap();
            let mut scan = scan(&pose, 100.0);
            scan.ranges_m[rays].fill(invalid);
            // Of the far rays one in three is followed in each scan.
            let taken = (0..3).all(|_| perception.take_in(&scan, &pose, &[], &[]));
            let voxels = perception.map().voxels();
            taken.then(|| {
                [0.0, 1.0].map(|y| voxels.sensed_free_m(&pose.position, &Vector3::new(1.0 - y, y, 0.0), 9.0))
            })
        };
        // The first rays point ahead, the 180th to the left.
        let [ahead, left] = free_m(f32::NAN, 0..60).unwrap();
        assert!(ahead < 1.0 && left == 9.0, "{ahead}, {left}");
        assert_eq!(free_m(f32::INFINITY, 0..60), Some([9.0, 9.0]), "nothing came back: free");
        assert_eq!(free_m(f32::NAN, 0..360), None);
        assert_eq!(free_m(0.0, 100..700), None);
        assert_eq!(free_m(-1.0, 0..0), Some([9.0, 9.0]));
    }

    #[test]
    fn an_obstacle_that_has_gone_unseen_frees_its_way() {
        let fence = Fence { min: [-30.0, -30.0, -1.0], max: [30.0, 30.0, 10.0] };
        let mut perception = Perception::new(&fence, Vector3::zeros(), [0.6, 8.0]).unwrap();
        let place = Vector3::new(4.1, 0.0, 3.0);
        let mut look = |from: Vector3<f64>, wall_m: f64, second: u64| {
            let pose = Pose { position: from, attitude: UnitQuaternion::identity() };
            let scan = Scan { stamp: Duration::from_secs(second), ..scan(&pose, wall_m) };
            perception.take_in(&scan, &pose, &[], &[]);
            perception.map().clearance(&place)
        };
        let before = Vector3::new(0.0, 0.0, 3.0);
        // Seen for ten minutes, it stays; by then its evidence is at its most.
        for second in 0..600 {
            assert!(look(before, 4.1, second) < 0.2, "not there at {second} s");
        }
        // The vehicle flies above, from where nothing of it is seen, and meanwhile it goes.
        let above = Vector3::new(0.0, 0.0, 6.0);
        for second in 600..890 {
            assert!(look(above, 100.0, second) < 0.2, "forgotten at {second} s");
        }
        let later = (890..910).map(|second| look(above, 100.0, second)).last();
        assert!(later > Some(2.4), "free as far as clearance is told apart: {later:?}");
    }

    #[test]
    fn what_moves_is_kept_clear_of_and_not_remembered() {
        let fence = Fence { min: [-30.0, -30.0, -1.0], max: [30.0, 30.0, 10.0] };
        let mut perception = Perception::new(&fence, Vector3::zeros(), [0.6, 5.0]).unwrap();
        let position = Vector3::new(0.0, 0.0, 2.0);
        let pose = Pose { position, attitude: UnitQuaternion::identity() };
        let mover = separation::Neighbour {
            id: 1,
            position: Vector3::new(4.2, 0.0, 2.0),
            velocity: Vector3::new(0.0, 1.0, 0.0),
            sigma_m: 0.1,
            age_s: 0.0,
            radius_m: 0.25,
            cooperative: false,
        };
        perception.take_in(&scan(&pose, 4.0), &pose, &[], &[mover]);
        assert!(perception.obstacles().iter().any(|point| (point - mover.position).norm() < 0.5));
        let clearance_m = |y: f64| perception.map().clearance(&Vector3::new(4.1, y, 2.0));
        assert!(clearance_m(0.0) > 0.2 && clearance_m(2.0) < 0.2, "of the wall the rest is remembered");
    }
}
