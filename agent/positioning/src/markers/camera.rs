//! A camera: which point of its image shows what it looks at.
//!
//! Camera frame: x to the image's right, y down, z forward, m. Pixels: (0, 0) is the centre of the first one.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use thiserror::Error;

/// Sides beyond this many pixels are taken for a mistake.
const SIDE_LIMIT: usize = 16_384;
/// Greatest distance from the axis at which a lens is looked at, as a tangent.
const WIDEST: f64 = 8.0;
/// Steps of Newton's method from a pixel to its ray, and how near they must come.
const ROUNDS: usize = 25;
const NEAR: f64 = 1e-9;

/// The distortion of a lens beside a pinhole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Brown's model, OpenCV's and ROS's `plumb_bob` and `rational_polynomial`.
    Radial {
        /// k1 to k6; the last three divide.
        k: [f64; 6],
        /// p1 and p2, of a lens that sits askew.
        p: [f64; 2],
    },
    /// OpenCV's fisheye model, ROS's `equidistant`: k1 to k4.
    Fisheye([f64; 4]),
}

impl Lens {
    /// A lens that bends nothing.
    pub const NONE: Self = Self::Radial { k: [0.0; 6], p: [0.0; 2] };

    /// Where a ray, given at z = 1, ends, and how that changes with the ray.
    fn bend(&self, ray: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let square = ray.norm_squared();
        match self {
            Self::Radial { k, p } => {
                let (scale, slope) = rational(k, square);
                let [x, y] = ray.into();
                let askew = Vector2::new(
                    2.0 * p[0] * x * y + p[1] * (square + 2.0 * x * x),
                    p[0] * (square + 2.0 * y * y) + 2.0 * p[1] * x * y,
                );
                let mixed = 2.0 * (p[0] * x + p[1] * y);
                let of_askew = Matrix2::new(
                    2.0 * p[0] * y + 6.0 * p[1] * x,
                    mixed,
                    mixed,
                    6.0 * p[0] * y + 2.0 * p[1] * x,
                );
                let change = Matrix2::identity() * scale + ray * ray.transpose() * (2.0 * slope) + of_askew;
                (ray * scale + askew, change)
            }
            Self::Fisheye(k) => {
                let radius = square.sqrt();
                if radius < 1e-9 {
                    return (ray, Matrix2::identity());
                }
                let (bent, slope) = fisheye(k, radius.atan());
                let (scale, out) = (bent / radius, ray / radius);
                let along = slope / (1.0 + square);
                (ray * scale, Matrix2::identity() * scale + out * out.transpose() * (along - scale))
            }
        }
    }

    /// The tangent of the angle up to which rays further out end further out.
    fn reach(&self) -> f64 {
        let end = |tangent: f64| match self {
            Self::Radial { k, .. } => tangent * rational(k, tangent * tangent).0,
            Self::Fisheye(k) => fisheye(k, tangent.atan()).0,
        };
        let steps = (0..800).map(|step| f64::from(step) * WIDEST / 800.0);
        let turns = |tangent: &f64| !(end(tangent + WIDEST / 800.0) > end(*tangent));
        steps.into_iter().find(turns).unwrap_or(WIDEST)
    }
}

/// (1 + k1 s + k2 s² + k3 s³) / (1 + k4 s + k5 s² + k6 s³), and its slope over s.
fn rational(k: &[f64; 6], s: f64) -> (f64, f64) {
    let cubic =
        |k: &[f64]| (1.0 + s * (k[0] + s * (k[1] + s * k[2])), k[0] + s * (2.0 * k[1] + s * 3.0 * k[2]));
    let ((above, above_slope), (below, below_slope)) = (cubic(&k[..3]), cubic(&k[3..]));
    (above / below, (above_slope - above / below * below_slope) / below)
}

/// θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), and its slope over θ.
fn fisheye(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let s = angle * angle;
    let bent = angle * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
    (bent, 1.0 + s * (3.0 * k[0] + s * (5.0 * k[1] + s * (7.0 * k[2] + s * 9.0 * k[3]))))
}

/// A camera whose image has no more than one place for what it looks at.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    width: usize,
    height: usize,
    focal: Vector2<f64>,
    middle: Vector2<f64>,
    lens: Lens,
    reach: f64,
}

/// These numbers describe no camera.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{what} is {value}; expected {expected}")]
pub struct NoCamera {
    what: &'static str,
    value: String,
    expected: &'static str,
}

impl Camera {
    /// A camera of so many columns and rows, its focal lengths across and down in pixels, and where its axis meets the
    /// image.
    pub fn new(size: [usize; 2], focal: [f64; 2], middle: [f64; 2], lens: Lens) -> Result<Self, NoCamera> {
        let told = |what, value, expected| Err(NoCamera { what, value, expected });
        if !size.iter().all(|side| (1..=SIDE_LIMIT).contains(side)) {
            return told("the image's size", format!("{size:?}"), "1 to 16384 pixels each");
        }
        if !focal.iter().all(|length| (1.0..1e6).contains(length)) {
            return told("the focal length", format!("{focal:?}"), "1 to 1000000 pixels each");
        }
        if !middle.iter().all(|place| place.abs() < 1e5) {
            return told("the image's middle", format!("{middle:?}"), "pixels, at most 100000");
        }
        let reach = lens.reach();
        if !(reach > 0.0) {
            return told("the distortion", format!("{lens:?}"), "numbers that leave the middle in order");
        }
        let [width, height] = size;
        Ok(Self { width, height, focal: focal.into(), middle: middle.into(), lens, reach })
    }

    /// Columns of its image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of its image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The focal lengths across and down, pixels.
    pub fn focal(&self) -> Vector2<f64> {
        self.focal
    }

    /// Where its axis meets the image, pixels.
    pub fn middle(&self) -> Vector2<f64> {
        self.middle
    }

    /// The distortion of its lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The pixel that shows a point of the camera's frame, within the image or beside it. `None` for what lies behind
    /// the camera or farther aside than its lens is described.
    pub fn project(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.look(point).map(|(pixel, _)| pixel)
    }

    /// The same, with how the pixel changes with the point, pixels per metre.
    pub fn look(&self, point: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        if !(point.z > 1e-6) {
            return None;
        }
        let ray = point.xy() / point.z;
        if !(ray.norm() <= self.reach) {
            return None;
        }
        let (bent, change) = self.lens.bend(ray);
        let of_ray = Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y) / point.z;
        let to_pixels = Matrix2::from_diagonal(&self.focal);
        Some((self.focal.component_mul(&bent) + self.middle, to_pixels * change * of_ray))
    }

    /// The ray that a pixel shows, as its point at z = 1; `None` beyond what the lens shows.
    pub fn ray(&self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let wanted = (pixel - self.middle).component_div(&self.focal);
        let mut ray = wanted;
        for _ in 0..ROUNDS {
            let (bent, change) = self.lens.bend(ray);
            let miss = wanted - bent;
            if miss.norm() < NEAR {
                return Some(ray).filter(|ray| ray.norm() <= self.reach);
            }
            let step = change.try_inverse()? * miss;
            // A long step leaves the part where the slope tells the way.
            let longest = 0.3 * (1.0 + ray.norm_squared());
            ray += step * (longest / step.norm()).min(1.0);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(lens: Lens) -> Camera {
        Camera::new([640, 480], [420.0, 415.0], [322.5, 236.0], lens).unwrap()
    }

    fn lenses() -> [Lens; 4] {
        [
            Lens::NONE,
            Lens::Radial { k: [-0.28, 0.09, -0.012, 0.0, 0.0, 0.0], p: [0.0009, -0.0006] },
            Lens::Radial { k: [0.9, 0.3, 0.02, 1.2, 0.45, 0.06], p: [0.0, 0.0] },
            Lens::Fisheye([-0.013, 0.021, -0.018, 0.004]),
        ]
    }

    #[test]
    fn points_are_where_opencv_projects_them() {
        // cv2.projectPoints and cv2.fisheye.projectPoints, OpenCV 5.0.0, of (0.3, -0.2, 1.1).
        let expected = [
            [437.0454545, 160.5454545],
            [433.6148672, 162.8275793],
            [433.6104422, 162.8082008],
            [433.0660447, 163.1668118],
        ];
        for (lens, expected) in lenses().into_iter().zip(expected) {
            let found = camera(lens).project(&Vector3::new(0.3, -0.2, 1.1)).unwrap();
            assert!((found - Vector2::from(expected)).norm() < 1e-6, "{lens:?}: {found}");
        }
    }

    #[test]
    fn every_pixel_has_a_ray_that_leads_back_to_it() {
        for lens in lenses() {
            let camera = camera(lens);
            for pixel in [[0.0, 0.0], [639.0, 0.0], [320.0, 200.0], [12.0, 470.0], [322.5, 236.0]] {
                let ray = camera.ray(pixel.into()).unwrap();
                let back = camera.project(&Vector3::new(2.0 * ray.x, 2.0 * ray.y, 2.0)).unwrap();
                assert!((back - Vector2::from(pixel)).norm() < 1e-5, "{lens:?}, {pixel:?}: {back}");
            }
        }
    }

    #[test]
    fn the_slope_is_that_of_small_steps() {
        for lens in lenses() {
            let camera = camera(lens);
            let point = Vector3::new(-0.4, 0.25, 1.3);
            let (pixel, slope) = camera.look(&point).unwrap();
            for axis in 0..3 {
                let mut near = point;
                near[axis] += 1e-6;
                let step = (camera.project(&near).unwrap() - pixel) / 1e-6;
                assert!((step - slope.column(axis)).norm() < 1e-2, "{lens:?}, axis {axis}");
            }
        }
    }

    #[test]
    fn what_the_camera_cannot_show_has_no_pixel() {
        let barrel = camera(Lens::Radial { k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0, 0.0] });
        assert_eq!(barrel.project(&Vector3::new(0.0, 0.0, -1.0)), None, "behind");
        // Beyond a tangent of sqrt(1 / 0.9) rays would fold back into the image.
        assert!(barrel.project(&Vector3::new(1.0, 0.0, 1.0)).is_some());
        assert_eq!(barrel.project(&Vector3::new(1.1, 0.0, 1.0)), None);
        assert_eq!(barrel.ray(Vector2::new(322.5 + 420.0 * 0.9, 236.0)), None);
        assert_eq!(barrel.project(&Vector3::new(f64::NAN, 0.0, 1.0)), None);
    }

    #[test]
    fn numbers_that_are_no_camera_are_told() {
        let told = Camera::new([640, 480], [0.0, 415.0], [0.0, 0.0], Lens::NONE).unwrap_err().to_string();
        assert_eq!(told, "the focal length is [0.0, 415.0]; expected 1 to 1000000 pixels each");
        let lens = Lens::Fisheye([f64::NAN; 4]);
        assert!(Camera::new([640, 480], [400.0, 400.0], [0.0, 0.0], lens).is_err());
        assert!(Camera::new([640, 0], [400.0, 400.0], [0.0, 0.0], Lens::NONE).is_err());
    }
}
