//! Boxes along the world axes.

use nalgebra::Vector3;

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
}
