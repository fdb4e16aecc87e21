//! The free way that the newest scan saw, further than the map reaches.

use nalgebra::Vector3;

use super::RayEnd;

/// A ray this little off a direction tells how far one sees in it, radians: the next ones of a lidar of 720.
const ALONG: f64 = 0.015;

/// The ends of a scan's rays.
///
/// A map of all that a lidar sees would be large and dear, and what is far away matters only to who means to slow
/// down gently: that it may do for what the last scan saw.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::map::{FreeRays, RayEnd};
///
/// let mut rays = FreeRays::default();
/// rays.add(RayEnd { point: Vector3::new(40.0, 0.0, 3.0), hit: false });
/// rays.add(RayEnd { point: Vector3::new(25.0, 0.6, 3.0), hit: true });
/// let from = Vector3::new(1.0, 0.0, 3.0);
/// assert_eq!(rays.free_m(&from, &Vector3::x(), 0.5), 39.0);
/// assert_eq!(rays.free_m(&from, &Vector3::x(), 0.7), 24.0);
/// assert_eq!(rays.free_m(&from, &Vector3::y(), 0.4), 0.0);
/// ```
#[derive(Clone, Debug, Default)]
pub struct FreeRays {
    ends: Vec<RayEnd>,
}

impl FreeRays {
    /// Forgets a scan.
    pub fn clear(&mut self) {
        self.ends.clear();
    }

    /// Takes in where a ray ended. One that the ground ended hit nothing.
    pub fn add(&mut self, end: RayEnd) {
        self.ends.push(end);
    }

    /// The free length of the way from `origin` (ENU, metres) in the horizontal direction `ahead`, metres:
    /// as far as the rays in this direction reach, and to the first thing that stands nearer to the way than
    /// `aside_m`. 0 where no ray went.
    pub fn free_m(&self, origin: &Vector3<f64>, ahead: &Vector3<f64>, aside_m: f64) -> f64 {
        let Some(unit) = ahead.xy().try_normalize(1e-9) else { return 0.0 };
        let (mut seen_m, mut free_m) = (None, f64::INFINITY);
        for end in &self.ends {
            let offset = (end.point - origin).xy();
            let along_m = offset.dot(&unit);
            let off_way_m = unit.perp(&offset).abs();
            if along_m <= 0.0 {
                continue;
            }
            if off_way_m <= ALONG * along_m {
                seen_m = Some(along_m.min(seen_m.unwrap_or(f64::INFINITY)));
            }
            if end.hit && off_way_m < aside_m {
                free_m = free_m.min(along_m);
            }
        }
        seen_m.map_or(0.0, |seen_m| free_m.min(seen_m))
    }
}
