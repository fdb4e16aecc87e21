//! From where a camera sees markers as it does.

use std::time::Duration;

use nalgebra::{
    Isometry3, Matrix2x6, Matrix6, Point3, Translation3, UnitQuaternion, Vector2, Vector3, Vector6,
};

use super::camera::Camera;
use super::detect::Detection;
use super::layout::{Layout, Placed};
use super::plane;
use crate::fix::PoseFix;

/// Least standard deviation of corners, across and down, pixels.
const CORNER_SIGMA_PX: f64 = 0.15;
/// Residuals of few degrees of freedom are small by chance: three sigma grow by this over their number and four, about
/// as Student's distribution has it.
const SCARCITY: f64 = 3.0;
/// So many of the largest markers propose where the camera is.
const PROPOSERS: usize = 12;
/// A marker that is farther off than this share of its own side tells a proposal no more.
const FAR_SHARE: f64 = 0.25;
/// Rounds of robust refinement.
const ROUNDS: usize = 4;
/// A marker this many times farther off than most is not where the layout says.
const OUTLIER: f64 = 3.5;
/// Steps of a refinement at most.
const STEPS: usize = 30;
/// Poses whose rotations differ less than this are one, rad.
const SAME_RAD: f64 = 2e-3;
/// The other pose is possible up to this difference of the sums of squares, in variances: 99.9 % of two degrees of
/// freedom.
const POSSIBLE: f64 = 13.8;
/// Markers lie in one plane up to this share of their extent.
const FLAT_SHARE: f64 = 1e-3;

/// Finds where the body is from the markers that its camera sees.
#[derive(Clone, Debug)]
pub struct Solver {
    camera: Camera,
    camera_to_body: Isometry3<f64>,
    body_to_camera: Isometry3<f64>,
    corner_sigma_px: f64,
}

/// Where the body may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Body FLU to world ENU.
    pub body_to_world: Isometry3<f64>,
    /// As in [`PoseFix`]: of the position on the world's axes, m², and the orientation about the body's axes, rad².
    pub covariance: Matrix6<f64>,
    /// The distance of the corners from where this pose has them, root of the mean square of their distances, pixels.
    pub rms_px: f64,
}

/// Where the body is, from one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// The pose that explains the image best.
    pub best: Solution,
    /// The other pose from which a plane of markers looks like that, if there is one.
    pub twin: Option<Solution>,
    /// Whether the image alone does not tell the two apart.
    pub is_ambiguous: bool,
    /// The markers that the pose rests on, by id.
    pub used: Vec<u32>,
    /// Markers of the layout that are not where it says, or were misread.
    pub rejected: Vec<u32>,
}

impl Sighting {
    /// The sighting as a fix, for an image of this moment. Of two possible poses the one whose tilt is nearer to the
    /// believed attitude (body to world) counts; without a belief the better one does, and its covariance spans both.
    pub fn fix(&self, stamp: Duration, believed: Option<&UnitQuaternion<f64>>) -> PoseFix {
        let Solution { body_to_world, covariance, .. } =
            match (self.twin.filter(|_| self.is_ambiguous), believed) {
                (None, _) => self.best,
                (Some(twin), None) => spanning(&self.best, &twin),
                (Some(twin), Some(believed)) => {
                    let off = |solution: &Solution| tilt_between(&solution.body_to_world.rotation, believed);
                    if off(&twin) < off(&self.best) { twin } else { self.best }
                }
            };
        PoseFix {
            stamp,
            position: body_to_world.translation.vector,
            body_to_world: body_to_world.rotation,
            covariance,
        }
    }
}

/// The angle between what two attitudes take for up, rad.
fn tilt_between(one: &UnitQuaternion<f64>, other: &UnitQuaternion<f64>) -> f64 {
    (one.inverse() * Vector3::z()).angle(&(other.inverse() * Vector3::z()))
}

/// A solution whose covariance holds another one, too.
fn spanning(best: &Solution, twin: &Solution) -> Solution {
    let turn = best.body_to_world.rotation.inverse() * twin.body_to_world.rotation;
    let shift = twin.body_to_world.translation.vector - best.body_to_world.translation.vector;
    let mut between = Vector6::zeros();
    between.fixed_rows_mut::<3>(0).copy_from(&shift);
    between.fixed_rows_mut::<3>(3).copy_from(&turn.scaled_axis());
    Solution { covariance: best.covariance + between * between.transpose() * 0.5, ..*best }
}

/// A marker that was seen, and where it is.
#[derive(Clone, Debug)]
struct Seen {
    placed: Placed,
    corners: [Corner; 4],
    /// The mean side in the image.
    side_px: f64,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    /// World ENU, m.
    world: Vector3<f64>,
    pixel: Vector2<f64>,
    /// The ray that shows it, at z = 1.
    ray: Vector2<f64>,
}

impl Solver {
    /// A solver for a camera that is mounted on the body so. Camera frame: x to the image's right, y down, z forward.
    pub fn new(camera: Camera, camera_to_body: Isometry3<f64>) -> Self {
        let body_to_camera = camera_to_body.inverse();
        Self { camera, camera_to_body, body_to_camera, corner_sigma_px: CORNER_SIGMA_PX }
    }

    /// The same for a camera whose corners are found less well, standard deviation across and down, pixels.
    pub fn with_corner_sigma(self, sigma_px: f64) -> Self {
        Self { corner_sigma_px: sigma_px.max(1e-3), ..self }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// From the camera's frame to the body's.
    pub fn camera_to_body(&self) -> &Isometry3<f64> {
        &self.camera_to_body
    }

    /// Where the body is; `None` if no marker of the layout is seen, or if no more than half of those seen agree.
    pub fn solve(&self, layout: &Layout, detections: &[Detection]) -> Option<Sighting> {
        let seen: Vec<Seen> =
            detections.iter().filter_map(|detection| self.placed(layout, detection)).collect();
        let rough = self.propose(&seen)?;
        let robust = self.refine_robustly(rough, &seen)?;
        let limit = self.outlier_limit(&robust, &seen);
        let (used, rejected): (Vec<_>, Vec<_>) =
            seen.into_iter().partition(|marker| self.off(&robust, marker) <= limit);
        if used.len() <= rejected.len() {
            return None;
        }
        let (best, twin) = self.both(robust, &used)?;
        let is_ambiguous = twin.is_some_and(|twin| self.is_possible(&best, &twin, used.len()));
        let ids = |markers: &[Seen]| markers.iter().map(|marker| marker.placed.id).collect();
        Some(Sighting { best, twin, is_ambiguous, used: ids(&used), rejected: ids(&rejected) })
    }

    fn placed(&self, layout: &Layout, detection: &Detection) -> Option<Seen> {
        let placed = *layout.get(detection.id)?;
        let world = placed.corners();
        let mut corners = [Corner { world: world[0], pixel: Vector2::zeros(), ray: Vector2::zeros() }; 4];
        for ((corner, world), pixel) in corners.iter_mut().zip(world).zip(detection.corners) {
            *corner = Corner { world, pixel, ray: self.camera.ray(pixel)? };
        }
        let side = |n: usize| (corners[(n + 1) % 4].pixel - corners[n].pixel).norm();
        let side_px = (0..4).map(side).sum::<f64>() / 4.0;
        Some(Seen { placed, corners, side_px })
    }

    /// Where one of the larger markers alone has the body, so that the others are least off.
    fn propose(&self, seen: &[Seen]) -> Option<Isometry3<f64>> {
        let mut largest: Vec<&Seen> = seen.iter().collect();
        largest.sort_by(|a, b| b.side_px.total_cmp(&a.side_px));
        let proposed =
            largest.into_iter().take(PROPOSERS).filter_map(|one| self.of_plane(std::slice::from_ref(one)));
        let misfit = |body: &Isometry3<f64>| -> f64 {
            let off = |marker: &Seen| self.off(body, marker).min(FAR_SHARE * marker.side_px).powi(2);
            seen.iter().map(off).sum()
        };
        proposed
            .flatten()
            .map(|body| (misfit(&body), body))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, body)| body)
    }

    /// Both poses of the body from markers that lie in the plane of the first of them.
    fn of_plane(&self, markers: &[Seen]) -> Option<[Isometry3<f64>; 2]> {
        let to_plane = markers.first()?.placed.to_world.inverse();
        let corners = markers.iter().flat_map(|marker| &marker.corners);
        let in_plane: Vec<_> =
            corners.map(|corner| ((to_plane * Point3::from(corner.world)).coords, corner.ray)).collect();
        let extent = in_plane.iter().map(|(point, _)| point.norm()).fold(0.0, f64::max);
        if in_plane.iter().any(|(point, _)| point.z.abs() > FLAT_SHARE * extent) {
            return None;
        }
        let pairs: Vec<_> = in_plane.into_iter().map(|(point, ray)| (point.xy(), ray)).collect();
        let body = |to_camera: Isometry3<f64>| to_plane.inverse() * to_camera.inverse() * self.body_to_camera;
        plane::poses(&pairs).map(|poses| poses.map(body))
    }

    /// The distance of a marker's corners from where a pose has them: root of the mean square of their distances across
    /// and down, pixels.
    fn off(&self, body: &Isometry3<f64>, marker: &Seen) -> f64 {
        let square = |corner: &Corner| {
            let seen = self.camera.project(&self.in_camera(body, corner.world).1);
            seen.map_or(f64::INFINITY, |seen| (corner.pixel - seen).norm_squared())
        };
        (marker.corners.iter().map(square).sum::<f64>() / 8.0).sqrt()
    }

    /// A point of the world in the body's and in the camera's frame.
    fn in_camera(&self, body: &Isometry3<f64>, world: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let in_body = body.rotation.inverse() * (world - body.translation.vector);
        (in_body, (self.body_to_camera * Point3::from(in_body)).coords)
    }

    /// The pose from which most markers are where they should be, however far the others are off.
    fn refine_robustly(&self, rough: Isometry3<f64>, seen: &[Seen]) -> Option<Isometry3<f64>> {
        let mut body = rough;
        for _ in 0..ROUNDS {
            let scale = self.typical(&body, seen).max(self.corner_sigma_px) * 2.0;
            body = self.refine(body, seen, scale)?.0;
        }
        Some(body)
    }

    /// Error of most markers, pixels.
    fn typical(&self, body: &Isometry3<f64>, seen: &[Seen]) -> f64 {
        let mut off: Vec<f64> = seen.iter().map(|marker| self.off(body, marker)).collect();
        off.sort_by(f64::total_cmp);
        off.get(off.len() / 2).copied().unwrap_or(0.0).min(1e6)
    }

    fn outlier_limit(&self, body: &Isometry3<f64>, seen: &[Seen]) -> f64 {
        OUTLIER * self.typical(body, seen).max(self.corner_sigma_px)
    }

    /// The pose of the least sum of squares, and the other one if the markers lie in a plane.
    fn both(&self, start: Isometry3<f64>, used: &[Seen]) -> Option<(Solution, Option<Solution>)> {
        let starts = self.of_plane(used).into_iter().flatten().chain([start]);
        let mut found: Vec<Solution> = starts.filter_map(|start| self.solution(start, used)).collect();
        found.sort_by(|a, b| a.rms_px.total_cmp(&b.rms_px));
        let best = *found.first()?;
        let is_other =
            |other: &Solution| other.body_to_world.rotation.angle_to(&best.body_to_world.rotation) > SAME_RAD;
        Some((best, found.into_iter().find(is_other)))
    }

    fn is_possible(&self, best: &Solution, other: &Solution, markers: usize) -> bool {
        let sum = |solution: &Solution| solution.rms_px.powi(2) * 4.0 * markers as f64;
        sum(other) - sum(best) < POSSIBLE * self.variance(sum(best), markers)
    }

    /// The variance of a corner's place across and down that residuals tell, pixels², greater where few tell it.
    fn variance(&self, sum: f64, markers: usize) -> f64 {
        let free = 8.0 * markers as f64 - 6.0;
        (sum / free).max(self.corner_sigma_px.powi(2)) * (1.0 + SCARCITY / (free + 4.0)).powi(2)
    }

    fn solution(&self, start: Isometry3<f64>, used: &[Seen]) -> Option<Solution> {
        let (body_to_world, sum) = self.refine(start, used, f64::INFINITY)?;
        let normal = self.normal(&body_to_world, used, f64::INFINITY)?.matrix;
        let covariance = normal.cholesky()?.inverse() * self.variance(sum, used.len());
        let rms_px = (sum / (4.0 * used.len() as f64)).sqrt();
        covariance.iter().all(|entry| entry.is_finite()).then_some(Solution {
            body_to_world,
            covariance,
            rms_px,
        })
    }

    /// The pose of the least sum of squares near a first one, with that sum (Levenberg and Marquardt). Markers that
    /// are farther off than `scale` count less and less (Geman and McClure).
    fn refine(&self, start: Isometry3<f64>, seen: &[Seen], scale: f64) -> Option<(Isometry3<f64>, f64)> {
        let mut body = start;
        let mut here = self.normal(&body, seen, scale)?;
        let mut damping = 1e-4;
        for _ in 0..STEPS {
            let mut damped = here.matrix;
            (0..6).for_each(|n| damped[(n, n)] *= 1.0 + damping);
            let step = damped.cholesky()?.solve(&here.right);
            let next = moved(&body, &step);
            match self.normal(&next, seen, scale).filter(|there| there.sum <= here.sum) {
                Some(there) => {
                    let gain = here.sum - there.sum;
                    (body, here, damping) = (next, there, damping * 0.1);
                    if gain <= 1e-12 * here.sum || step.amax() < 1e-10 {
                        break;
                    }
                }
                None if damping > 1e6 => break,
                None => damping *= 10.0,
            }
        }
        Some((body, here.sum))
    }

    /// The normal equations at a pose; `None` if a marker that counts is out of sight from there.
    fn normal(&self, body: &Isometry3<f64>, seen: &[Seen], scale: f64) -> Option<Normal> {
        let mut normal = Normal { matrix: Matrix6::zeros(), right: Vector6::zeros(), sum: 0.0 };
        for marker in seen {
            let (weight, cost) = robust(self.off(body, marker).powi(2) * 8.0, 8.0 * scale * scale);
            normal.sum += cost;
            if weight > 1e-6 {
                for corner in &marker.corners {
                    self.add(&mut normal, body, corner, weight)?;
                }
            }
        }
        normal.sum.is_finite().then_some(normal)
    }

    fn add(&self, normal: &mut Normal, body: &Isometry3<f64>, corner: &Corner, weight: f64) -> Option<()> {
        let (in_body, in_camera) = self.in_camera(body, corner.world);
        let (pixel, slope) = self.camera.look(&in_camera)?;
        let slope = slope * self.body_to_camera.rotation.to_rotation_matrix();
        let mut jacobian = Matrix2x6::zeros();
        let of_shift = slope * body.rotation.inverse().to_rotation_matrix();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&-of_shift);
        jacobian.fixed_columns_mut::<3>(3).copy_from(&(slope * in_body.cross_matrix()));
        normal.matrix += jacobian.transpose() * jacobian * weight;
        normal.right += jacobian.transpose() * (corner.pixel - pixel) * weight;
        Some(())
    }
}

/// Normal equations of a step of the body's pose, and the sum of squares that it is to lessen.
struct Normal {
    matrix: Matrix6<f64>,
    right: Vector6<f64>,
    sum: f64,
}

/// The weight and the cost of a sum of squares.
fn robust(square: f64, scale: f64) -> (f64, f64) {
    if scale.is_infinite() {
        return (1.0, square);
    }
    if square.is_infinite() {
        return (0.0, scale);
    }
    let share = scale / (scale + square);
    (share * share, square * share)
}

/// A pose shifted on the world's axes and turned about the body's.
fn moved(body: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let (shift, turn) = (step.fixed_rows::<3>(0), step.fixed_rows::<3>(3));
    let rotation = body.rotation * UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    Isometry3::from_parts(Translation3::from(body.translation.vector + shift), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::markers::{Dictionary, Lens};

    fn camera() -> Camera {
        let lens = Lens::Radial { k: [-0.12, 0.03, 0.0, 0.0, 0.0, 0.0], p: [0.0005, -0.0003] };
        Camera::new([640, 480], [420.0, 420.0], [322.0, 238.0], lens).unwrap()
    }

    /// A floor of 100 markers, and some that hang on a wall in the north.
    fn layout() -> Layout {
        let floor = (0..100).map(|n| ([f64::from(n % 10) * 0.36, f64::from(n / 10) * 0.36, 0.0], 0.0));
        let wall = (0..4).map(|n| ([f64::from(n), 3.8, 0.4], std::f64::consts::FRAC_PI_2));
        let places = floor.chain(wall);
        let placed = places.zip(1..).map(|((place, roll), id)| Placed {
            id,
            side_m: 0.18,
            to_world: Isometry3::from_parts(place.into(), UnitQuaternion::from_euler_angles(roll, 0.0, 0.0)),
        });
        Layout::new(Dictionary::named("original").unwrap(), placed).unwrap()
    }

    /// A camera that looks down, the image's top to the nose, 5 cm before and 3 cm below the body's centre.
    fn mounting() -> Isometry3<f64> {
        let down = nalgebra::Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let turn = UnitQuaternion::from_matrix(&down);
        Isometry3::from_parts(Translation3::new(0.05, 0.0, -0.03), turn)
    }

    fn body(position: [f64; 3], roll: f64, pitch: f64, yaw: f64) -> Isometry3<f64> {
        Isometry3::from_parts(position.into(), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }

    /// Numbers of mean 0 and standard deviation 1, the same every time.
    struct Normals(u64);

    impl Normals {
        fn draw(&mut self) -> f64 {
            let mut uniform = || {
                self.0 =
                    self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    /// Sightings of some markers from a pose, with so much noise.
    fn seen(at: &Isometry3<f64>, ids: &[u32], sigma_px: f64, noise: &mut Normals) -> Vec<Detection> {
        let (camera, to_camera, layout) = (camera(), (at * mounting()).inverse(), layout());
        let look = |id: &u32| {
            let corners = layout.get(*id)?.corners();
            let mut pixels = [Vector2::zeros(); 4];
            for (pixel, corner) in pixels.iter_mut().zip(corners) {
                *pixel = camera.project(&(to_camera * Point3::from(corner)).coords)?;
                let is_inside = (0.0..640.0).contains(&pixel.x) && (0.0..480.0).contains(&pixel.y);
                *pixel += Vector2::new(noise.draw(), noise.draw()) * sigma_px;
                is_inside.then_some(())?;
            }
            Some(Detection { id: *id, corners: pixels, errors: 0 })
        };
        ids.iter().filter_map(look).collect()
    }

    fn all() -> Vec<u32> {
        (1..=104).collect()
    }

    fn error(truth: &Isometry3<f64>, found: &Isometry3<f64>) -> Vector6<f64> {
        let shift = found.translation.vector - truth.translation.vector;
        let turn = (truth.rotation.inverse() * found.rotation).scaled_axis();
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }

    #[test]
    fn the_body_is_found_where_it_is() {
        let solver = Solver::new(camera(), mounting());
        for truth in [
            body([1.4, 1.7, 1.5], 0.05, -0.1, 0.7),
            body([0.4, 2.9, 1.0], 0.0, 0.0, -2.0),
            // Floor and wall together are no plane.
            body([1.5, 2.6, 1.3], 0.0, -0.55, std::f64::consts::FRAC_PI_2),
        ] {
            let sighting = solver.solve(&layout(), &seen(&truth, &all(), 0.0, &mut Normals(1))).unwrap();
            assert!(error(&truth, &sighting.best.body_to_world).amax() < 1e-6, "{sighting:?}");
            assert!(!sighting.is_ambiguous && sighting.rejected.is_empty(), "{sighting:?}");
            assert!(sighting.used.len() >= 6, "{sighting:?}");
        }
    }

    #[test]
    fn errors_are_within_three_sigma_with_one_marker_and_with_many() {
        let mut noise = Normals(7);
        let solver = Solver::new(camera(), mounting());
        for (ids, sigma_px) in [(all(), 0.1), (vec![45], 0.1), (all(), 0.6), (vec![45, 46, 55], 0.4)] {
            let (mut inside, mut total) = (0, 0);
            for n in 0..400 {
                let tilt = [noise.draw() * 0.1, noise.draw() * 0.1];
                let at = [1.4 + noise.draw() * 0.1, 1.5 + noise.draw() * 0.1, 0.9 + 0.002 * f64::from(n)];
                let truth = body(at, tilt[0], tilt[1], noise.draw());
                let Some(sighting) = solver.solve(&layout(), &seen(&truth, &ids, sigma_px, &mut noise))
                else {
                    continue;
                };
                let fix = sighting.fix(Duration::ZERO, Some(&truth.rotation));
                let off = error(&truth, &Isometry3::from_parts(fix.position.into(), fix.body_to_world));
                let is_inside = |n: &usize| off[*n].abs() <= 3.0 * fix.covariance[(*n, *n)].sqrt();
                inside += (0..6).filter(is_inside).count();
                total += 6;
            }
            assert!(total > 2000, "{total}");
            assert!(inside * 1000 >= total * 990, "{ids:?} {sigma_px}: {inside} of {total}");
        }
    }

    #[test]
    fn a_marker_that_is_not_where_the_layout_says_is_left_out() {
        let truth = body([1.4, 1.7, 1.3], 0.05, -0.1, 0.7);
        let mut detections = seen(&truth, &all(), 0.05, &mut Normals(3));
        let wrong = detections[2].id;
        detections[2].corners.iter_mut().for_each(|corner| corner.x += 6.0);
        let misread = detections.iter_mut().find(|detection| detection.id == 46).unwrap();
        misread.id = 3;
        let sighting = Solver::new(camera(), mounting()).solve(&layout(), &detections).unwrap();
        assert_eq!(sighting.rejected, [wrong, 3]);
        assert!(error(&truth, &sighting.best.body_to_world).fixed_rows::<3>(0).norm() < 2e-3, "{sighting:?}");
    }

    #[test]
    fn two_markers_that_contradict_each_other_tell_nothing() {
        let mut detections = seen(&body([1.4, 1.7, 1.3], 0.0, 0.0, 0.0), &[45, 46], 0.05, &mut Normals(3));
        detections[1].corners.iter_mut().for_each(|corner| corner.y += 40.0);
        let solver = Solver::new(camera(), mounting());
        let sighting = solver.solve(&layout(), &detections);
        assert!(sighting.is_none_or(|sighting| sighting.best.covariance[(0, 0)].sqrt() > 0.05));
        assert_eq!(solver.solve(&layout(), &[]), None);
    }

    #[test]
    fn both_poses_of_a_small_marker_are_told_and_an_attitude_chooses() {
        // From far away, and tilted.
        let truth = body([0.6, 1.44, 6.0], 0.0, 0.25, 0.0);
        let detections = seen(&truth, &[45], 0.1, &mut Normals(5));
        let sighting = Solver::new(camera(), mounting()).solve(&layout(), &detections).unwrap();
        assert!(sighting.is_ambiguous, "{sighting:?}");
        let chosen = sighting.fix(Duration::ZERO, Some(&truth.rotation));
        assert!((chosen.position - truth.translation.vector).norm() < 0.6, "{chosen:?}");
        let open = sighting.fix(Duration::ZERO, None);
        let off = error(&truth, &Isometry3::from_parts(open.position.into(), open.body_to_world));
        for n in 0..6 {
            assert!(off[n].abs() <= 3.0 * open.covariance[(n, n)].sqrt(), "{n}: {off}");
        }
    }

    #[test]
    fn garbage_is_refused_without_a_panic() {
        let solver = Solver::new(camera(), mounting());
        for corners in
            [[[0.0, 0.0]; 4], [[f64::NAN, 1.0]; 4], [[1e9, 0.0], [0.0, 0.0], [5.0, 5.0], [9.0, 9.0]]]
        {
            let corners = corners.map(Vector2::from);
            assert_eq!(solver.solve(&layout(), &[Detection { id: 45, corners, errors: 0 }]), None);
        }
    }
}
