//! A box that a path stays in.

use nalgebra::Vector3;

/// An axis-aligned box (ENU, metres). Its sides may be infinitely far away.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::Region;
///
/// let low = Region { max: Vector3::new(f64::INFINITY, f64::INFINITY, 4.0), ..Region::EVERYWHERE };
/// assert_eq!(low.room_m(&Vector3::new(9.0, 9.0, 3.0)), 1.0);
/// assert_eq!(low.room_m(&Vector3::new(9.0, 9.0, 6.0)), -2.0);
/// assert_eq!(low.clamp(&Vector3::new(9.0, 9.0, 6.0)).z, 4.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    pub min: Vector3<f64>,
    pub max: Vector3<f64>,
}

impl Default for Region {
    fn default() -> Self {
        Self::EVERYWHERE
    }
}

impl Region {
    /// No limit on any side.
    pub const EVERYWHERE: Self = Self {
        min: Vector3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        max: Vector3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    };

    /// Distance to the nearest side, metres; outside negative, to the side that is furthest away.
    pub fn room_m(&self, point: &Vector3<f64>) -> f64 {
        (point - self.min).min().min((self.max - point).min())
    }

    /// The same of the sides that stand upright.
    pub fn level_room_m(&self, point: &Vector3<f64>) -> f64 {
        let [low, high] = [point - self.min, self.max - point];
        low.xy().min().min(high.xy().min())
    }

    /// The nearest point inside.
    pub fn clamp(&self, point: &Vector3<f64>) -> Vector3<f64> {
        point.sup(&self.min).inf(&self.max)
    }

    /// The nearest point at a height inside.
    pub fn clamp_height(&self, point: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(point.x, point.y, self.clamp(point).z)
    }
}
