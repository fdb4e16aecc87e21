//! A camera that looks down on markers: the poses that are worked out from what it sees, without the picture.
//!
//! Which markers are seen follows from geometry. Each corner that is seen has a small error in the picture; the
//! covariance of a fix is what least squares over all corners make of it, and the fix has an error of that covariance.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::{Matrix2x6, Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};
use skein_positioning::PoseFix;

use crate::noise::Noise;
use crate::quadrotor::RigidState;
use crate::vehicle::FloorCameraModel;

/// Square markers on the ground, row by row from id 1, whose centre is the origin; rows are along x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerFloor {
    pub columns: u32,
    pub rows: u32,
    /// Edge of a marker, m.
    pub side_m: f64,
    /// From centre to centre, m.
    pub pitch_m: f64,
}

impl MarkerFloor {
    /// The floor of Zhang 2019: ten by ten, 18 cm, with gaps of as much.
    pub const PUBLISHED: Self = Self { columns: 10, rows: 10, side_m: 0.18, pitch_m: 0.36 };

    /// The centre of a marker by its id, from 1, m.
    #[must_use]
    pub fn centre(&self, id: u32) -> Vector3<f64> {
        let index = id.saturating_sub(1);
        let columns = self.columns.max(1);
        let [column, row] = [index % columns, index / columns].map(f64::from);
        Vector3::new(column * self.pitch_m, row * self.pitch_m, 0.0)
    }

    fn corners(&self, id: u32) -> [Vector3<f64>; 4] {
        let half_m = self.side_m / 2.0;
        let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        signs.map(|(x, y)| self.centre(id) + Vector3::new(x * half_m, y * half_m, 0.0))
    }
}

/// The camera of one vehicle.
#[derive(Debug, Clone)]
pub(crate) struct FloorCamera {
    model: FloorCameraModel,
    noise: Noise,
    /// Fixes that are still being worked out, oldest first.
    coming: VecDeque<PoseFix>,
}

impl FloorCamera {
    pub(crate) fn new(model: FloorCameraModel, noise: Noise) -> Self {
        Self { model, noise, coming: VecDeque::new() }
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.model.rate_hz
    }

    /// Looks at the floor from here.
    pub(crate) fn look(&mut self, now: Duration, floor: &MarkerFloor, state: &RigidState) {
        let mut information = Matrix6::zeros();
        for id in 1..=floor.columns.saturating_mul(floor.rows) {
            let seen = floor.corners(id).map(|corner| self.sees(state, &corner));
            if let [Some(a), Some(b), Some(c), Some(d)] = seen {
                information += [a, b, c, d].iter().map(|seen| seen.transpose() * seen).sum::<Matrix6<f64>>();
            }
        }
        let sigma = self.model.corner_sigma_rad;
        let inverse = information.try_inverse().map(|inverse| inverse * (sigma * sigma));
        let Some((covariance, root)) = inverse.and_then(|it| Some((it, it.cholesky()?.unpack()))) else {
            return;
        };
        let error: Vector6<f64> = root * Vector6::from_fn(|_, _| self.noise.normal(1.0));
        let turn = UnitQuaternion::from_scaled_axis(error.fixed_rows::<3>(3).into_owned());
        self.coming.push_back(PoseFix {
            stamp: now,
            position: state.position + error.fixed_rows::<3>(0),
            body_to_world: state.attitude * turn,
            covariance,
        });
    }

    /// How the place of a point in the picture changes with the vehicle's position (m, world) and attitude (rad, body);
    /// `None` if it is not in the picture.
    fn sees(&self, state: &RigidState, point: &Vector3<f64>) -> Option<Matrix2x6<f64>> {
        let to_body = state.attitude.inverse().to_rotation_matrix().into_inner();
        let seen = to_body * (point - state.position);
        let depth_m = -seen.z;
        let place = seen.xy() / depth_m;
        let limit = self.model.half_view_rad.tan();
        if depth_m < self.model.least_m || place.amax() > limit {
            return None;
        }
        let by_place = |moved: &Matrix3<f64>| {
            moved.fixed_rows::<2>(0) / depth_m + place * moved.fixed_rows::<1>(2) / depth_m
        };
        let mut change = Matrix2x6::zeros();
        change.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_place(&-to_body));
        change.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_place(&seen.cross_matrix()));
        Some(change)
    }

    /// Takes the fixes that have been worked out by `now`.
    pub(crate) fn take(&mut self, now: Duration) -> Vec<PoseFix> {
        let latency = Duration::from_secs_f64(self.model.latency_s.max(0.0));
        let due = self.coming.partition_point(|fix| fix.stamp + latency <= now);
        self.coming.drain(..due).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::VehicleModel;

    fn camera(seed: u64) -> FloorCamera {
        let model = VehicleModel::built_in("crazyflie-indoor").unwrap();
        FloorCamera::new(model.floor_camera.unwrap(), Noise::new(seed, 0))
    }

    fn at(x: f64, y: f64, z: f64) -> RigidState {
        RigidState {
            position: Vector3::new(x, y, z),
            velocity: Vector3::zeros(),
            attitude: UnitQuaternion::from_euler_angles(0.05, -0.08, 0.7),
            angular_rate: Vector3::zeros(),
        }
    }

    #[test]
    fn marker_55_of_the_published_floor_is_where_it_was_published() {
        assert!((MarkerFloor::PUBLISHED.centre(55) - Vector3::new(1.44, 1.80, 0.0)).norm() < 1e-12);
        assert_eq!(MarkerFloor::PUBLISHED.centre(1), Vector3::zeros());
    }

    #[test]
    fn fixes_come_late_and_are_off_by_as_much_as_they_say() {
        let state = at(1.6, 1.4, 1.2);
        let (mut squared, mut count) = (0.0, 0.0);
        let mut camera = camera(3);
        for look in 0..400_u32 {
            let now = Duration::from_millis(40) * look;
            camera.look(now, &MarkerFloor::PUBLISHED, &state);
            assert_eq!(camera.take(now), [], "nothing at once");
            for fix in camera.take(now + Duration::from_millis(39)) {
                let mut error = Vector6::zeros();
                error.fixed_rows_mut::<3>(0).copy_from(&(fix.position - state.position));
                let turn = (state.attitude.inverse() * fix.body_to_world).scaled_axis();
                error.fixed_rows_mut::<3>(3).copy_from(&turn);
                squared += error.dot(&fix.covariance.cholesky().unwrap().solve(&error));
                count += 1.0;
                assert!((fix.position - state.position).norm() < 0.02);
            }
        }
        assert!(count > 390.0 && (squared / count - 6.0).abs() < 0.6, "{} of 6", squared / count);
    }

    #[test]
    fn off_the_floor_and_too_low_nothing_is_seen_and_with_fewer_markers_it_is_less_sure() {
        let mut camera = camera(1);
        let sigma_m = |camera: &mut FloorCamera, state: &RigidState| {
            camera.look(Duration::ZERO, &MarkerFloor::PUBLISHED, state);
            camera.take(Duration::from_secs(1)).first().map(|fix| fix.covariance[(0, 0)].sqrt())
        };
        assert_eq!(sigma_m(&mut camera, &at(8.0, 1.0, 1.2)), None);
        assert_eq!(sigma_m(&mut camera, &at(1.4, 1.4, 0.05)), None);
        let (inside, edge) =
            (sigma_m(&mut camera, &at(1.6, 1.4, 1.2)), sigma_m(&mut camera, &at(-0.4, 1.4, 1.2)));
        assert!(edge.unwrap() > 1.5 * inside.unwrap(), "{edge:?} {inside:?}");
    }
}
