//! Boxes along the world axes.

use nalgebra::{Isometry3, Point3, Vector3};

/// A box along the world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Lowest corner, metres ENU.
    pub min: Vector3<f64>,
    /// Highest corner, metres ENU.
    pub max: Vector3<f64>,
}

impl Aabb {
    /// Whether `point` is inside or on the surface.
    pub fn contains(&self, point: &Vector3<f64>) -> bool {
        (0..3).all(|axis| self.min[axis] <= point[axis] && point[axis] <= self.max[axis])
    }

    /// The smallest box that holds both.
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// Grown by `margin` metres on every side.
    pub fn grown(&self, margin: Vector3<f64>) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// The smallest box along the axes of another frame that holds this one, which stands there at `pose`.
    pub fn moved(&self, pose: &Isometry3<f64>) -> Self {
        let middle = (pose * Point3::from((self.min + self.max) / 2.0)).coords;
        let reach = pose.rotation.to_rotation_matrix().matrix().abs() * (self.max - self.min) / 2.0;
        Self { min: middle - reach, max: middle + reach }
    }
}
