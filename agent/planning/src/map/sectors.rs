//! The nearest of many points in each direction.

use nalgebra::Vector3;

/// Number of bearing sectors around a vehicle (7.5 degrees each).
pub const SECTORS: usize = 48;

/// Keeps, of all points added, the one nearest to an origin in each of [`SECTORS`] equal horizontal bearing
/// sectors.
///
/// A lidar scan has hundreds of points on few obstacles; this is the part of it that bounds a vehicle's
/// motion. Distance is horizontal. Bearings are compared by their tangent's order, not by an angle, so that
/// no trigonometric library decides which sector a point on a border falls into.
#[derive(Clone, Debug)]
pub struct Sectors {
    origin: Vector3<f64>,
    nearest: [Option<(f64, Vector3<f64>)>; SECTORS],
}

impl Sectors {
    /// No point yet, seen from `origin` (ENU, metres).
    pub fn new(origin: Vector3<f64>) -> Sectors {
        Sectors { origin, nearest: [None; SECTORS] }
    }

    /// Takes a point into account. Points straight above or below the origin, and non-finite ones, are left
    /// out.
    pub fn add(&mut self, point: Vector3<f64>) {
        let offset = point - self.origin;
        let squared = offset.x * offset.x + offset.y * offset.y;
        if !(squared > 0.0 && squared.is_finite() && point.z.is_finite()) {
            return;
        }
        if let Some(slot) = self.nearest.get_mut(sector(offset.x, offset.y))
            && slot.is_none_or(|(best, _)| squared < best)
        {
            *slot = Some((squared, point));
        }
    }

    /// The points kept, counter-clockwise from east.
    pub fn points(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.nearest.iter().flatten().map(|(_, point)| *point)
    }
}

/// Sector of a direction, counter-clockwise from east. Within a quadrant, sectors are of equal width in `y /
/// (x + y)`, which grows with the bearing; they differ from equal angles by less than a third of a sector's
/// width.
fn sector(x: f64, y: f64) -> usize {
    let (quadrant, along, across) = if x > 0.0 && y >= 0.0 {
        (0, x, y)
    } else if x <= 0.0 && y > 0.0 {
        (1, y, -x)
    } else if x < 0.0 && y <= 0.0 {
        (2, -x, -y)
    } else {
        (3, -y, x)
    };
    let per_quadrant = SECTORS / 4;
    let within = (across / (along + across) * per_quadrant as f64) as usize;
    quadrant * per_quadrant + within.min(per_quadrant - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bearings_fall_into_increasing_sectors() {
        let mut previous = 0;
        for k in 0..3600 {
            let angle = (f64::from(k) + 0.5) * std::f64::consts::TAU / 3600.0;
            let now = sector(angle.cos(), angle.sin());
            assert!(now >= previous && now < SECTORS);
            previous = now;
        }
        assert_eq!(previous, SECTORS - 1);
    }

    #[test]
    fn the_nearest_point_of_a_sector_is_kept() {
        let mut sectors = Sectors::new(Vector3::new(1.0, 1.0, 3.0));
        for x in [9.0, 4.0, 6.0] {
            sectors.add(Vector3::new(x, 1.1, 3.0));
        }
        sectors.add(Vector3::new(1.0, -4.0, 3.0));
        sectors.add(Vector3::new(f64::NAN, 0.0, 3.0));
        let kept: Vec<_> = sectors.points().map(|p| (p.x, p.y)).collect();
        assert_eq!(kept, vec![(4.0, 1.1), (1.0, -4.0)]);
    }
}
