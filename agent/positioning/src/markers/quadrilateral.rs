//! Outlines that are four straight sides.

use nalgebra::Vector2;

/// So far from its sides, as a share of the outline's length, a quadrilateral's outline may lie.
const WAVE: f64 = 0.03;
/// The least side, as a share of the outline's length.
const SHORTEST: f64 = 0.05;

/// Four corners, clockwise on the image.
pub(super) type Corners = [Vector2<f64>; 4];

/// The corners of an outline that is a convex quadrilateral.
pub(super) fn corners(outline: &[(i32, i32)]) -> Option<Corners> {
    let at = |index: usize| Vector2::new(f64::from(outline[index].0), f64::from(outline[index].1));
    let farthest = |from: Vector2<f64>| {
        let of = |index: &usize| (at(*index) - from).norm_squared();
        (0..outline.len()).max_by(|a, b| of(a).total_cmp(&of(b)))
    };
    // The point farthest from any is a corner, and so is the one farthest from that.
    let one = farthest(outline.first().map(|_| at(0))?)?;
    let other = farthest(at(one))?;
    let mut found = Vec::with_capacity(5);
    let limit = WAVE * outline.len() as f64;
    for (from, to) in [(one, other), (other, one)] {
        let to = if to <= from { to + outline.len() } else { to };
        between(&|index| at(index % outline.len()), from, to, limit, &mut found);
    }
    let corners = Corners::try_from(found).ok()?;
    let shortest = SHORTEST * outline.len() as f64;
    let is_long = |n: usize| (corners[(n + 1) % 4] - corners[n]).norm() >= shortest;
    (is_convex(&corners) && (0..4).all(is_long)).then_some(corners)
}

/// The corner at `from` and those before `to` (Ramer, Douglas and Peucker); gives up beyond four.
fn between(
    at: &impl Fn(usize) -> Vector2<f64>,
    from: usize,
    to: usize,
    limit: f64,
    found: &mut Vec<Vector2<f64>>,
) {
    let mut ends = vec![to];
    let mut start = from;
    while let Some(end) = ends.pop().filter(|_| found.len() <= 4) {
        match farthest_aside(at, start, end).filter(|(_, aside)| *aside > limit) {
            Some((middle, _)) => ends.extend([end, middle]),
            None => {
                found.push(at(start));
                start = end;
            }
        }
    }
}

/// The point farthest from the line between two, with its distance.
fn farthest_aside(at: &impl Fn(usize) -> Vector2<f64>, from: usize, to: usize) -> Option<(usize, f64)> {
    let (start, along) = (at(from), at(to) - at(from));
    let length = along.norm();
    let aside = |index: usize| match length {
        0.0 => (at(index) - start).norm(),
        _ => along.perp(&(at(index) - start)).abs() / length,
    };
    (from + 1..to).map(|index| (index, aside(index))).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether corners turn to the right all the way round, once.
pub(super) fn is_convex(corners: &Corners) -> bool {
    (0..4).all(|n| {
        let side = corners[(n + 1) % 4] - corners[n];
        side.perp(&(corners[(n + 2) % 4] - corners[(n + 1) % 4])) > 0.0
    })
}

/// Whether a point lies inside.
pub(super) fn holds(corners: &Corners, point: Vector2<f64>) -> bool {
    (0..4).all(|n| (corners[(n + 1) % 4] - corners[n]).perp(&(point - corners[n])) > 0.0)
}

/// The middle of the corners.
pub(super) fn centre(corners: &Corners) -> Vector2<f64> {
    corners.iter().sum::<Vector2<f64>>() / 4.0
}

/// The length round the corners.
pub(super) fn perimeter(corners: &Corners) -> f64 {
    (0..4).map(|n| (corners[(n + 1) % 4] - corners[n]).norm()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pixels along straight lines between points, and back to the first.
    fn outline(points: &[(i32, i32)]) -> Vec<(i32, i32)> {
        let along = |n: usize| {
            let ((ax, ay), (bx, by)) = (points[n], points[(n + 1) % points.len()]);
            let steps = (bx - ax).abs().max((by - ay).abs());
            (0..steps).map(move |k| (ax + (bx - ax) * k / steps, ay + (by - ay) * k / steps))
        };
        (0..points.len()).flat_map(along).collect()
    }

    #[test]
    fn the_corners_of_a_tilted_square_are_found_clockwise() {
        let points = [(10, 50), (60, 5), (110, 55), (55, 100)];
        let found = corners(&outline(&points)).unwrap();
        assert!(is_convex(&found));
        for (x, y) in points {
            let point = Vector2::new(f64::from(x), f64::from(y));
            assert!(found.iter().any(|corner| (corner - point).norm() < 2.0), "{point} is none of {found:?}");
        }
        assert!(holds(&found, centre(&found)) && !holds(&found, Vector2::new(10.0, 10.0)));
    }

    #[test]
    fn other_shapes_are_no_quadrilaterals() {
        let triangle = [(0, 0), (60, 0), (0, 60)];
        let arrow = [(0, 0), (60, 0), (20, 20), (0, 60)];
        let pentagon = [(30, 0), (60, 25), (50, 60), (10, 60), (0, 25)];
        for points in [triangle.as_slice(), &arrow, &pentagon, &[(0, 0), (90, 0), (90, 3), (0, 3)]] {
            assert_eq!(corners(&outline(points)), None, "{points:?}");
        }
        assert_eq!(corners(&[(3, 3)]), None);
        assert_eq!(corners(&[]), None);
    }
}
