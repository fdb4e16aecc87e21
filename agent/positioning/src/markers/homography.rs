//! The mapping of one plane to another as a camera sees it.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// Takes points of one plane to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Homography(pub(super) Matrix3<f64>);

impl Homography {
    /// The mapping that comes nearest to taking each first point to its second; `None` for fewer than four points or
    /// those of a line.
    pub(super) fn between(pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + Clone) -> Option<Self> {
        let (from, to) =
            (Frame::of(pairs.clone().map(|pair| pair.0))?, Frame::of(pairs.clone().map(|pair| pair.1))?);
        // Of the nine entries the last is 1: both frames have their origin in the middle of the points.
        let mut normal = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        for (a, b) in pairs {
            let (a, b) = (from.local(a), to.local(b));
            for (row, value) in [
                ([a.x, a.y, 1.0, 0.0, 0.0, 0.0, -a.x * b.x, -a.y * b.x], b.x),
                ([0.0, 0.0, 0.0, a.x, a.y, 1.0, -a.x * b.y, -a.y * b.y], b.y),
            ] {
                let row = SVector::from(row);
                normal.ger(1.0, &row, &row, 1.0);
                right.axpy(value, &row, 1.0);
            }
        }
        let h = normal.cholesky()?.solve(&right);
        let h = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        let whole = to.back() * h * from.matrix();
        whole.iter().all(|entry| entry.is_finite()).then_some(Self(whole))
    }

    /// Where a point goes.
    pub(super) fn map(&self, point: Vector2<f64>) -> Vector2<f64> {
        let mapped = self.0 * Vector3::new(point.x, point.y, 1.0);
        mapped.xy() / mapped.z
    }
}

/// Coordinates in which points lie round the origin at a distance of about 1, for the sake of rounding.
struct Frame {
    centre: Vector2<f64>,
    scale: f64,
}

impl Frame {
    fn of(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Self> {
        let count = points.clone().count();
        let centre = points.clone().sum::<Vector2<f64>>() / count as f64;
        let spread = points.map(|point| (point - centre).norm()).sum::<f64>() / count as f64;
        (count >= 4 && spread > 0.0).then(|| Self { centre, scale: 1.0 / spread })
    }

    fn local(&self, point: Vector2<f64>) -> Vector2<f64> {
        (point - self.centre) * self.scale
    }

    fn matrix(&self) -> Matrix3<f64> {
        let (scale, shift) = (self.scale, -self.centre * self.scale);
        Matrix3::new(scale, 0.0, shift.x, 0.0, scale, shift.y, 0.0, 0.0, 1.0)
    }

    fn back(&self) -> Matrix3<f64> {
        let scale = 1.0 / self.scale;
        Matrix3::new(scale, 0.0, self.centre.x, 0.0, scale, self.centre.y, 0.0, 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_points_and_what_lies_between_them_go_where_they_should() {
        let truth = Homography(Matrix3::new(40.0, 3.0, 300.0, -5.0, 35.0, 200.0, 0.1, -0.05, 1.0));
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vector2::from);
        let found =
            Homography::between(corners.into_iter().map(|corner| (corner, truth.map(corner)))).unwrap();
        for point in [[0.5, 0.5], [0.2, 0.9], [2.0, -1.0]].map(Vector2::from) {
            assert!((found.map(point) - truth.map(point)).norm() < 1e-9, "{point}");
        }
    }

    #[test]
    fn points_of_a_line_tell_nothing() {
        let line = (0..4).map(|n| (Vector2::new(f64::from(n), 0.0), Vector2::new(f64::from(n), 1.0)));
        assert_eq!(Homography::between(line), None);
        let few = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(Vector2::from);
        assert_eq!(Homography::between(few.into_iter().map(|point| (point, point))), None);
    }
}
