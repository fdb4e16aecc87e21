//! Both poses from which a plane looks as it does.

use nalgebra::{Isometry3, Translation3};
use nalgebra::{Matrix2, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

use super::homography::Homography;

/// The two poses, from a plane's frame to the camera's, at which the plane's points (x and y, m) come near to the rays
/// (at z = 1) that show them, nearer the better one's. A small or distant plane looks nearly the same from both
/// (Collins and Bartoli 2014, "Infinitesimal plane-based pose estimation"). `None` if the points lie on a line.
pub(super) fn poses(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<[Isometry3<f64>; 2]> {
    let centre = pairs.iter().map(|(point, _)| point).sum::<Vector2<f64>>() / pairs.len() as f64;
    let centred = pairs.iter().map(|(point, ray)| (point - centre, *ray));
    let h = Homography::between(centred)?.0;
    let h = h / h[(2, 2)];
    let (ray, j) = (Vector2::new(h[(0, 2)], h[(1, 2)]), jacobian(&h));
    let [one, other] = rotations(ray, j)?.map(|turn| {
        let pose = placed(pairs, turn)?;
        Some((miss(pairs, &pose), pose))
    });
    let ((one_miss, one), (other_miss, other)) = (one?, other?);
    Some(if one_miss <= other_miss { [one, other] } else { [other, one] })
}

/// Derivative of the ray by the point of the plane, at the middle.
fn jacobian(h: &Matrix3<f64>) -> Matrix2<f64> {
    Matrix2::new(
        h[(0, 0)] - h[(2, 0)] * h[(0, 2)],
        h[(0, 1)] - h[(2, 1)] * h[(0, 2)],
        h[(1, 0)] - h[(2, 0)] * h[(1, 2)],
        h[(1, 1)] - h[(2, 1)] * h[(1, 2)],
    )
}

/// The two rotations of a plane whose middle lies on a ray and changes with it as `j` says.
fn rotations(ray: Vector2<f64>, j: Matrix2<f64>) -> Option<[Rotation3<f64>; 2]> {
    let to_ray = Rotation3::rotation_between(&Vector3::z(), &Vector3::new(ray.x, ray.y, 1.0))?;
    let v = to_ray.matrix();
    let b = v.fixed_view::<2, 2>(0, 0) - ray * v.fixed_view::<1, 2>(2, 0);
    let a = b.try_inverse()? * j;
    // Its largest stretch is the inverse of the distance; what the other direction lacks is the slope.
    let stretch = largest_singular(&a);
    let a = (stretch > 0.0).then(|| a / stretch)?;
    let lack = Matrix2::identity() - a.transpose() * a;
    let (x, y) = (lack[(0, 0)].max(0.0).sqrt(), lack[(1, 1)].max(0.0).sqrt());
    let y = if lack[(0, 1)] < 0.0 { -y } else { y };
    let rotation = |x: f64, y: f64| {
        let first = Vector3::new(a[(0, 0)], a[(1, 0)], x);
        let second = Vector3::new(a[(0, 1)], a[(1, 1)], y);
        let whole = v * Matrix3::from_columns(&[first, second, first.cross(&second)]);
        let turn = Rotation3::from_matrix_eps(&whole, 1e-9, 30, to_ray);
        turn.matrix().iter().all(|entry| entry.is_finite()).then_some(turn)
    };
    Some([rotation(x, y)?, rotation(-x, -y)?])
}

fn largest_singular(a: &Matrix2<f64>) -> f64 {
    let square = a * a.transpose();
    let (half, det) = (square.trace() / 2.0, square.determinant());
    (half + (half * half - det).max(0.0).sqrt()).sqrt()
}

/// The pose of a rotation whose points come nearest to their rays.
fn placed(pairs: &[(Vector2<f64>, Vector2<f64>)], turn: Rotation3<f64>) -> Option<Isometry3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (point, ray) in pairs {
        let turned = turn * Vector3::new(point.x, point.y, 0.0);
        for row in [Vector3::new(1.0, 0.0, -ray.x), Vector3::new(0.0, 1.0, -ray.y)] {
            normal += row * row.transpose();
            right -= row * row.dot(&turned);
        }
    }
    let shift = normal.try_inverse()? * right;
    let is_ahead = shift.z > 0.0 && shift.iter().all(|along| along.is_finite());
    is_ahead.then(|| {
        Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_rotation_matrix(&turn))
    })
}

/// The sum of squares between rays and where the points are seen.
fn miss(pairs: &[(Vector2<f64>, Vector2<f64>)], pose: &Isometry3<f64>) -> f64 {
    let off = |(point, ray): &(Vector2<f64>, Vector2<f64>)| {
        let seen = pose.rotation * Vector3::new(point.x, point.y, 0.0) + pose.translation.vector;
        (seen.xy() / seen.z - ray).norm_squared()
    };
    pairs.iter().map(off).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(pose: &Isometry3<f64>, points: &[Vector2<f64>]) -> Vec<(Vector2<f64>, Vector2<f64>)> {
        let ray = |point: &Vector2<f64>| {
            let seen = pose.rotation * Vector3::new(point.x, point.y, 0.0) + pose.translation.vector;
            (*point, seen.xy() / seen.z)
        };
        points.iter().map(ray).collect()
    }

    fn pose(axis_angle: [f64; 3], shift: [f64; 3]) -> Isometry3<f64> {
        Isometry3::new(shift.into(), axis_angle.into())
    }

    #[test]
    fn the_better_pose_is_the_true_one_wherever_the_plane_is() {
        let square = [[-0.09, 0.09], [0.09, 0.09], [0.09, -0.09], [-0.09, -0.09]].map(Vector2::from);
        let wide = [[1.0, 0.3], [1.4, 0.0], [0.2, -0.5], [2.0, 2.0], [1.1, 1.2]].map(Vector2::from);
        for points in [square.as_slice(), &wide] {
            for truth in [
                pose([3.1, 0.2, -0.1], [0.1, -0.05, 1.5]),
                pose([2.4, 0.5, 1.1], [-0.6, 0.4, 2.0]),
                pose([std::f64::consts::PI, 0.0, 0.0], [0.0, 0.0, 1.0]),
            ] {
                let [better, _] = poses(&seen(&truth, points)).unwrap();
                assert!(better.rotation.angle_to(&truth.rotation) < 1e-5, "{truth}: {better}");
                assert!(
                    (better.translation.vector - truth.translation.vector).norm() < 1e-5,
                    "{truth}: {better}"
                );
            }
        }
    }

    #[test]
    fn a_small_plane_looks_nearly_the_same_from_the_other() {
        let square = [[-0.02, 0.02], [0.02, 0.02], [0.02, -0.02], [-0.02, -0.02]].map(Vector2::from);
        let truth = pose([2.7, 0.4, 0.0], [0.1, 0.1, 2.0]);
        let pairs = seen(&truth, &square);
        let [better, other] = poses(&pairs).unwrap();
        assert!(better.rotation.angle_to(&other.rotation) > 0.5, "they differ");
        assert!(miss(&pairs, &other).sqrt() < 3e-4, "and look alike");
    }

    #[test]
    fn a_line_has_none() {
        let line: Vec<_> = (0..4).map(|n| Vector2::new(f64::from(n), 0.5)).collect();
        assert_eq!(poses(&seen(&pose([0.1, 0.0, 0.0], [0.0, 0.0, 3.0]), &line)), None);
    }
}
