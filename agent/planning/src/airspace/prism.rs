//! A no-fly zone over a polygon.

use nalgebra::{Vector2, Vector3};

use super::{between, overlap};

/// A place where nobody may fly: an upright prism. Corners that cross over one another enclose what an odd number of
/// edges surrounds.
#[derive(Clone, Debug, PartialEq)]
pub struct NoFlyPrism {
    /// The corners of its outline in order, three or more (ENU, metres); the last is joined to the first.
    pub corners: Vec<Vector2<f64>>,
    /// Height of its lower end, metres.
    pub floor_m: f64,
    /// Height of its upper end, metres.
    pub ceiling_m: f64,
}

impl NoFlyPrism {
    pub(super) fn edges(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().copied().zip(next.copied())
    }

    /// The point of each edge that is nearest to `place`.
    pub(crate) fn nearest_on_edges(&self, place: Vector2<f64>) -> impl Iterator<Item = Vector2<f64>> + '_ {
        self.edges().map(move |(from, to)| {
            let along = to - from;
            let share = ((place - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            if share.is_finite() { from + along * share } else { from }
        })
    }

    /// Distance of a place (ENU, metres) from the outline, metres; negative inside it.
    pub fn off_outline_m(&self, place: Vector2<f64>) -> f64 {
        let nearest = self.nearest_on_edges(place).map(|point| (point - place).norm_squared());
        let distance_m = nearest.fold(f64::INFINITY, f64::min).sqrt();
        if self.holds(place) { -distance_m } else { distance_m }
    }

    fn holds(&self, place: Vector2<f64>) -> bool {
        let crossed = self.edges().filter(|(from, to)| {
            let (low, high) = (from.y - place.y, to.y - place.y);
            (low > 0.0) != (high > 0.0) && place.x < from.x + (to.x - from.x) * low / (low - high)
        });
        crossed.count() % 2 == 1
    }

    /// Share of the straight way from one point to another that is inside, 0 to 1.
    pub(super) fn share_inside(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let way = to - from;
        let mut cuts: Vec<f64> = self.edges().filter_map(|edge| cut(from.xy(), way.xy(), edge)).collect();
        cuts.extend([0.0, 1.0]);
        cuts.sort_by(f64::total_cmp);
        let height = between(from.z, way.z, self.floor_m, self.ceiling_m);
        let inside = |part: &[f64]| {
            let middle = from.xy() + way.xy() * (0.5 * (part[0] + part[1]));
            if self.holds(middle) { overlap((part[0], part[1]), height) } else { 0.0 }
        };
        cuts.windows(2).map(inside).sum()
    }
}

/// Where the way from a place crosses an edge, as a share of the way.
fn cut(from: Vector2<f64>, way: Vector2<f64>, (one, other): (Vector2<f64>, Vector2<f64>)) -> Option<f64> {
    let (edge, offset) = (other - one, one - from);
    let spread = way.perp(&edge);
    let (share, on_edge) = (offset.perp(&edge) / spread, offset.perp(&way) / spread);
    ((0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&on_edge)).then_some(share)
}
