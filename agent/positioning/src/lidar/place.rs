//! The looks of a place, whatever the heading: to rank places that a scan may be of.

use super::level::Return;

/// Rings about the lidar.
const RINGS: usize = 20;
/// Width of a ring, m; the last holds all beyond.
const RING_M: f64 = 2.0;

/// Shares of the returns by distance, and by how far from the line of sight their surfaces turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    shares: [f32; 2 * RINGS],
}

impl Place {
    /// The place as these returns show it; each stands for the length of surface between it and the next.
    pub fn new(returns: &[Return]) -> Self {
        let mut shares = [0.0; 2 * RINGS];
        let mut sum = 0.0;
        for one in returns {
            let range_m = one.point.norm();
            let facing = -one.normal.dot(&one.point) / range_m.max(1e-6);
            let ring = ((range_m / RING_M) as usize).min(RINGS - 1);
            shares[2 * ring + usize::from(facing > 0.8)] += 1.0;
            sum += 1.0;
        }
        shares.iter_mut().for_each(|share| *share /= f32::max(sum, 1.0));
        Self { shares }
    }

    /// 0 for places that look the same, 2 for places that have nothing in common.
    pub fn unlike(&self, other: &Self) -> f64 {
        self.shares.iter().zip(&other.shares).map(|(one, other)| f64::from((one - other).abs())).sum()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry2, Vector2};

    use super::*;
    use crate::lidar::level::LevelScan;
    use crate::lidar::synthetic::{World, flat};

    #[test]
    fn a_place_is_like_itself_from_near_and_turned() {
        let forest = World::forest(3, 60.0, 0.04);
        let seen = |x: f64, heading: f64| {
            let pose = Isometry2::new(Vector2::new(x, 0.0), heading);
            let scan = LevelScan::new(&forest.scan(&pose, x as u64).sweep(), &flat(pose, 1e-4), |_| false);
            Place::new(&scan.returns)
        };
        let near = seen(10.0, 0.0).unlike(&seen(10.5, 2.0));
        for far in [25.0, 40.0, 55.0] {
            let unlike = seen(10.0, 0.0).unlike(&seen(far, 0.0));
            assert!(near < unlike, "{near}, {unlike} at {far}");
        }
    }
}
