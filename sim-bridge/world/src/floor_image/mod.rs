//! A camera that looks at a floor of markers: what its image shows.
//!
//! A pure function of the pose, the layout and the faults: equal inputs give equal images, bit for bit. Only markers
//! and their paper are drawn, on an even floor; obstacles are not.

mod faults;
mod paint;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use skein_positioning::markers::{Camera, Grey, Layout, NoImage};

pub use self::faults::{Glare, ImageFaults};
use self::paint::Canvas;

/// Poses that a long exposure is put together from, at most.
const MOST_POSES: f64 = 24.0;
/// The share of a pixel that the image may move between two of them.
const SHARPNESS_PX: f64 = 0.75;

/// A grey image, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<u8>,
}

impl Picture {
    /// The picture for who looks for markers in it.
    pub fn grey(&self) -> Result<Grey<'_>, NoImage> {
        Grey::new(&self.pixels, self.width, self.height)
    }
}

/// Where a camera is in the middle of an exposure, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// From the camera's frame (x to the image's right, y down, z forward) to world ENU.
    pub camera_to_world: Isometry3<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
    /// About the camera's axes, rad/s.
    pub turn_rate: Vector3<f64>,
}

impl View {
    /// A camera at rest.
    pub fn at(camera_to_world: Isometry3<f64>) -> Self {
        Self { camera_to_world, velocity: Vector3::zeros(), turn_rate: Vector3::zeros() }
    }

    /// Where it is so many seconds after the middle of the exposure.
    fn after(&self, seconds: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(self.turn_rate * seconds);
        let place = self.camera_to_world.translation.vector + self.velocity * seconds;
        Isometry3::from_parts(Translation3::from(place), self.camera_to_world.rotation * turn)
    }
}

/// Draws what a camera sees.
#[derive(Clone, Debug)]
pub struct FloorCamera {
    camera: Camera,
    /// Of each pixel the ray, at z = 1; none beyond what the lens shows.
    rays: Vec<Option<Vector2<f64>>>,
}

impl FloorCamera {
    /// Looks up the ray of every pixel.
    pub fn new(camera: Camera) -> Self {
        let (width, height) = (camera.width(), camera.height());
        let ray = |n: usize| camera.ray(Vector2::new((n % width) as f64, (n / width) as f64));
        let rays = (0..width * height).map(ray).collect();
        Self { camera, rays }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The image of a layout. The seed is that of its noise: give each image another one.
    pub fn render(&self, layout: &Layout, view: &View, faults: &ImageFaults, seed: u64) -> Picture {
        let (width, height) = (self.camera.width(), self.camera.height());
        let mut canvas = Canvas::new(&self.camera, &self.rays);
        let poses = self.poses(layout, view, faults.exposure_s);
        for pose in &poses {
            canvas.add(layout, pose, faults.defocus_px, 1.0 / poses.len() as f32);
        }
        let pixels = faults.develop(&self.rays, &view.camera_to_world, canvas.light, seed);
        Picture { width, height, pixels }
    }

    /// The poses of an exposure, so many that the image does not jump from one to the next.
    fn poses(&self, layout: &Layout, view: &View, exposure_s: f64) -> Vec<Isometry3<f64>> {
        let height = view.camera_to_world.translation.z;
        let floor =
            layout.markers().map(|placed| placed.to_world.translation.z).fold(f64::INFINITY, f64::min);
        let distance = (height - floor).clamp(0.1, 1e3);
        let speed = view.turn_rate.norm() + view.velocity.norm() / distance;
        let moved_px = speed * exposure_s * self.camera.focal().max();
        let count = (moved_px / SHARPNESS_PX).ceil().clamp(1.0, MOST_POSES);
        let moment = |n: usize| exposure_s * ((n as f64 + 0.5) / count - 0.5);
        (0..count as usize).map(|n| view.after(moment(n))).collect()
    }
}
