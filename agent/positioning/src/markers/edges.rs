//! Corners between pixels: where the edges that meet there cross.
//!
//! Windowed corner detectors (OpenCV's `cornerSubPix`) pull the corner of a blurred square into it, by up to half a
//! pixel where cells are small; lines along the edges do not.

use nalgebra::{Matrix2, Vector2};

use super::grey::Grey;
use super::quadrilateral::Corners;

/// An edge is looked for so many cells to both sides, at least and at most so many pixels.
const REACH_CELLS: f64 = 0.45;
const REACH_PX: [f64; 2] = [1.0, 4.0];
/// Steps of a profile across an edge.
const STEPS: i32 = 8;
/// So far from a corner its edges are looked at, pixels: beyond, a lens bends them.
const LONGEST_PX: f64 = 40.0;
/// So close to a corner blur rounds it: this share of the side, at least so many pixels.
const ROUNDED_SHARE: f64 = 0.06;
const ROUNDED_PX: f64 = 1.5;
/// The rise in brightness across an edge that is seen, grey levels.
const LEAST_RISE: f64 = 10.0;
/// Rounds; each starts where the one before found the edges.
const ROUNDS: usize = 3;
/// A corner that would move farther than this many reaches stays.
const FARTHEST: f64 = 2.0;

/// The corners of a dark quadrilateral on white, from rough ones; one whose edges are not seen stays as it was.
pub(super) fn refine(image: &Grey, rough: &Corners, cell_px: f64) -> Corners {
    let reach = (REACH_CELLS * cell_px).clamp(REACH_PX[0], REACH_PX[1]);
    let mut corners = *rough;
    for _ in 0..ROUNDS {
        let found = std::array::from_fn::<_, 4, _>(|n| {
            let [before, here, after] = [(n + 3) % 4, n, (n + 1) % 4].map(|n| corners[n]);
            // Outside lies to the left of the way clockwise.
            let one = line(image, here, after, 1.0, reach)?;
            let other = line(image, here, before, -1.0, reach)?;
            one.crossing(&other)
        });
        for ((corner, found), rough) in corners.iter_mut().zip(found).zip(rough) {
            if let Some(found) = found.filter(|found| (found - rough).norm() <= FARTHEST * reach) {
                *corner = found;
            }
        }
    }
    corners
}

/// A line by a point and its direction.
struct Line {
    point: Vector2<f64>,
    along: Vector2<f64>,
}

impl Line {
    fn crossing(&self, other: &Self) -> Option<Vector2<f64>> {
        let ways = Matrix2::from_columns(&[self.along, -other.along]).try_inverse()?;
        Some(self.point + self.along * (ways * (other.point - self.point)).x)
    }
}

/// The edge from a corner towards the next one; `side` is 1 if outside lies to the left on the image, else -1.
fn line(image: &Grey, corner: Vector2<f64>, next: Vector2<f64>, side: f64, reach: f64) -> Option<Line> {
    let length = (next - corner).norm();
    let along = (length > 0.0).then(|| (next - corner) / length)?;
    let out = Vector2::new(along.y, -along.x) * side;
    let rounded = (ROUNDED_SHARE * length).max(ROUNDED_PX);
    let end = (length - rounded).min(LONGEST_PX);
    let count = (end - rounded).ceil().max(2.0);
    let at = |n: f64| rounded + (end - rounded) * n / (count - 1.0);
    let edge = |along_px: f64| Some((along_px, edge(image, corner + along * along_px, out, reach)?));
    let edges: Vec<_> = (0..count as usize).filter_map(|n| edge(at(n as f64))).collect();
    let (offset, slope) = fit(&edges)?;
    Some(Line { point: corner + out * offset, along: along + out * slope })
}

/// Distance of the middle of the rise from dark to white from a place on an edge.
fn edge(image: &Grey, at: Vector2<f64>, out: Vector2<f64>, reach: f64) -> Option<f64> {
    let step = 2.0 * reach / f64::from(STEPS);
    let (mut rise, mut moment) = (0.0, 0.0);
    let mut before = image.sample(at - out * reach);
    for n in 0..STEPS {
        let far = step * f64::from(n + 1) - reach;
        let here = image.sample(at + out * far);
        let up = (here - before).max(0.0);
        rise += up;
        moment += up * (far - step / 2.0);
        before = here;
    }
    (rise >= LEAST_RISE).then(|| moment / rise)
}

/// The offset and slope of the line through most of the places found: those farther off than twice the mean are left
/// out of a second fit.
fn fit(edges: &[(f64, f64)]) -> Option<(f64, f64)> {
    let (offset, slope) = least_squares(edges)?;
    let off = |edge: &(f64, f64)| (edge.1 - offset - slope * edge.0).abs();
    let limit = 2.0 * edges.iter().map(off).sum::<f64>() / edges.len() as f64 + 1e-6;
    let near: Vec<_> = edges.iter().filter(|edge| off(edge) <= limit).copied().collect();
    least_squares(&near)
}

fn least_squares(edges: &[(f64, f64)]) -> Option<(f64, f64)> {
    let count = edges.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| edges.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|edge| edge.0), mean(|edge| edge.1));
    let spread: f64 = edges.iter().map(|edge| (edge.0 - x).powi(2)).sum();
    let slope = edges.iter().map(|edge| (edge.0 - x) * (edge.1 - y)).sum::<f64>() / spread;
    (edges.len() >= 3 && spread > 0.0).then_some((y - slope * x, slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of a dark square turned a little, each pixel as bright as the light it catches.
    fn image(corners: &Corners) -> Vec<u8> {
        let is_inside = |at: Vector2<f64>| super::super::quadrilateral::holds(corners, at);
        let pixel = |n: usize| {
            let corner = Vector2::new((n % 64) as f64 - 0.5, (n / 64) as f64 - 0.5);
            let within = |k: usize| Vector2::new((k % 8) as f64 + 0.5, (k / 8) as f64 + 0.5) / 8.0;
            let dark = (0..64).filter(|k| is_inside(corner + within(*k))).count();
            (230.0 - 200.0 * dark as f64 / 64.0).round() as u8
        };
        (0..64 * 64).map(pixel).collect()
    }

    #[test]
    fn corners_are_found_between_pixels() {
        for (turn, half) in [(0.0_f64, 20.25), (0.3, 17.0), (0.7, 6.3)] {
            let (sin, cos) = turn.sin_cos();
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]: [f64; 2]| {
                Vector2::new(31.3, 32.6) + Vector2::new(x * cos - y * sin, x * sin + y * cos) * half
            });
            let pixels = image(&corners);
            let rough = corners.map(|corner| (corner + Vector2::new(0.4, -0.3)).map(f64::round));
            let found = refine(&Grey::new(&pixels, 64, 64).unwrap(), &rough, half * 2.0 / 7.0);
            for (found, corner) in found.iter().zip(&corners) {
                assert!((found - corner).norm() < 0.12, "{turn} {half}: {found} is not {corner}");
            }
        }
    }

    #[test]
    fn where_no_edges_are_corners_stay() {
        let rough = [[10.0, 10.0], [50.0, 10.0], [50.0, 50.0], [10.0, 50.0]].map(Vector2::from);
        let even = [128; 64 * 64];
        assert_eq!(refine(&Grey::new(&even, 64, 64).unwrap(), &rough, 5.0), rough);
        let far = image(&rough.map(|corner| corner * 0.4));
        assert_eq!(refine(&Grey::new(&far, 64, 64).unwrap(), &rough, 5.0), rough);
        let point = [Vector2::new(20.0, 20.0); 4];
        assert_eq!(refine(&Grey::new(&far, 64, 64).unwrap(), &point, 5.0), point);
    }
}
