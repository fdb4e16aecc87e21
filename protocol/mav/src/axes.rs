//! Axes: Skein's world is east-north-up with bodies forward-left-up; MAVLink's is north-east-down with
//! bodies forward-right-down. The conversions between them are here and nowhere else.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A vector from the single precision of messages.
pub(crate) fn vector(x: f32, y: f32, z: f32) -> Vector3<f64> {
    Vector3::new(f64::from(x), f64::from(y), f64::from(z))
}

/// A world vector, ENU to NED.
pub fn enu_to_ned(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, v.x, -v.z)
}

/// A world vector, NED to ENU.
pub fn ned_to_enu(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, v.x, -v.z)
}

/// A body vector, forward-left-up to forward-right-down.
pub fn flu_to_frd(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

/// A body vector, forward-right-down to forward-left-up.
pub fn frd_to_flu(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

/// Half a turn about the axis midway between north and east: what takes NED to ENU, and back.
fn half_turn_world() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0))
}

/// Half a turn about the forward axis: what takes FRD to FLU, and back.
fn half_turn_body() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

/// An attitude as body FLU to world ENU, from one given as body FRD to world NED.
pub fn attitude_from_ned(body_frd_to_ned: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    positive(half_turn_world() * body_frd_to_ned * half_turn_body())
}

/// An attitude as body FRD to world NED, from one given as body FLU to world ENU.
pub fn attitude_to_ned(body_flu_to_enu: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    positive(half_turn_world() * body_flu_to_enu * half_turn_body())
}

/// Of the two quaternions of one rotation, the one whose scalar part is not negative.
fn positive(q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    if q.w < 0.0 { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
}

/// A heading between the two conventions: counter-clockwise from east (ENU yaw) and clockwise from
/// north (NED yaw). The map is its own inverse. Radians, in (-pi, pi].
pub fn swap_yaw(yaw: f64) -> f64 {
    wrap_angle(FRAC_PI_2 - yaw)
}

/// The same angle in (-pi, pi].
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// ENU yaw of an attitude (body FLU to world ENU): where the nose points, counter-clockwise from east.
pub fn yaw(attitude: &UnitQuaternion<f64>) -> f64 {
    let nose = attitude * Vector3::x();
    nose.y.atan2(nose.x)
}
