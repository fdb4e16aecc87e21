//! An estimate of somebody else's that an autopilot may fly by.

use std::time::Duration;

use mavlink::dialects::common::{
    MavEstimatorType, MavFrame, ODOMETRY_DATA, VISION_POSITION_ESTIMATE_DATA, VISION_SPEED_ESTIMATE_DATA,
};
use nalgebra::{Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3};

use crate::axes;
use crate::geodesy::LocalFrame;

/// Position, velocity and attitude of a vehicle, with their covariance. World ENU, body FLU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct External {
    /// m.
    pub position: Vector3<f64>,
    /// World, m/s.
    pub velocity: Vector3<f64>,
    /// Body to world.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rate, body, rad/s.
    pub rate: Vector3<f64>,
    /// Covariance of position (rows 0 to 2) and velocity (3 to 5), m and m/s, squared.
    pub motion_covariance: Matrix6<f64>,
    /// Covariance of the attitude about the body's axes, rad squared.
    pub attitude_covariance: Matrix3<f64>,
    /// Jumps of the position, modulo 256.
    pub resets: u8,
}

/// The upper triangle, row by row, of two covariances that have nothing to do with each other.
fn triangle(first: &Matrix3<f64>, second: &Matrix3<f64>) -> [f32; 21] {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(first);
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(second);
    let mut triangle = [0.0; 21];
    let places = (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    for (entry, place) in triangle.iter_mut().zip(places) {
        *entry = whole[place] as f32;
    }
    triangle
}

/// The 3 x 3 blocks of position (or velocity), and of orientation (or rate), of such a triangle.
fn blocks(triangle: &[f32; 21]) -> (Matrix3<f64>, Matrix3<f64>) {
    let mut whole = Matrix6::zeros();
    let places = (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    for (entry, (row, column)) in triangle.iter().zip(places) {
        whole[(row, column)] = f64::from(*entry);
        whole[(column, row)] = f64::from(*entry);
    }
    (whole.fixed_view::<3, 3>(0, 0).into(), whole.fixed_view::<3, 3>(3, 3).into())
}

/// A covariance on axes that a turn exchanges or reverses, column by column.
fn turned(covariance: &Matrix3<f64>, turn: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Matrix3<f64> {
    let axes = Matrix3::from_columns(&[turn(&Vector3::x()), turn(&Vector3::y()), turn(&Vector3::z())]);
    axes * covariance * axes.transpose()
}

impl External {
    fn position_covariance(&self) -> Matrix3<f64> {
        turned(&self.motion_covariance.fixed_view::<3, 3>(0, 0).into(), axes::enu_to_ned)
    }

    fn velocity_covariance(&self) -> Matrix3<f64> {
        self.motion_covariance.fixed_view::<3, 3>(3, 3).into()
    }

    fn is_finite(&self) -> bool {
        let numbers = self.position.iter().chain(self.velocity.iter()).chain(self.rate.iter());
        let covariances = self.motion_covariance.iter().chain(self.attitude_covariance.iter());
        numbers.chain(covariances).chain(self.attitude.coords.iter()).all(|number| number.is_finite())
    }

    /// As ODOMETRY, with velocities along the body's axes; `None` if a number is none.
    pub(crate) fn odometry(&self, time: Duration, local: &LocalFrame) -> Option<ODOMETRY_DATA> {
        let position = local.position_to_local(&self.position);
        let velocity = axes::flu_to_frd(&(self.attitude.inverse() * self.velocity));
        let to_body = self.attitude.inverse().to_rotation_matrix().into_inner();
        let velocity_covariance = to_body * self.velocity_covariance() * to_body.transpose();
        let attitude = axes::attitude_to_ned(&self.attitude);
        let rate = axes::flu_to_frd(&self.rate);
        self.is_finite().then(|| ODOMETRY_DATA {
            time_usec: time.as_micros() as u64,
            x: position.x as f32,
            y: position.y as f32,
            z: position.z as f32,
            q: [attitude.w, attitude.i, attitude.j, attitude.k].map(|part| part as f32),
            vx: velocity.x as f32,
            vy: velocity.y as f32,
            vz: velocity.z as f32,
            rollspeed: rate.x as f32,
            pitchspeed: rate.y as f32,
            yawspeed: rate.z as f32,
            pose_covariance: triangle(
                &self.position_covariance(),
                &turned(&self.attitude_covariance, axes::flu_to_frd),
            ),
            velocity_covariance: triangle(
                &turned(&velocity_covariance, axes::flu_to_frd),
                &Matrix3::identity(),
            ),
            frame_id: MavFrame::MAV_FRAME_LOCAL_NED,
            child_frame_id: MavFrame::MAV_FRAME_BODY_FRD,
            reset_counter: self.resets,
            estimator_type: MavEstimatorType::MAV_ESTIMATOR_TYPE_VISION,
            quality: 100,
        })
    }

    /// As VISION_POSITION_ESTIMATE and VISION_SPEED_ESTIMATE; `None` if a number is none.
    pub(crate) fn vision(
        &self,
        time: Duration,
        local: &LocalFrame,
    ) -> Option<(VISION_POSITION_ESTIMATE_DATA, VISION_SPEED_ESTIMATE_DATA)> {
        let position = local.position_to_local(&self.position);
        let velocity = axes::enu_to_ned(&self.velocity);
        let (roll, pitch, yaw) = axes::attitude_to_ned(&self.attitude).euler_angles();
        let velocity_covariance = turned(&self.velocity_covariance(), axes::enu_to_ned);
        let mut covariance = [0.0; 9];
        for (entry, value) in covariance.iter_mut().zip(velocity_covariance.iter()) {
            *entry = *value as f32;
        }
        let place = VISION_POSITION_ESTIMATE_DATA {
            usec: time.as_micros() as u64,
            x: position.x as f32,
            y: position.y as f32,
            z: position.z as f32,
            roll: roll as f32,
            pitch: pitch as f32,
            yaw: yaw as f32,
            covariance: triangle(
                &self.position_covariance(),
                &turned(&self.attitude_covariance, axes::flu_to_frd),
            ),
            reset_counter: self.resets,
        };
        let speed = VISION_SPEED_ESTIMATE_DATA {
            usec: place.usec,
            x: velocity.x as f32,
            y: velocity.y as f32,
            z: velocity.z as f32,
            covariance,
            reset_counter: self.resets,
        };
        self.is_finite().then_some((place, speed))
    }

    /// The estimate in an ODOMETRY; `None` if it is in other frames, has no covariance, or a number is none.
    pub(crate) fn read(message: &ODOMETRY_DATA, local: &LocalFrame) -> Option<Self> {
        if message.frame_id != MavFrame::MAV_FRAME_LOCAL_NED
            || message.child_frame_id != MavFrame::MAV_FRAME_BODY_FRD
        {
            return None;
        }
        let [w, i, j, k] = message.q.map(f64::from);
        let attitude = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 0.5)?;
        let attitude = axes::attitude_from_ned(&attitude);
        let position = local.position_to_world(&axes::vector(message.x, message.y, message.z));
        let body_velocity = axes::frd_to_flu(&axes::vector(message.vx, message.vy, message.vz));
        let rate = axes::vector(message.rollspeed, message.pitchspeed, message.yawspeed);
        let (of_position, of_attitude) = blocks(&message.pose_covariance);
        let (of_velocity, _) = blocks(&message.velocity_covariance);
        let to_world = attitude.to_rotation_matrix().into_inner();
        let of_velocity = to_world * turned(&of_velocity, axes::frd_to_flu) * to_world.transpose();
        let mut motion_covariance = Matrix6::zeros();
        motion_covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned(&of_position, axes::ned_to_enu));
        motion_covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&of_velocity);
        let external = Self {
            position,
            velocity: attitude * body_velocity,
            attitude,
            rate: axes::frd_to_flu(&rate),
            motion_covariance,
            attitude_covariance: turned(&of_attitude, axes::frd_to_flu),
            resets: message.reset_counter,
        };
        let has_covariance = motion_covariance.diagonal().iter().all(|variance| *variance > 0.0);
        (external.is_finite() && has_covariance).then_some(external)
    }
}
