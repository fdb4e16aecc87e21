//! A pose that a sensor has measured, with its covariance.

use std::time::Duration;

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector2, Vector3};

/// A pose of the body in all six degrees of freedom, as markers tell it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseFix {
    /// When the sensor looked.
    pub stamp: Duration,
    /// World ENU, m.
    pub position: Vector3<f64>,
    /// Body FLU to world ENU.
    pub body_to_world: UnitQuaternion<f64>,
    /// Covariance of the position on the world's axes (rows 0 to 2, m²) and of the orientation about the body's axes
    /// (rows 3 to 5, rad²).
    pub covariance: Matrix6<f64>,
}

/// A pose of the body on the level, as a planar lidar tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarFix {
    /// When the sensor looked.
    pub stamp: Duration,
    /// East and north, m.
    pub position: Vector2<f64>,
    /// The direction of the nose, counter-clockwise from east, rad.
    pub heading_rad: f64,
    /// Covariance of east, north (m²) and heading (rad²).
    pub covariance: Matrix3<f64>,
}
